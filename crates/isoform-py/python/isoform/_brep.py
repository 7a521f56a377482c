"""Solids of exact faces for CAD."""

from __future__ import annotations

import json
import os
from typing import Any

from . import _isoform
from ._call import Progress, asked
from ._document import Documented, Shown
from ._model import Model, Values
from ._points import Path
from ._region import Box, corners


class Brep(Documented, Shown):
    """Solids of exact faces, with a certificate.

    Attributes
    ----------
    volume, area : float
        In cubic and square units of the model.
    faces : list of dict
        Each with ``part``, ``kind``, ``area`` and ``max_distance``.
    certificate : dict
        What is proved.
    """

    def __init__(self, native: _isoform.Solids) -> None:
        self._native = native
        self._document = native.document
        told = self.to_dict()
        self.volume: float = told["volume"]
        self.area: float = told["area"]
        self.faces: list[dict[str, Any]] = told["faces"]
        self.certificate: dict[str, Any] = told["certificate"]

    def save(self, path: Path, units: str | None = None, ap214: bool = False) -> None:
        """Write a STEP file, or our own form without loss where the name ends in .brep.json.

        Parameters
        ----------
        path : str or os.PathLike
            The file.
        units : str, optional
            Unit of length to state; by default as annotated, else mm.
        ap214 : bool
            The older AP214 instead of AP242.
        """
        self._native.save(os.fspath(path), units, ap214)

    def __repr__(self) -> str:
        return f"<isoform.Brep: {len(self.faces)} faces, volume {self.volume:.6g}>"


def brep(
    model: Model,
    size: float | None = None,
    tol: float | None = None,
    *,
    params: Values = None,
    box: Box = None,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Brep:
    """Make solids of exact faces of a model, for CAD.

    Parameters
    ----------
    model : Model
        The model.
    size : float, optional
        Length of the edges of the mesh that the topology comes from.
    tol : float, optional
        How far faces may be from the model, in its unit; 1e-6 of its largest side by default.
    params : dict or sequence of float, optional
        Values of the model's parameters.
    box : float or sequence, optional
        Cut off what does not lie in it.
    threads : int, optional
        How many to use, by default all cores.
    time_limit : float, optional
        Seconds after which the work ends.
    progress : callable or bool, optional
        Called with the name of a phase and the share of it that is done. True shows a bar.

    Returns
    -------
    Brep
        The solids, with ``.save("part.step")``.

    Raises
    ------
    IsoformError
        If there is no such solid.
    """
    if not isinstance(model, Model):
        raise TypeError(f"model: a Model is expected, not {type(model).__name__}")
    wanted = (size, tol, corners(box))
    with asked(threads, time_limit, progress) as limits:
        given = model._given(params)
        return Brep(_isoform.brep(model._native, given, model.name, wanted, limits))
