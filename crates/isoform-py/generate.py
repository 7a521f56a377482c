#!/usr/bin/env python3
"""Writes python/isoform/_verbs.py: the functions of the package, one for each verb.

    generate.py PROGRAM

PROGRAM is `isoform`, whose `schema` tells all arguments of all verbs. Here stand the names that
Python has for them, what comes first, and examples; a test of the package finds a stale file.
"""

import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path

OUT = Path(__file__).parent / "python/isoform/_verbs.py"

#: What only a terminal has: Python has exceptions, warnings and progress for it.
TERMINAL = {"json", "quiet", "verbose", "serve", "port", "list", "page", "example"}
#: Arguments with other names in Python, where the name is a word of the language, or another
#: argument takes the same.
NAMES = {"from": "format", "global": "polynomial", "as": "kind", "fix": "fixed"}
#: Types of arguments by key; others follow from the schema.
TYPES = {
    "model": "Shape",
    "scan": "Points | Path",
    "labels": "Sequence[int] | npt.NDArray[Any] | Points | Path | None",
    "kind": "Mapping[int, str] | None",
    "relate": "Sequence[str] | None",
    "template": "Model | Path",
    "map": "Mapping[str, str] | Path",
    "first": "Any",
    "second": "Any",
    "points": "Points | Path",
    "file": "Any",
    "box": "Box",
    "params": "Values",
    "params_second": "Values",
    "set": "Mapping[str, float] | None",
    "fix": "Mapping[str, float] | None",
    "bounds": "Mapping[str, tuple[float, float]] | Path | None",
    "start": "Mapping[str, float] | Sequence[float] | npt.NDArray[Any] | None",
    "regions": "Mapping[str, Region] | Sequence[str] | None",
    "adapt": "Mesh | Path | None",
    "sizes": "Path | None",
    "degree": "tuple[int, int] | None",
    "angles": "tuple[float, float] | None",
    "blocks": "tuple[int, int, int] | None",
    "periodic": "str | None",
    "layers": "str | Sequence[str] | None",
    "seed_point": "Sequence[float] | None",
    "rectangle": "Sequence[Exact] | None",
    "polygon": "Sequence[Sequence[Exact]] | str | None",
    "camera": "Sequence[float] | None",
    "section": "Sequence[float] | None",
    "size": "float | None",
    "views": "Sequence[str] | None",
    "view": "str | None",
    "color_by": "str | None",
    "background": "str | Sequence[int] | None",
    "output": "Path | Sequence[Path] | None",
    "trace": "Path | None",
    "figure": "Path | None",
    "report": "Path | None",
    "sidecar": "Path | None",
    "domain": "Path | None",
}
#: Words of the documentation for types.
SHOWN = {
    "Shape": "Model, Implicit, dict or path",
    "Points | Path": "array_like, PointCloud or path",
    "Model | Path": "Model or path",
    "Mapping[str, str] | Path": "dict or path",
    "Box": "float or sequence, optional",
    "Values": "dict or sequence of float, optional",
    "Any": "object",
}
#: Texts in place of those of the command line, where Python takes more or says it otherwise.
TEXTS = {
    "box": "The box in which to work: half its width around the origin, or its two corners",
    "template": "The template: a model, a HyperFun file, or the name of one of the gallery",
    "model": "The model: a program, a fit, a fitted function, or a file of one",
    "map": "Polynomials in s and t with rational coefficients, {{\"X\": ..., \"Y\": ..., \"Z\": ..., \"W\": ...}}; or a file of them, or of patches",
    "first": "Points (n, 3), a mesh, a model, a solid, or a file of one",
    "second": "The other one",
    "start": "Start values by name, or in the order of the parameters; by default the template's, else the points decide",
    "bounds": "Lower and upper bound by name, in the unit of the points; or a file of them",
    "regions": "Regions with common nodes: models by name, each with the values of its parameters in a tuple where it has any; or objects of the program. What is left is called ``rest``",
    "file": "Points, models, fits, meshes, patches, triangulations, solids, or paths of them",
    "labels": "Search nothing: each number becomes one entity, fitted to exactly its points, -1 none: an array (n,), such as ``Recognition.labels`` after changes, or a file that ``recognize`` has written (labels.ply), perhaps edited",
    "kind": "Kinds of the entities of some labels, {{3: \"cylinder\"}}: plane, sphere, cylinder, cone or torus; by default those which describe their points best",
    "relate": "Relations of two labels that templates keep, [\"parallel=3,5\"]: parallel, perpendicular, coaxial, coplanar, concentric or equal_radius",
    "set": "The values of some parameters by name",
    "fix": "Parameters that are held, by name",
}

