"""HyperFun programs: functions of space that are positive inside a solid."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._errors import IsoformError
from ._points import Path, Points, as_points

#: Values of parameters: by name, or in their order.
Values = Union[Mapping[str, float], Sequence[float], npt.NDArray[Any], None]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model.

    Attributes
    ----------
    name : str
        Name, as annotated, else ``a[1]``, ``a[2]``, ...
    kind : str
        ``x``, ``y``, ``z``, ``length``, ``angle``, ``ratio`` or ``number``.
    value : float or None
        Annotated default value.
    lower, upper : float or None
        Bounds; None if open, or dependent on the scan.
    unit : str or None
        Unit, as annotated.
    description : str
        Description, as annotated.
    """

    name: str
    kind: str
    lower: float | None
    upper: float | None
    value: float | None
    unit: str | None
    description: str


class Model:
    """A HyperFun program: a function of space, f >= 0 inside.

    Parameters
    ----------
    text : str
        The program. Lines ``-- @param a[1] radius length min=0`` name its parameters.
    object : str, optional
        The object to evaluate; by default ``my_model``, else the first one.
    name : str, optional
        Name in documents; `Model.load` uses the path. Names of files in the program start at its
        folder.

    Raises
    ------
    IsoformError
        If the text is not a program, with ``line:column`` and what was expected there.

    Examples
    --------
    >>> import isoform
    >>> ball = isoform.Model('''-- @param a[1] radius length min=0
    ... my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }''')
    >>> [p.name for p in ball.parameters]
    ['radius']
    >>> ball([[0, 0, 0], [0, 0, 2]], {"radius": 1.5})
    array([ 2.25, -1.75])
    """

    def __init__(self, text: str, object: str | None = None, name: str = "model") -> None:
        self._native = _isoform.Program(text, object, name)
        self._object = object
        self.text = text
        self.name = name
        self.title, self.unit = self._native.about
        self.parameters = tuple(Parameter(*told) for told in self._native.parameters)
        for line, column, message in self._native.warnings:
            warnings.warn(f"{name}:{line}:{column}: {message}", stacklevel=2)

    @classmethod
    def load(cls, path: Path, object: str | None = None) -> Model:
        """Read a program from a file.

        Parameters
        ----------
        path : str or os.PathLike
            A HyperFun file.
        object : str, optional
            The object to evaluate; by default ``my_model``, else the first one.

        Returns
        -------
        Model
            The program.

        Raises
        ------
        IsoformError
            If the file is missing or is not a program.
        """
        path = os.fspath(path)
        try:
            content = FilePath(path).read_bytes()
        except OSError as e:
            raise IsoformError(f"cannot read {path}: {e.strerror or e}", "file") from None
        try:
            text = content.decode()
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        try:
            return cls(text, object, path)
        except IsoformError as e:
            raise IsoformError(f"{path}:{e}", e.code, e.hint, e.line, e.column) from None

    def __call__(self, points: Points, params: Values = None) -> npt.NDArray[np.float64]:
        """Evaluate the function at points.

        Parameters
        ----------
        points : array_like or PointCloud
            (n, 3), in the model's unit, finite.
        params : dict or sequence of float, optional
            Values of the parameters by name, or in their order; missing ones take their annotated
            defaults.

        Returns
        -------
        numpy.ndarray
            (n,) float64: f at each point, positive inside. NaN, with a warning, if f has no value.
        """
        array, given = as_points(points), self._given(params)
        return self._checked(self._native.values(array, given), array, given)

    def gradient(self, points: Points, params: Values = None) -> npt.NDArray[np.float64]:
        """Evaluate the gradient of the function by x, y and z.

        Parameters
        ----------
        points : array_like or PointCloud
            (n, 3), in the model's unit, finite.
        params : dict or sequence of float, optional
            Values of the parameters by name, or in their order.

        Returns
        -------
        numpy.ndarray
            (n, 3) float64, pointing inside.
        """
        return self._native.gradients(as_points(points), self._given(params))

    def metric(self, points: Points, params: Values = None) -> npt.NDArray[np.float64]:
        """Compute signed distances from the surface, to first order.

        Parameters
        ----------
        points : array_like or PointCloud
            (n, 3), in the model's unit, finite.
        params : dict or sequence of float, optional
            Values of the parameters by name, or in their order.

        Returns
        -------
        numpy.ndarray
            (n,) float64: signed distances in the model's unit, positive inside. NaN, with a
            warning, if the function has no value.
        """
        array, given = as_points(points), self._given(params)
        return self._checked(self._native.metric(array, given), array, given)

    def part(self, points: Points, params: Values = None) -> npt.NDArray[np.str_]:
        """Name the part of the model whose surface is nearest to each point.

        Parameters
        ----------
        points : array_like or PointCloud
            (n, 3), in the model's unit, finite.
        params : dict or sequence of float, optional
            Values of the parameters by name, or in their order.

        Returns
        -------
        numpy.ndarray
            (n,) names.
        """
        numbers, names = self._native.parts(as_points(points), self._given(params))
        return np.array(names or [""])[numbers]

    def _handed(self) -> tuple[str, Any]:
        """Return the name of the file in memory, and the compiled object."""
        return self.name, self._native

    def _given(self, params: Values) -> list[float]:
        """Convert values for the compiled half."""
        if params is None:
            return []
        if not isinstance(params, Mapping):
            return [float(v) for v in params]
        given: list[float | None] = [None] * len(self.parameters)
        for name, value in params.items():
            given[self._index(name)] = float(value)
        return self._native.filled(given)

    def _index(self, name: str) -> int:
        """Return the index of a parameter."""
        names = [p.name for p in self.parameters]
        if name not in names:
            raise IsoformError(
                f"no parameter is called {name}", "usage", f"one of: {', '.join(names)}"
            )
        return names.index(name)

    def _checked(
        self,
        values: npt.NDArray[np.float64],
        points: npt.NDArray[np.float64],
        given: list[float],
    ) -> npt.NDArray[np.float64]:
        """Return the values; warn about NaN and explain the first."""
        # The sum is NaN if a value is; it takes one pass and no copy.
        if values.size and np.isnan(np.add.reduce(values)):
            missing = np.flatnonzero(np.isnan(values))
            if missing.size:
                why = self._native.trouble(points[missing[0]], given)
                place = f"{self.name}:{why[0]}:{why[1]}: {why[2]}" if why else "not a number"
                text = f"{missing.size} of {values.size} points have no value, the first: {place}"
                warnings.warn(text, RuntimeWarning, stacklevel=3)
        return values

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.text, self._object, self.name)

    def __repr__(self) -> str:
        names = ", ".join(p.name for p in self.parameters[:8])
        more = ", ..." if len(self.parameters) > 8 else ""
        return f"<isoform.Model {self.name[-80:]!r}: {self._native.name}({names}{more})>"[:300]


def template(name: str) -> Model:
    """Return a template of the gallery: a model whose parameters a fit determines.

    Parameters
    ----------
    name : str
        ``"cup"``, ``"bottle"``, ``"sphere"``, ...; ``isoform fit --list`` prints all.

    Returns
    -------
    Model
        The template.

    Raises
    ------
    IsoformError
        If no template has that name; the hint lists all.

    Examples
    --------
    >>> import isoform
    >>> [p.name for p in isoform.template("cup").parameters][:2]
    ['outer_radius', 'inner_radius']
    """
    name, text = _isoform.template(name)
    return Model(text, name=name)


def templates() -> list[str]:
    """List the names of the gallery's templates.

    Returns
    -------
    list of str
        Names accepted by `template`, `fit` and `recover`.
    """
    return list(_isoform.templates())
