"""The verbs of Isoform as functions. Written by generate.py; do not edit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, Union

import numpy.typing as npt

from ._call import (
    Progress,
    bounds_file,
    corners,
    handed,
    in_order,
    label_file,
    layer_files,
    region_files,
    run,
    some_whole,
    there,
    written,
)
from ._mesh import Mesh
from ._model import Model, Values
from ._points import Path, Points
from ._results import (
    Brep,
    Comparison,
    FitResult,
    Implicit,
    Patches,
    Picture,
    Recognition,
    Report,
    Triangulation,
    View,
)

#: What has a surface: a model, a fitted function, a polynomial {"F": ...}, or a file of one.
Shape = Union[Model, Implicit, Mapping[str, str], Path]
#: A region: a model, or one with the values of its parameters.
Region = Union[Model, tuple[Model, Values]]
#: Half the width of a box around the origin, its two corners, or their six numbers.
Box = Union[float, Sequence[float], Sequence[Sequence[float]], None]
#: A number that is taken exactly: 0.1 is a tenth, and so are "1/10" and Fraction(1, 10).
Exact = Union[int, float, str, Fraction]


def recover(
    points: Points | Path | None = None,
    template: Model | Path | None = None,
    *,
    output: Path | Sequence[Path] | None = None,
    dialect: str | None = None,
    frame: str | None = None,
    units: str | None = None,
    box: Box = None,
    no_outlier_filter: bool = False,
    keep_planes: bool = False,
    keep_apart: bool = False,
    size: float | None = None,
    grade: float | None = None,
    sizes: Path | None = None,
    order: int | None = None,
    surface_only: bool = False,
    angles: tuple[float, float] | None = None,
    memory: float | None = None,
    labels: Sequence[int] | npt.NDArray[Any] | Points | Path | None = None,
    kind: Mapping[int, str] | None = None,
    relate: Sequence[str] | None = None,
    start: Mapping[str, float] | Sequence[float] | npt.NDArray[Any] | None = None,
    bounds: Mapping[str, tuple[float, float]] | Path | None = None,
    method: str | None = None,
    loss: str | None = None,
    fixed: Mapping[str, float] | None = None,
    pose: str | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> FitResult:
    """Recovers a model from a scan: fit, deviations, mesh and report in one go.

    Parameters
    ----------
    points : array_like, PointCloud or path, optional
        The points; by default the scan of a cup that is built in.
    template : Model or path, optional
        The template: a model, a HyperFun file, or the name of one of the gallery.
    output : path or sequence, optional
        Write a file; by its ending: .hf, .ply, .xyz, .csv, .html, .json, a solid: .step,
        .brep.json, or a mesh: .msh, .inp, .vtu, .stl, ...; or, to FOLDER/, what there is
        without ``output``.
    dialect : str, optional
        Language of .py files: the program of the part in its own frame: ``"build123d"``,
        ``"cadquery"``.
    frame : str, optional
        Coordinates of the program, the solid and the mesh that are written: ``"scan"``,
        ``"part"``.
    units : str, optional
        Unit of the scan's numbers; by default as the file says, else guessed from the size:
        ``"mm"``, ``"cm"``, ``"m"``, ``"in"``, ``"ft"``.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    no_outlier_filter : bool
        Keep isolated points.
    keep_planes : bool
        Fit tables and walls, too: where a fit is in doubt, planes beyond the part are left
        out.
    keep_apart : bool
        Fit other objects, too: where a fit is in doubt, points apart from the part are left
        out.
    size : float, optional
        Length of edges, the largest one where sizes vary; by default a fortieth of the
        diagonal.
    grade : float, optional
        Smaller edges where a face would leave the surface by more than this.
    sizes : path, optional
        Smaller edges by place: a table x,y,z,length (of a refinement, or from an error
        estimate), or a HyperFun program of the length.
    order : int, optional
        2 for elements with nodes in the middles of their edges, on the true surface.
    surface_only : bool
        Only the surface, as triangles.
    angles : tuple of float, optional
        Bounds of the dihedral angles, degrees: worked towards, and required in the
        certificate; by default 21,149, not required.
    memory : float, optional
        Refuse a mesh that takes more memory than this many GiB, by estimate; by default 16,
        or what the machine has.
    labels : sequence or array or Points or path, optional
        Search nothing: each number becomes one entity, fitted to exactly its points, -1
        none: an array (n,), such as ``Recognition.labels`` after changes, or a file that
        ``recognize`` has written (labels.ply), perhaps edited.
    kind : dict, optional
        Kinds of the entities of some labels, {3: "cylinder"}: plane, sphere, cylinder, cone
        or torus; by default those which describe their points best.
    relate : sequence, optional
        Relations of two labels that templates keep, ["parallel=3,5"]: parallel,
        perpendicular, coaxial, coplanar, concentric or equal_radius.
    start : dict or sequence or array, optional
        Start values by name, or in the order of the parameters; by default the template's,
        else the points decide.
    bounds : dict or path, optional
        Lower and upper bound by name, in the unit of the points; or a file of them.
    method : str, optional
        Search method; hybrid, local, annealing and bfgs are those of Fayolle et al. (2004):
        ``"default"``, ``"hybrid"``, ``"local"``, ``"bfgs"``, ``"annealing"``.
    loss : str, optional
        The loss of the last, metric stage; auto is robust where it must be: ``"auto"``,
        ``"squares"``, ``"cauchy"``, ``"tukey"``.
    fixed : dict, optional
        Parameters that are held, by name.
    pose : str, optional
        Motion of the whole template as further parameters; by default as the template says:
        ``"none"``, ``"translate"``, ``"axis"``, ``"rigid"``, ``"similarity"``.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    FitResult
        The fit, with ``.save("part.step")``; ``.deviation`` is (n,).

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "scan": handed(points),
        "template": handed(template),
        "output": output,
        "dialect": dialect,
        "frame": frame,
        "units": units,
        "box": corners(box),
        "no_outlier_filter": bool(no_outlier_filter),
        "keep_planes": bool(keep_planes),
        "keep_apart": bool(keep_apart),
        "size": size,
        "grade": grade,
        "sizes": sizes,
        "order": some_whole("order", order),
        "surface_only": bool(surface_only),
        "angles": angles,
        "memory": there(memory),
        "labels": label_file(labels, points),
        "kind": kind,
        "relate": relate,
        "start": in_order(start, template),
        "bounds": bounds_file(bounds),
        "method": method,
        "loss": loss,
        "fix": fixed,
        "pose": pose,
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return FitResult(run("recover", arguments, threads, time_limit, progress))


