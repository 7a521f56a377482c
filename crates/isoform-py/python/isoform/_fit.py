"""Fits: the parameters of a template from points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Progress, asked, whole
from ._document import Documented, Shown
from ._errors import IsoformError
from ._model import Model
from ._points import Points, as_cloud

#: Bounds of parameters by name.
Bounds = Union[Mapping[str, tuple[float, float]], None]


class FitResult(Documented, Shown):
    """A template fitted to points.

    Attributes
    ----------
    values, sd, ci95, status : dict
        By parameter: its value, standard deviation (None where the points leave it open), 95 %
        interval and what the points say of it, in the unit of the points.
    rms : float
        Root mean square distance of the points used, in their unit.
    verdict : str
        ``"accepted"``, ``"doubtful"`` or ``"refused"``.
    acceptable : bool
        Whether the fit is accepted.
    reasons : list of str
        What stands against it.
    deviation : numpy.ndarray
        (n,) float64: how far each point is from the model, positive outside.
    points : numpy.ndarray
        (n, 3) float64: the points that were fitted.
    outliers : numpy.ndarray
        (n,) bool: which of them were left out.
    model : Model
        The template with the values, where the points are.
    """

    def __init__(self, native: _isoform.Fit, name: str) -> None:
        self._native: _isoform.Fit | None = native
        self._document = native.document
        self._name = name
        document = self.to_dict()
        rows = document["parameters"]
        self.values: dict[str, float] = {p["name"]: p["value"] for p in rows}
        self.sd: dict[str, float | None] = {p["name"]: p["sd"] for p in rows}
        self.ci95: dict[str, list[float] | None] = {p["name"]: p["ci95"] for p in rows}
        self.status: dict[str, str] = {p["name"]: p["status"] for p in rows}
        self.rms: float = document["rms"]
        self.verdict: str = document["verdict"]
        self.acceptable: bool = document["acceptable"]
        self.reasons: list[str] = document["reasons"]

    @property
    def _here(self) -> _isoform.Fit:
        """What the compiled half holds."""
        assert self._native is not None, "what was sent has been asked before"
        return self._native

    @cached_property
    def deviation(self) -> npt.NDArray[np.float64]:
        """How far each point is from the model, (n,), positive outside."""
        return self._here.deviation()

    @cached_property
    def outliers(self) -> npt.NDArray[np.bool_]:
        """Which points were left out, (n,)."""
        return self._here.outliers()

    @cached_property
    def points(self) -> npt.NDArray[np.float64]:
        """The points that were fitted, (n, 3)."""
        return self._here.points()

    @cached_property
    def _program(self) -> str:
        """The fitted program."""
        return self._here.program()

    @property
    def model(self) -> Model:
        """The template with the values, where the points are."""
        return Model(self._program, name=self._name)

    def to_frame(self) -> Any:
        """Give the parameters as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each parameter, with its value, sd, bounds, status and unit.
        """
        from ._optional import need

        pandas = need("pandas")
        return pandas.DataFrame(self.to_dict()["parameters"]).set_index("name")

    def plot(self) -> Any:
        """Draw how the deviations are distributed, with matplotlib.

        Returns
        -------
        matplotlib.figure.Figure
            A histogram; lengths are in the unit of the points.
        """
        from ._optional import need

        figure = need("matplotlib.figure").Figure(figsize=(6, 3.5), layout="constrained")
        axes = figure.subplots()
        axes.hist(self.deviation[~self.outliers], bins=60)
        unit = self.to_dict()["units"]
        axes.set_xlabel("deviation, positive outside" + (f" ({unit})" if unit else ""))
        axes.set_ylabel("points")
        axes.set_title(f"{self.verdict}: rms {self.rms:.4g}")
        return figure

    def __getstate__(self) -> dict[str, Any]:
        # What the compiled half holds stays here; what it tells goes along.
        told = {k: getattr(self, k) for k in ("deviation", "outliers", "points", "_program")}
        return {**self.__dict__, **told, "_native": None}

    def __repr__(self) -> str:
        values = ", ".join(f"{k} {v:.6g}" for k, v in list(self.values.items())[:6])
        return f"<isoform.FitResult {self.verdict}, rms {self.rms:.4g}: {values}>"


def fit(
    points: Points,
    model: Model,
    start: Mapping[str, float] | Sequence[float] | npt.NDArray[Any] | None = None,
    bounds: Bounds = None,
    seed: int = 1,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
    *,
    fixed: Mapping[str, float] | None = None,
    pose: str | None = None,
    method: str = "default",
    loss: str = "auto",
    keep: Sequence[str] = (),
) -> FitResult:
    """Fit a template to points.

    Parameters
    ----------
    points : array_like or PointCloud
        (n, 3), in any pose, with noise and clutter.
    model : Model
        The template.
    start : dict or sequence of float, optional
        Where to start; by default the template's starts, else the points decide.
    bounds : dict, optional
        Lower and upper bound by name, in the unit of the points.
    seed : int
        Of everything random.
    threads : int, optional
        How many to use, by default all cores. The result does not depend on it.
    time_limit : float, optional
        Seconds after which the best so far is taken.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done, 0 to 1; False from it
        stops with the best so far. True shows a bar.
    fixed : dict, optional
        Parameters that are held, by name.
    pose : str, optional
        Motion of the template as further parameters: ``"none"``, ``"translate"``, ``"axis"``,
        ``"rigid"`` or ``"similarity"``; by default as the template says.
    method : str
        ``"default"``, ``"hybrid"``, ``"local"``, ``"bfgs"`` or ``"annealing"``.
    loss : str
        ``"auto"``, ``"squares"``, ``"cauchy"`` or ``"tukey"``.
    keep : sequence of str
        Clutter that is fitted like the rest: ``"planes"``, ``"apart"``, ``"outliers"``.

    Returns
    -------
    FitResult
        Values with deviations and a verdict; ``.deviation`` is (n,).

    Raises
    ------
    IsoformError
        If there is nothing to fit, or an argument does not suit the template.
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
    wanted = as_wanted(
        model,
        start=start,
        bounds=bounds,
        seed=seed,
        fixed=fixed,
        pose=pose,
        method=method,
        loss=loss,
        keep=keep,
    )
    cloud, name = as_cloud(points)
    with asked(threads, time_limit, progress) as limits:
        native = _isoform.fit(cloud, model._native, (name, model.name), wanted, limits)
    return FitResult(native, model.name)