#: By verb: the name of the function, arguments that come first, the result and its text, and an
#: example. `file` is the ending of the file that the function gives back.
VERBS = {
    "recover": {
        "head": ["scan", "template"],
        "renamed": {"scan": "points"},
        "result": "FitResult",
        "returns": "The fit, with ``.save(\"part.step\")``; ``.deviation`` is (n,).",
    },
    "fit": {
        "head": ["scan", "template", "start", "bounds", "seed", "threads", "time_limit", "progress"],
        "renamed": {"scan": "points", "template": "model"},
        "left": {"model"},
        "required": {"scan", "template"},
        "result": "FitResult",
        "returns": "Values with deviations and a verdict; ``.deviation`` is (n,).",
        "example": """
            >>> import isoform, numpy as np
            >>> u, v = np.meshgrid(np.linspace(0, 6.2, 40), np.linspace(-1.5, 1.5, 20))
            >>> u, v = u.ravel(), v.ravel()
            >>> on_ball = np.stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)], 1)
            >>> result = isoform.fit(2 * on_ball + [1, 0, 0], isoform.template("sphere"))
            >>> round(result.values["radius"], 6), result.acceptable
            (2.0, True)
        """,
    },
    "mesh": {
        "head": ["model", "size", "order", "surface_only", "threads"],
        # distributed.mesh_blocks does that.
        "left": {"blocks"},
        "result": "Mesh",
        "returns": "With ``.points`` (n, 3), ``.triangles`` (m, 3), ``.tetrahedra`` (k, 4); with layers also ``.wedges`` (w, 6) and ``.quads`` (q, 4).",
        "example": """
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
        """,
    },
    "brep": {
        "head": ["model", "size", "tol"],
        "types": {"model": "Model | Path"},
        "result": "Brep",
        "returns": "The solids, with ``.save(\"part.step\")``.",
    },
    "parameterize": {
        "head": ["model", "degree", "box", "tol", "cover"],
        "texts": {
            "model": "The surface: a model, a polynomial {{\"F\": \"x^2 + y^2 + z^2 - 1\"}}, or a file of one"
        },
        "result": "Patches",
        "returns": "A sequence; each has ``.control`` (m+1, n+1, 4), ``.bound`` and ``.evaluate(u, v)`` to (..., 3), as (n, 3) for n parameters.",
        "half": True,
        "example": """
            >>> import isoform
            >>> patches = isoform.parameterize({"F": "x^2 + y^2 + z^2 - 1/4"}, (2, 2), tol=1e-3)
            >>> patches[0].control.shape, patches[0].bound <= 1e-3
            ((3, 3, 4), True)
        """,
    },
    "triangulate": {
        "head": ["map", "box", "tol"],
        "result": "Triangulation",
        "types": {"box": "Exact | None"},
        "returns": "With ``.points`` (n, 3), ``.triangles`` (m, 3) and ``.parameters`` (n, 2).",
        "half": True,
        "example": """
            >>> import isoform
            >>> sphere = {"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}
            >>> isoform.triangulate(sphere, box=2, tol=0.01).to_dict()["ok"]
            True
        """,
    },
    "implicitize": {
        "head": ["scan", "degree", "tol", "cells"],
        "renamed": {"scan": "points"},
        "types": {"degree": "int | None", "output": "Path | None"},
        "result": "Implicit",
        "returns": "A function of points (n, 3), positive inside.",
    },
    "recognize": {
        "head": ["scan", "tol", "min_points", "snap"],
        "renamed": {"scan": "points"},
        "result": "Recognition",
        "returns": "Entities with standard deviations; ``.labels`` is (n,).",
    },
    "eval": {
        "name": "evaluate",
        "head": ["model", "points"],
        "types": {"points": "Path", "output": "Path | None"},
        "result": "Report",
        "returns": "The table of a file of points, (n, 3); a `Model` is called with arrays.",
    },
    "inspect": {
        "head": ["file"],
        "types": {"file": "Points | Path"},
        "result": "Report",
        "returns": "Counts, box, spacing and unit of a file of points (n, 3), or of a mesh.",
    },
    "convert": {
        "head": ["file", "output"],
        "types": {"file": "Path", "output": "Path"},
        "result": "Report",
        "returns": "What was read and written, of points (n, 3) their number.",
    },
    "functions": {
        "head": ["name"],
        "result": "Report",
        "returns": "``functions``: names, arguments, description and example of each.",
    },
    "compare": {
        "shapes": {"first", "second"},
        "head": ["first", "second"],
        "result": "Comparison",
        "returns": "Distances of the first from the second and back, of (n,) samples each.",
        "example": """
            >>> import isoform
            >>> isoform.compare([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [1, 0, 1]]).first_to_second["max"]
            1.0
        """,
    },
    "view": {
        "head": ["file"],
        "result": "View",
        "file": ["html"],
        "half": True,
        "extra": [("height", "int = 560", "int", "Pixels of the frame in a notebook.")],
        "returns": "A notebook shows it; ``.save(\"page.html\")`` writes it.",
        "example": """
            >>> import isoform
            >>> page = isoform.view(isoform.template("sphere"), params={"radius": 1})
            >>> page._repr_html_().startswith("<iframe")
            True
        """,
    },
    "render": {
        "head": ["file"],
        "result": "Picture",
        "file": ["png", "svg"],
        "half": True,
        "types": {"size": "tuple[int, int] | None"},
        "extra": [("svg", "bool = False", "bool", "A drawing of lines and areas, not a picture of pixels.")],
        "returns": "A notebook shows it; ``.save(\"picture.png\")`` writes it, ``.data`` are its bytes.",
        "example": """
            >>> import isoform
            >>> ball = isoform.template("sphere")
            >>> picture = isoform.render(ball, params={"radius": 1}, size=(80, 60))
            >>> picture.data.startswith(b"\\\\x89PNG")
            True
        """,
    },
}