def fit(
    points: Points | Path,
    model: Model | Path,
    start: Mapping[str, float] | Sequence[float] | npt.NDArray[Any] | None = None,
    bounds: Mapping[str, tuple[float, float]] | Path | None = None,
    seed: int | None = None,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
    *,
    output: Path | Sequence[Path] | None = None,
    dialect: str | None = None,
    frame: str | None = None,
    units: str | None = None,
    format: str | None = None,
    max_points: int | None = None,
    no_outlier_filter: bool = False,
    keep_planes: bool = False,
    keep_apart: bool = False,
    method: str | None = None,
    loss: str | None = None,
    fixed: Mapping[str, float] | None = None,
    pose: str | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    force: bool = False,
) -> FitResult:
    """Fits a template to points.

    Parameters
    ----------
    points : array_like, PointCloud or path
        The points: PLY, XYZ, CSV, OBJ, OFF, STL, 3MF, PCD, LAS, LAZ, E57.
    model : Model or path
        The template: a model, a HyperFun file, or the name of one of the gallery.
    start : dict or sequence or array, optional
        Start values by name, or in the order of the parameters; by default the template's,
        else the points decide.
    bounds : dict or path, optional
        Lower and upper bound by name, in the unit of the points; or a file of them.
    seed : int, optional
        Seed of everything random.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.
    output : path or sequence, optional
        Write a file; by its ending: .hf (fitted program), .py (program for build123d or
        CadQuery), .scad (for OpenSCAD), .ply .xyz .csv (points with deviations), .html
        (report), .json, .step .brep.json (solid).
    dialect : str, optional
        Language of .py files: the program of the part in its own frame: ``"build123d"``,
        ``"cadquery"``.
    frame : str, optional
        Coordinates of the program, the solid and the mesh that are written: ``"scan"``,
        ``"part"``.
    units : str, optional
        Unit of the scan's numbers; by default as the file says, else guessed from the size:
        ``"mm"``, ``"cm"``, ``"m"``, ``"in"``, ``"ft"``.
    format : str, optional
        Format of the points, where neither name nor content tell it.
    max_points : int, optional
        Take at most that many points, a seeded random sample.
    no_outlier_filter : bool
        Keep isolated points.
    keep_planes : bool
        Fit tables and walls, too: where a fit is in doubt, planes beyond the part are left
        out.
    keep_apart : bool
        Fit other objects, too: where a fit is in doubt, points apart from the part are left
        out.
    method : str, optional
        Search method; hybrid, local, annealing and bfgs are those of Fayolle et al. (2004):
        ``"default"``, ``"hybrid"``, ``"local"``, ``"bfgs"``, ``"annealing"``.
    loss : str, optional
        The loss of the last, metric stage; auto is robust where it must be: ``"auto"``,
        ``"squares"``, ``"cauchy"``, ``"tukey"``.
    fixed : dict, optional
        Parameters that are held, by name.
    pose : str, optional
        Motion of the whole template as further parameters; by default as the template says:
        ``"none"``, ``"translate"``, ``"axis"``, ``"rigid"``, ``"similarity"``.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.

    Returns
    -------
    FitResult
        Values with deviations and a verdict; ``.deviation`` is (n,).

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform, numpy as np
    >>> u, v = np.meshgrid(np.linspace(0, 6.2, 40), np.linspace(-1.5, 1.5, 20))
    >>> u, v = u.ravel(), v.ravel()
    >>> on_ball = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], 1)
    >>> result = isoform.fit(2 * on_ball + [1, 0, 0], isoform.template("sphere"))
    >>> round(result.values["radius"], 6), result.acceptable
    (2.0, True)
    """
    arguments = {
        "scan": handed(points),
        "template": handed(model),
        "start": in_order(start, model),
        "bounds": bounds_file(bounds),
        "seed": some_whole("seed", seed),
        "output": output,
        "dialect": dialect,
        "frame": frame,
        "units": units,
        "from": format,
        "max_points": some_whole("max_points", max_points),
        "no_outlier_filter": bool(no_outlier_filter),
        "keep_planes": bool(keep_planes),
        "keep_apart": bool(keep_apart),
        "method": method,
        "loss": loss,
        "fix": fixed,
        "pose": pose,
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "force": bool(force),
    }
    return FitResult(run("fit", arguments, threads, time_limit, progress))