def as_wanted(
    model: Model,
    *,
    start: Any = None,
    bounds: Bounds = None,
    seed: int = 1,
    fixed: Mapping[str, float] | None = None,
    pose: str | None = None,
    method: str = "default",
    loss: str = "auto",
    keep: Sequence[str] = (),
) -> dict[str, Any]:
    """What a fit of this model is asked for, as the compiled half takes it."""
    if not isinstance(model, Model):
        raise TypeError(f"model: a Model is expected, not {type(model).__name__}")
    return {
        "start": _start(start, model),
        "bounds": [(k, _interval(k, v)) for k, v in (bounds or {}).items()],
        "fixed": [(k, float(v)) for k, v in (fixed or {}).items()],
        "pose": pose,
        "method": method,
        "loss": loss,
        "keep": list(keep),
        "seed": whole("seed", seed),
    }


def _start(start: Any, model: Model) -> list[float] | None:
    """Start values in the order of the parameters."""
    if not isinstance(start, Mapping):
        return None if start is None else [float(v) for v in start]
    missing = [p.name for p in model.parameters if p.name not in start]
    if missing:
        raise IsoformError(f"start has no value of {', '.join(missing)}")
    own = [float(start[p.name]) for p in model.parameters]
    # Those of the pose come after them.
    names = {p.name for p in model.parameters}
    return own + [float(v) for k, v in start.items() if k not in names]


def _interval(name: str, interval: Any) -> tuple[float, float]:
    """Two numbers."""
    try:
        lower, upper = interval
        return float(lower), float(upper)
    except (TypeError, ValueError):
        raise IsoformError(f"bounds of {name}: two numbers are expected", "bounds") from None