#: Arguments that are shapes, or files of them.
SHAPES = {"model", "scan", "template", "map", "points", "file", "adapt"}
#: What makes files of others.
FILES = {"bounds": "bounds_file", "regions": "region_files", "memory": "there"}

COMMON = {
    "threads": ("int | None", "int, optional", "Number of threads, by default all cores. The result does not depend on it."),
    "time_limit": ("float | None", "float, optional", "Seconds after which the best so far is taken, or the work ends."),
    "progress": ("Progress", "callable or bool, optional", "Called with the name of a phase and the share of it that is done, 0 to 1; False from it stops. True shows a bar."),
}

HEAD = '''"""The verbs of Isoform as functions. Written by generate.py; do not edit."""

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
'''


def sentence(text):
    """A help text of the command line as a sentence of Python's documentation."""
    text = re.sub(r"\s*\[default: ([^\]]*)\]", r"; by default \1", text)
    text = re.sub(r"--([a-z][a-z-]*)", lambda m: f"``{m[1].replace('-', '_')}``", text)
    text = re.sub(r"(?<![\w`])-o(?![\w-])", "``output``", text)
    text = text.replace(" (- for stdin)", "").replace(" (- for stdout)", "").replace("- for stdin, ", "")
    return text.rstrip(".") + "."


def kinds(verb, key, schema):
    """The type of an argument, and its words."""
    special = verb.get("types", {}).get(key, TYPES.get(key))
    if special:
        annotation = special
    elif schema.get("type") == "boolean":
        annotation = "bool"
    elif schema.get("type") == "integer":
        annotation = "int | None"
    elif schema.get("type") == "number":
        annotation = "float | None"
    else:
        annotation = "str | None"
    shown = SHOWN.get(annotation)
    if not shown:
        shown = annotation.replace(" | None", ", optional").replace(" | ", " or ")
        shown = re.sub(r"npt.NDArray\[Any\]", "array", shown)
        shown = re.sub(r"(Mapping|Sequence)\[.*?\](?=,| or |$)", lambda m: "dict" if m[1] == "Mapping" else "sequence", shown)
        shown = re.sub(r"tuple\[(\w+)[^\]]*\]", r"tuple of \1", shown).replace("Path", "path").replace("bool", "bool")
    return annotation, shown


def value(verb, key, schema, name):
    """The expression that hands an argument over."""
    if key == "box" and not verb.get("half"):
        return f"corners({name})"
    if key == "start":
        return f"in_order({name}, {verb.get('renamed', {}).get('template', 'template')})"
    if key == "labels":
        return f"label_file({name}, points)"
    if key == "file" and verb.get("file"):
        return "layer_files((obj, *others))"
    if key in verb.get("shapes", SHAPES):
        return f"handed({name})"
    if key in FILES:
        return f"{FILES[key]}({name})"
    if schema.get("type") == "boolean":
        return f"bool({name})"
    if schema.get("type") == "integer" and key not in COMMON:
        return f'some_whole("{name}", {name})'
    return name