def mesh(
    model: Shape,
    size: float | None = None,
    order: int | None = None,
    surface_only: bool = False,
    threads: int | None = None,
    *,
    output: Path | Sequence[Path] | None = None,
    to: str | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    box: Box = None,
    grade: float | None = None,
    sizes: Path | None = None,
    angles: tuple[float, float] | None = None,
    memory: float | None = None,
    adapt: Mesh | Path | None = None,
    regions: Mapping[str, Region] | Sequence[str] | None = None,
    periodic: str | None = None,
    layers: str | Sequence[str] | None = None,
    first: Any = None,
    growth: float | None = None,
    layer_count: int | None = None,
    close: bool = False,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Mesh:
    """Meshes a model: tetrahedra with their labelled surface.

    Parameters
    ----------
    model : Model, Implicit, dict or path
        The model: a program, a fit, a fitted function, or a file of one.
    size : float, optional
        Length of edges, the largest one where sizes vary; by default a fortieth of the
        diagonal.
    order : int, optional
        2 for elements with nodes in the middles of their edges, on the true surface.
    surface_only : bool
        Only the surface, as triangles.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    output : path or sequence, optional
        Write a file; its ending names the format (- for stdout, with ``to``); may be
        repeated.
    to : str, optional
        Format of the output, where its name does not tell it.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    grade : float, optional
        Smaller edges where a face would leave the surface by more than this.
    sizes : path, optional
        Smaller edges by place: a table x,y,z,length (of a refinement, or from an error
        estimate), or a HyperFun program of the length.
    angles : tuple of float, optional
        Bounds of the dihedral angles, degrees: worked towards, and required in the
        certificate; by default 21,149, not required.
    memory : float, optional
        Refuse a mesh that takes more memory than this many GiB, by estimate; by default 16,
        or what the machine has.
    adapt : Mesh or path, optional
        Improve this mesh on the model instead of making a new one: tetrahedra (msh, vtu,
        inp), or a surface (stl, obj, ply, off, 3mf, msh), whose triangles are made as long
        as ``size`` says, or as they were.
    regions : dict or sequence, optional
        Regions with common nodes: models by name, each with the values of its parameters in
        a tuple where it has any; or objects of the program. What is left is called
        ``rest``.
    periodic : str, optional
        Mesh the box as a unit cell that repeats along these axes, as xyz or z: opposite
        sides have equal triangles, node for node. The function must be periodic in the box.
    layers : str or sequence, optional
        Grow layers of wedges inward from these parts of the surface, for flow near walls; *
        in a name stands for any characters.
    first : object, optional
        Points (n, 3), a mesh, a model, a solid, or a file of one.
    growth : float, optional
        Ratio of the thicknesses of consecutive ``layers``; by default 1.2.
    layer_count : int, optional
        Number of ``layers``; by default 5.
    close : bool
        Keep the surface of a fitted function beyond its points, as a part named unseen.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Mesh
        With ``.points`` (n, 3), ``.triangles`` (m, 3), ``.tetrahedra`` (k, 4); with layers
        also ``.wedges`` (w, 6) and ``.quads`` (q, 4).

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> ball = isoform.mesh(isoform.template("sphere"), size=0.3, params={"radius": 1})
    >>> ball.is_watertight, round(ball.volume)
    (True, 4)

    Regions are objects of a program, or models of their own.

    >>> core = isoform.template("sphere"), {"radius": 0.5}
    >>> ball = isoform.template("sphere")
    >>> ball = isoform.mesh(ball, 0.3, params={"radius": 1}, regions={"core": core})
    >>> ball.region_names, [r["certificate"]["ok"] for r in ball.to_dict()["region_certificates"]]
    (['core', 'rest'], [True, True])

    A unit cell has the same nodes on opposite sides.

    >>> bars = "bars(x[3], a[1]) { bars = (0.1 - x[2]^2 - x[3]^2) | (0.1 - x[1]^2 - x[3]^2); }"
    >>> cell = isoform.mesh(isoform.Model(bars), 0.2, box=0.5, periodic="xyz")
    >>> lower, upper = cell.points[cell.opposite["x"].T]
    >>> len(lower) > 9, bool((lower + [1, 0, 0] == upper).all())
    (True, True)
    """
    arguments = {
        "model": handed(model),
        "size": size,
        "order": some_whole("order", order),
        "surface_only": bool(surface_only),
        "output": output,
        "to": to,
        "params": params,
        "set": set,
        "box": corners(box),
        "grade": grade,
        "sizes": sizes,
        "angles": angles,
        "memory": there(memory),
        "adapt": handed(adapt),
        "regions": region_files(regions),
        "periodic": periodic,
        "layers": layers,
        "first": first,
        "growth": growth,
        "layer_count": some_whole("layer_count", layer_count),
        "close": bool(close),
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Mesh(run("mesh", arguments, threads, time_limit, progress))


def brep(
    model: Model | Path,
    size: float | None = None,
    tol: float | None = None,
    *,
    output: Path | Sequence[Path] | None = None,
    ap214: bool = False,
    units: str | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    box: Box = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Brep:
    """Writes a model as a solid of exact faces for CAD (STEP).

    Parameters
    ----------
    model : Model or path
        The model: a program, a fit, a fitted function, or a file of one.
    size : float, optional
        Length of the edges of the mesh that the topology comes from; by default a fortieth
        of the diagonal.
    tol : float, optional
        Largest distance of faces from the model, in its units; by default 1e-6 of its
        largest side; exact faces are within 1e-8 of it, whatever the value.
    output : path or sequence, optional
        Write a STEP file (.step, .stp; - for stdout), or our own form without loss
        (.brep.json); may be repeated.
    ap214 : bool
        Write the older AP214 instead of AP242.
    units : str, optional
        Unit of length to state: um, mm, cm, m, in or ft; by default as annotated, else mm.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Brep
        The solids, with ``.save("part.step")``.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "model": handed(model),
        "size": size,
        "tol": tol,
        "output": output,
        "ap214": bool(ap214),
        "units": units,
        "params": params,
        "set": set,
        "box": corners(box),
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Brep(run("brep", arguments, threads, time_limit, progress))


def parameterize(
    model: Shape,
    degree: tuple[int, int] | None = None,
    box: Box = None,
    tol: float | None = None,
    cover: bool = False,
    *,
    output: Path | Sequence[Path] | None = None,
    trace: Path | None = None,
    figure: Path | None = None,
    grid: int | None = None,
    units: str | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    seed_point: Sequence[float] | None = None,
    paper: bool = False,
    exact: bool = False,
    margin: float | None = None,
    singular: float | None = None,
    patches: int | None = None,
    method: str | None = None,
    inner: str | None = None,
    extrapolations: int | None = None,
    nodes: int | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Patches:
    """Finds a rational patch as large as possible on the surface of a model.

    Parameters
    ----------
    model : Model, Implicit, dict or path
        The surface: a model, a polynomial {"F": "x^2 + y^2 + z^2 - 1"}, or a file of one.
    degree : tuple of int, optional
        The degrees of the patch in u and in v.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    tol : float, optional
        Make the patch as large as possible within this proved distance of the surface,
        instead of a bound on S.
    cover : bool
        Add patches until all of the surface in the box lies on one, within ``tol``.
    output : path or sequence, optional
        Write the patches: .json, .step or .stp for CAD, or triangles as .obj, .ply, .glb,
        ...; may be repeated.
    trace : path, optional
        Write every step as a table (CSV).
    figure : path, optional
        Draw S, I and E over the steps, and the squared Sampson distance over the domain
        (SVG).
    grid : int, optional
        Number of squares along each side of a patch for its triangles.
    units : str, optional
        Unit of length that files state; by default mm in STEP, none in others: ``"um"``,
        ``"mm"``, ``"cm"``, ``"m"``, ``"in"``, ``"ft"``.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    seed_point : sequence, optional
        Start at the point of the surface near this one, instead of one chosen by ``seed``.
    paper : bool
        The paper's settings: factors and thresholds of its Table 2, S <= 1e-6 (the default;
        takes no other bound).
    exact : bool
        Afterwards bring the patch onto the surface to rounding, where its degree admits
        that.
    margin : float, optional
        With ``cover``: every point of the surface in the box so deep inside of some patch,
        that is so far from its border, proved; as ``tol`` a length. Patches reach beyond
        the box as far.
    singular : float, optional
        With ``cover``: what is nearer than this to a singular point, as at self-
        intersections, may be left out where no patch is found, which is said; by default a
        hundredth of the box.
    patches : int, optional
        Maximum number of patches, with ``cover``.
    method : str, optional
        Method of computing steps: ``"gauss-newton"``, ``"frozen"``, ``"newton"``.
    inner : str, optional
        Quantity that the term L measures: ``"lengths"``, ``"tangents"``.
    extrapolations : int, optional
        Stop after this number of extrapolations, to see how the patch grows: 0 is the start
        patch after its first Newton steps.
    nodes : int, optional
        Gauss nodes in each direction; by default as many as make J exact, 4 max(m,n) + 1.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Patches
        A sequence; each has ``.control`` (m+1, n+1, 4), ``.bound`` and ``.evaluate(u, v)``
        to (..., 3), as (n, 3) for n parameters.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> patches = isoform.parameterize({"F": "x^2 + y^2 + z^2 - 1/4"}, (2, 2), tol=1e-3)
    >>> patches[0].control.shape, patches[0].bound <= 1e-3
    ((3, 3, 4), True)
    """
    arguments = {
        "model": handed(model),
        "degree": degree,
        "box": box,
        "tol": tol,
        "cover": bool(cover),
        "output": output,
        "trace": trace,
        "figure": figure,
        "grid": some_whole("grid", grid),
        "units": units,
        "params": params,
        "set": set,
        "seed_point": seed_point,
        "paper": bool(paper),
        "exact": bool(exact),
        "margin": margin,
        "singular": singular,
        "patches": some_whole("patches", patches),
        "method": method,
        "inner": inner,
        "extrapolations": some_whole("extrapolations", extrapolations),
        "nodes": some_whole("nodes", nodes),
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Patches(run("parameterize", arguments, threads, time_limit, progress))


def triangulate(
    map: Mapping[str, str] | Path,
    box: Exact | None = None,
    tol: float | None = None,
    *,
    output: Path | Sequence[Path] | None = None,
    to: str | None = None,
    report: Path | None = None,
    sidecar: Path | None = None,
    domain: Path | None = None,
    rectangle: Sequence[Exact] | None = None,
    polygon: Sequence[Sequence[Exact]] | str | None = None,
    longest: float | None = None,
    triangles: int | None = None,
    mode: str | None = None,
    complex: bool = False,
    reduce: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Triangulation:
    """Triangulates a rational parametric surface in a box.

    Parameters
    ----------
    map : dict or path
        Polynomials in s and t with rational coefficients, {"X": ..., "Y": ..., "Z": ...,
        "W": ...}; or a file of them, or of patches.
    box : Exact, optional
        The box in which to work: half its width around the origin, or its two corners.
    tol : float, optional
        Largest distance of the middles of triangles and edges from the surface; without
        ``box``, B is half its width here; by default 5e-4 B.
    output : path or sequence, optional
        Write a file; its ending names the format (- for stdout, with ``to``); may be
        repeated.
    to : str, optional
        Format of the output, where its name does not tell it.
    report : path, optional
        Write what is known of the surface as JSON: base points, pole, double curve, what is
        not proved.
    sidecar : path, optional
        Write the parameters of every triangle's corners and the kind of every vertex as
        JSON.
    domain : path, optional
        Draw the triangles in the plane of parameters as SVG.
    rectangle : sequence, optional
        Draw only parameters with S0 <= s <= S1 and T0 <= t <= T1, taken as exactly these
        numbers.
    polygon : sequence or str, optional
        Draw only parameters in a polygon with these corners: "0,0 2,0 1,3/2".
    longest : float, optional
        Largest length of edges; without ``box``, B is half the surface's width here; by
        default 0.25 B.
    triangles : int, optional
        Approximate number of triangles at which refinement stops.
    mode : str, optional
        Treatment of sheets that cross; by default glued; for patches normalised:
        ``"glued"``, ``"normalised"``.
    complex : bool
        Draw real points that only complex parameters of an improper map reach, too, as a
        part with a colour of its own.
    reduce : bool
        Divide X, Y, Z and W by their common factor instead of refusing the map.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Triangulation
        With ``.points`` (n, 3), ``.triangles`` (m, 3) and ``.parameters`` (n, 2).

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> sphere = {"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}
    >>> isoform.triangulate(sphere, box=2, tol=0.01).to_dict()["ok"]
    True
    """
    arguments = {
        "map": handed(map),
        "box": box,
        "tol": tol,
        "output": output,
        "to": to,
        "report": report,
        "sidecar": sidecar,
        "domain": domain,
        "rectangle": rectangle,
        "polygon": polygon,
        "longest": longest,
        "triangles": some_whole("triangles", triangles),
        "mode": mode,
        "complex": bool(complex),
        "reduce": bool(reduce),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Triangulation(run("triangulate", arguments, threads, time_limit, progress))


def implicitize(
    points: Points | Path,
    degree: int | None = None,
    tol: float | None = None,
    cells: int | None = None,
    *,
    output: Path | None = None,
    format: str | None = None,
    polynomial: int | None = None,
    normals: str | None = None,
    smoothing: float | None = None,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Implicit:
    """Fits a smooth function to a scan, without a template: f = 0 is its surface.

    Parameters
    ----------
    points : array_like, PointCloud or path
        The points: any format that `isoform inspect` reads.
    degree : int, optional
        The degree of the polynomials in each variable.
    tol : float, optional
        Smaller cells where points are farther than this from the surface.
    cells : int, optional
        Maximum number of cells with points, all of one size; at most half the number of
        points.
    output : path, optional
        Write the function.
    format : str, optional
        Format of the scan, where its name does not tell it.
    polynomial : int, optional
        One polynomial of at most this total degree in place of a spline.
    normals : str, optional
        Source of the normals: ``"auto"``, ``"given"``, ``"estimate"``.
    smoothing : float, optional
        The weight of smoothness; more of it rounds edges and averages noise.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Implicit
        A function of points (n, 3), positive inside.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "scan": handed(points),
        "degree": some_whole("degree", degree),
        "tol": tol,
        "cells": some_whole("cells", cells),
        "output": output,
        "from": format,
        "global": some_whole("polynomial", polynomial),
        "normals": normals,
        "smoothing": smoothing,
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Implicit(run("implicitize", arguments, threads, time_limit, progress))


def recognize(
    points: Points | Path,
    tol: float | None = None,
    min_points: int | None = None,
    snap: bool = False,
    *,
    output: Path | Sequence[Path] | None = None,
    format: str | None = None,
    labels: Sequence[int] | npt.NDArray[Any] | Points | Path | None = None,
    kind: Mapping[int, str] | None = None,
    relate: Sequence[str] | None = None,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Recognition:
    """Finds the planes, spheres, cylinders, cones and tori that a scan consists of.

    Parameters
    ----------
    points : array_like, PointCloud or path
        The points: any format that `isoform inspect` reads.
    tol : float, optional
        Standard deviation of points from their surface; if it is larger than their noise,
        tolerance of the object's form; by default estimated from the points.
    min_points : int, optional
        Minimum number of points of an entity; by default as many as are evidence of it.
    snap : bool
        Refit all entities together so that their relations hold exactly; those that
        contradict the points are dropped, and templates are written from these entities; by
        default each entity as its own points have it.
    output : path or sequence, optional
        Write a file, by its ending: .json the entities, .ply, .xyz or .csv the points with
        their entities, .hf a template of them for `fit`.
    format : str, optional
        Format of the scan, where its name does not tell it.
    labels : sequence or array or Points or path, optional
        Search nothing: each number becomes one entity, fitted to exactly its points, -1
        none: an array (n,), such as ``Recognition.labels`` after changes, or a file that
        ``recognize`` has written (labels.ply), perhaps edited.
    kind : dict, optional
        Kinds of the entities of some labels, {3: "cylinder"}: plane, sphere, cylinder, cone
        or torus; by default those which describe their points best.
    relate : sequence, optional
        Relations of two labels that templates keep, ["parallel=3,5"]: parallel,
        perpendicular, coaxial, coplanar, concentric or equal_radius.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Recognition
        Entities with standard deviations; ``.labels`` is (n,).

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "scan": handed(points),
        "tol": tol,
        "min_points": some_whole("min_points", min_points),
        "snap": bool(snap),
        "output": output,
        "from": format,
        "labels": label_file(labels, points),
        "kind": kind,
        "relate": relate,
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Recognition(run("recognize", arguments, threads, time_limit, progress))


def evaluate(
    model: Shape,
    points: Path,
    *,
    output: Path | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    reading: str | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Report:
    """Evaluates a model at points.

    Parameters
    ----------
    model : Model, Implicit, dict or path
        The model: a program, a fit, a fitted function, or a file of one.
    points : path
        The points, a table with commas.
    output : path, optional
        The table, - or nothing for stdout.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    reading : str, optional
        Result per point: the model's own value, its distance-like reading, or the name of
        the nearest part: ``"algebraic"``, ``"metric"``, ``"part"``.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Report
        The table of a file of points, (n, 3); a `Model` is called with arrays.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "model": handed(model),
        "points": handed(points),
        "output": output,
        "params": params,
        "set": set,
        "reading": reading,
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Report(run("eval", arguments, threads, time_limit, progress))


def inspect(
    file: Points | Path,
    *,
    format: str | None = None,
    max_points: int | None = None,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Report:
    """Says what is in a file of points, a mesh or a solid.

    Parameters
    ----------
    file : array_like, PointCloud or path
        Points, models, fits, meshes, patches, triangulations, solids, or paths of them.
    format : str, optional
        Format of the file, if neither name nor content determine it.
    max_points : int, optional
        Look at no more than that many points, a seeded random sample.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Report
        Counts, box, spacing and unit of a file of points (n, 3), or of a mesh.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "file": handed(file),
        "from": format,
        "max_points": some_whole("max_points", max_points),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Report(run("inspect", arguments, threads, time_limit, progress))


def convert(
    file: Path,
    output: Path,
    *,
    to: str | None = None,
    ascii: bool = False,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    box: Box = None,
    format: str | None = None,
    max_points: int | None = None,
    samples: int | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Report:
    """Converts points and meshes from format to format, and programs to 3MF and back.

    Parameters
    ----------
    file : path
        Points, models, fits, meshes, patches, triangulations, solids, or paths of them.
    output : path
        The result; its ending names the format (- for stdout, with ``to``).
    to : str, optional
        Format of the output, where its name does not tell it.
    ascii : bool
        PLY as text.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    format : str, optional
        Format of the input, where neither name nor content tell it.
    max_points : int, optional
        Take at most that many points, a seeded random sample.
    samples : int, optional
        Number of points to sample on the triangles of a mesh, uniformly by area, in place
        of its vertices.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Report
        What was read and written, of points (n, 3) their number.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "file": handed(file),
        "output": output,
        "to": to,
        "ascii": bool(ascii),
        "params": params,
        "set": set,
        "box": corners(box),
        "from": format,
        "max_points": some_whole("max_points", max_points),
        "samples": some_whole("samples", samples),
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Report(run("convert", arguments, threads, time_limit, progress))


def functions(
    name: str | None = None,
    *,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Report:
    """Describes the functions of HyperFun.

    Parameters
    ----------
    name : str, optional
        Name of a function; by default all of them, a line each.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Report
        ``functions``: names, arguments, description and example of each.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.
    """
    arguments = {
        "name": name,
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Report(run("functions", arguments, threads, time_limit, progress))


def compare(
    first: Any,
    second: Any,
    *,
    output: Path | Sequence[Path] | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    params_second: Values = None,
    box: Box = None,
    samples: int | None = None,
    vertices: bool = False,
    align: bool = False,
    tolerance: float | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Comparison:
    """Measures the deviation between two of points, meshes, models and solids, both ways.

    Parameters
    ----------
    first : object
        Points (n, 3), a mesh, a model, a solid, or a file of one.
    second : object
        The other one.
    output : path or sequence, optional
        Write the points of the first with their deviations from the second: .ply with
        colours, .csv or .xyz.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    params_second : dict or sequence of float, optional
        Parameters of the second model, if both are models.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    samples : int, optional
        Approximate number of points taken of a mesh, of a model and of a solid.
    vertices : bool
        Take the vertices of meshes as points.
    align : bool
        Move the points or mesh given first onto the second before they are compared: the
        best fit.
    tolerance : float, optional
        Fail (exit 3) where a distance is larger; those of a surface from points, which are
        as large as the gaps between the points, are not judged.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.

    Returns
    -------
    Comparison
        Distances of the first from the second and back, of (n,) samples each.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> isoform.compare([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [1, 0, 1]]).first_to_second["max"]
    1.0
    """
    arguments = {
        "first": handed(first),
        "second": handed(second),
        "output": output,
        "params": params,
        "set": set,
        "params_second": params_second,
        "box": corners(box),
        "samples": some_whole("samples", samples),
        "vertices": bool(vertices),
        "align": bool(align),
        "tolerance": tolerance,
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    return Comparison(run("compare", arguments, threads, time_limit, progress))


def view(
    obj: Any,
    *others: Any,
    title: str | None = None,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    box: Box = None,
    kind: str | None = None,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
    height: int = 560,
) -> View:
    """Makes one page that shows files as layers, offline, in any browser.

    Parameters
    ----------
    obj : object
        Points, models, fits, meshes, patches, triangulations, solids, or paths of them.
    *others : object
        Further ones, as layers in their order.
    title : str, optional
        The title of the page; by default the names of the files.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    kind : str, optional
        Show files that may be both as points or as meshes; by default PLY as points, OBJ,
        STL, OFF and 3MF as meshes: ``"points"``, ``"mesh"``.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.
    height : int
        Pixels of the frame in a notebook.

    Returns
    -------
    View
        A notebook shows it; ``.save("page.html")`` writes it.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> page = isoform.view(isoform.template("sphere"), params={"radius": 1})
    >>> page._repr_html_().startswith("<iframe")
    True
    """
    arguments = {
        "file": layer_files((obj, *others)),
        "title": title,
        "params": params,
        "set": set,
        "box": box,
        "as": kind,
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    made: View = written(View, "html", "view", arguments, threads, time_limit, progress)
    made.height = height
    return made


def render(
    obj: Any,
    *others: Any,
    params: Values = None,
    set: Mapping[str, float] | None = None,
    box: Box = None,
    kind: str | None = None,
    size: tuple[int, int] | None = None,
    camera: Sequence[float] | None = None,
    view: str | None = None,
    views: Sequence[str] | None = None,
    orthographic: bool = False,
    fov: float | None = None,
    section: Sequence[float] | None = None,
    color_by: str | None = None,
    background: str | Sequence[int] | None = None,
    no_caps: bool = False,
    hatch: bool = False,
    hidden: bool = False,
    no_lines: bool = False,
    no_legend: bool = False,
    object: str | None = None,
    strict: bool = False,
    documented_precedence: bool = False,
    seed: int | None = None,
    force: bool = False,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
    svg: bool = False,
) -> Picture:
    """Draws files as a picture, without a browser.

    Parameters
    ----------
    obj : object
        Points, models, fits, meshes, patches, triangulations, solids, or paths of them.
    *others : object
        Further ones, as layers in their order.
    params : dict or sequence of float, optional
        The values of the parameters a, in their order or as NAME=NUMBER; missing ones are
        as annotated.
    set : dict, optional
        The values of some parameters by name.
    box : float or sequence, optional
        The box in which to work: half its width around the origin, or its two corners.
    kind : str, optional
        Show files that may be both as points or as meshes; by default PLY as points, OBJ,
        STL, OFF and 3MF as meshes: ``"points"``, ``"mesh"``.
    size : tuple of int, optional
        Width and height in pixels.
    camera : sequence, optional
        Positions of the eye and of the target in model units; z points up.
    view : str, optional
        A standard view in which all is seen: iso, front, back, right, left, top, bottom.
    views : sequence, optional
        Several of them on one sheet, with parallel rays and at one scale.
    orthographic : bool
        Parallel rays instead of perspective.
    fov : float, optional
        The angle of view over the height, in degrees.
    section : sequence, optional
        Cut away what has nx x + ny y + nz z > d.
    color_by : str, optional
        Colours of the layers that have such: none, part, deviation, quality, u, v, bound,
        file.
    background : str or sequence, optional
        The colour behind everything: white, black, grey or #rrggbb.
    no_caps : bool
        Leave models and meshes open where the section or the box cuts them, without caps.
    hatch : bool
        Hatch caps of sections, as drawings (.svg) always do.
    hidden : bool
        Draw hidden edges, dashed; in drawings (.svg).
    no_lines : bool
        Leave out lines of edges and outlines.
    no_legend : bool
        Leave out scales and lists of parts.
    object : str, optional
        The object to evaluate; by default my_model, else the first one.
    strict : bool
        Compute what the reference implementation computes, its faults included.
    documented_precedence : bool
        Let set operators bind weaker than + and -, as HyperFun's documentation says.
    seed : int, optional
        Seed of everything random.
    force : bool
        Let results overwrite the files that they come from, and recover make the solid of a
        fit that is in doubt.
    threads : int, optional
        Number of threads, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken, or the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from
        it stops. True shows a bar.
    svg : bool
        A drawing of lines and areas, not a picture of pixels.

    Returns
    -------
    Picture
        A notebook shows it; ``.save("picture.png")`` writes it, ``.data`` are its bytes.

    Raises
    ------
    IsoformError
        If there is no result, or an argument cannot be.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Examples
    --------
    >>> import isoform
    >>> ball = isoform.template("sphere")
    >>> picture = isoform.render(ball, params={"radius": 1}, size=(80, 60))
    >>> picture.data.startswith(b"\\x89PNG")
    True
    """
    arguments = {
        "file": layer_files((obj, *others)),
        "params": params,
        "set": set,
        "box": box,
        "as": kind,
        "size": size,
        "camera": camera,
        "view": view,
        "views": views,
        "orthographic": bool(orthographic),
        "fov": fov,
        "section": section,
        "color_by": color_by,
        "background": background,
        "no_caps": bool(no_caps),
        "hatch": bool(hatch),
        "hidden": bool(hidden),
        "no_lines": bool(no_lines),
        "no_legend": bool(no_legend),
        "object": object,
        "strict": bool(strict),
        "documented_precedence": bool(documented_precedence),
        "seed": some_whole("seed", seed),
        "force": bool(force),
    }
    made: Picture = written(Picture, "svg" if svg else "png", "render", arguments, threads, time_limit, progress)
    return made