def function(schema, verb):
    """The text of a function."""
    title = schema["title"]
    properties = {k: p for k, p in schema["properties"].items() if k not in TERMINAL | {"verb"} | verb.get("left", set())}
    if verb.get("file"):
        properties.pop("output")
    for key in COMMON:
        properties[key] = {}
    if title == "recover":
        required = set()
    else:
        required = verb.get("required", set()) | set(schema["required"])
    head = verb["head"]
    order = head + [k for k in properties if k not in head and k not in COMMON] + [k for k in COMMON if k not in head]
    signature, documented, passed = [], [], []
    for number, key in enumerate(order):
        if number == len(head) and not verb.get("file"):
            signature.append("*")
        argument = properties[key]
        name = verb.get("renamed", {}).get(key, NAMES.get(key, key))
        if key in COMMON:
            annotation, shown, text = COMMON[key]
            signature.append(f"{name}: {annotation} = None")
            documented.append((name, shown, text))
            continue
        annotation, shown = kinds(verb, key, argument)
        text = argument.get("description", "")
        texts = {**TEXTS, **verb.get("texts", {})}
        text = texts[key].format() if key in texts else text
        names = argument.get("enum")
        if names:
            text += ": " + ", ".join(f"``\"{n}\"``" for n in names)
        if key == "file" and verb.get("file"):
            signature += ["obj: Any", "*others: Any"]
            documented += [("obj", "object", sentence(text)), ("*others", "object", "Further ones, as layers in their order.")]
        elif annotation == "bool":
            signature.append(f"{name}: bool = False")
            documented.append((name, "bool", sentence(text)))
        elif key in required:
            annotation = annotation.replace(" | None", "")
            signature.append(f"{name}: {annotation}")
            documented.append((name, shown.replace(", optional", ""), sentence(text)))
        else:
            optional = annotation if "None" in annotation or annotation in ("Values", "Box", "Any") else f"{annotation} | None"
            signature.append(f"{name}: {optional} = None")
            shown = shown if "optional" in shown else f"{shown}, optional"
            documented.append((name, shown, sentence(text)))
        passed.append((key, value(verb, key, argument, name)))
    for name, declared, shown, text in verb.get("extra", ()):
        signature.append(f"{name}: {declared}")
        documented.append((name, shown, text))
    name = verb.get("name", title)
    lines = [f"def {name}("] + [f"    {s}," for s in signature] + [f") -> {verb['result']}:"]
    lines.append(f'    """{sentence(schema["description"])}')
    if len(lines[-1]) > 100:
        raise SystemExit(f"{title}: the summary is longer than a line")
    lines += ["", "    Parameters", "    ----------"]
    for parameter, shown, text in documented:
        lines.append(f"    {parameter} : {shown}")
        lines += textwrap.wrap(text, 92, initial_indent=" " * 8, subsequent_indent=" " * 8, break_long_words=False)
    lines += ["", "    Returns", "    -------", f"    {verb['result']}"]
    lines += textwrap.wrap(verb["returns"], 92, initial_indent=" " * 8, subsequent_indent=" " * 8)
    lines += ["", "    Raises", "    ------", "    IsoformError", "        If there is no result, or an argument cannot be.", "    KeyboardInterrupt", "        After Ctrl-C, within two seconds."]
    if "example" in verb:
        lines += ["", "    Examples", "    --------"]
        lines += [("    " + line).rstrip() for line in textwrap.dedent(verb["example"]).strip().splitlines()]
    lines.append('    """')
    lines.append("    arguments = {")
    lines += [f'        "{key}": {text},' for key, text in passed]
    lines.append("    }")
    call = f'"{title}", arguments, threads, time_limit, progress'
    if verb["result"] == "View":
        lines.append(f'    made: View = written(View, "html", {call})')
        lines += ["    made.height = height", "    return made"]
    elif verb["result"] == "Picture":
        lines.append(f'    made: Picture = written(Picture, "svg" if svg else "png", {call})')
        lines.append("    return made")
    else:
        lines.append(f"    return {verb['result']}(run({call}))")
    return "\n".join(lines) + "\n"


def text(schema):
    """The whole file."""
    verbs = {s["title"]: s for s in schema["oneOf"]}
    missing = set(verbs) ^ set(VERBS)
    if missing:
        raise SystemExit(f"verbs of one side only: {', '.join(sorted(missing))}")
    return "\n\n".join([HEAD] + [function(verbs[name], verb) for name, verb in VERBS.items()])


def main():
    (program,) = sys.argv[1:]
    schema = json.loads(subprocess.run([program, "schema"], check=True, capture_output=True, text=True).stdout)
    OUT.write_text(text(schema))


if __name__ == "__main__":
    main()
