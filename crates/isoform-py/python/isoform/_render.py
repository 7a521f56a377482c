"""Pictures of shapes, without a display."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

from . import _isoform
from ._call import Progress, asked, whole
from ._errors import IsoformError
from ._fit import FitResult
from ._model import Values
from ._points import Path
from ._region import Box, corners
from ._view import _layer


class Picture:
    """A picture as the bytes of a file; a notebook shows it as it is.

    Attributes
    ----------
    data : bytes
        The file: PNG, or SVG.
    """

    def __init__(self, data: bytes, svg: bool) -> None:
        self.data = data
        self._svg = svg

    def save(self, path: Path) -> None:
        """Write the file, whose name ends as its format does: .png, or .svg."""
        path = os.fspath(path)
        ending = ".svg" if self._svg else ".png"
        if not str(path).lower().endswith(ending):
            raise IsoformError(f"{path}: this picture is written as {ending}", "usage")
        try:
            FilePath(path).write_bytes(self.data)
        except OSError as e:
            raise IsoformError(f"cannot write {path}: {e.strerror or e}", "not-writable") from None

    def _repr_png_(self) -> bytes | None:
        return None if self._svg else self.data

    def _repr_svg_(self) -> str | None:
        return self.data.decode() if self._svg else None

    def __repr__(self) -> str:
        return f"<isoform.Picture: {'SVG' if self._svg else 'PNG'}, {len(self.data)} bytes>"


def render(
    obj: Any,
    *others: Any,
    size: tuple[int, int] = (800, 600),
    view: str | Sequence[str] = "iso",
    camera: Sequence[float] | None = None,
    section: Sequence[float] | None = None,
    color_by: str | None = None,
    background: Sequence[int] = (255, 255, 255),
    legend: bool = True,
    svg: bool = False,
    params: Values = None,
    box: Box = None,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Picture:
    """Draw shapes as a picture: models by their own functions, patches and maps themselves.

    Parameters
    ----------
    obj : object
        Points, a model, a fit, a mesh, patches, a triangulation, a solid, or the path of points
        or of a program. Points beside a model have the colours of their deviations.
    *others : object
        More of them, as further layers.
    size : (int, int)
        Width and height in pixels.
    view : str or sequence of str
        A standard view in which all is seen (iso, front, back, right, left, top, bottom), or
        several of them on one sheet.
    camera : sequence of 6 floats, optional
        x, y, z of the eye and of what it looks at, in model units, in the place of a view.
    section : sequence of 4 floats, optional
        nx, ny, nz, d: what has nx x + ny y + nz z > d is cut away.
    color_by : str, optional
        none, part, deviation, quality, u, v, bound or file, for the layers that have such colours.
    background : sequence of 3 ints
        Red, green and blue behind everything, 0 to 255.
    legend : bool
        Whether scales and lists of parts are written on it.
    svg : bool
        A drawing of lines and areas (SVG), not a picture of pixels (PNG).
    params : dict or sequence of float, optional
        Values of the parameters of models.
    box : float or sequence, optional
        What models without an end are looked at in.
    threads, time_limit, progress
        As of `fit`.

    Returns
    -------
    Picture
        A notebook shows it; ``.save("picture.png")`` writes it, ``.data`` are its bytes.

    Raises
    ------
    IsoformError
        If there is nothing to show.

    Examples
    --------
    >>> import isoform
    >>> ball = isoform.template("sphere")
    >>> picture = isoform.render(ball, params={"radius": 1}, size=(80, 60))
    >>> picture.data.startswith(b"\\x89PNG")
    True
    """
    layers: list[tuple[str, Any]] = []
    for shape in (obj, *others):
        layers.append(_layer(shape, params))
        if isinstance(shape, FitResult) and shape._native is not None:
            # The points are one layer, the model the next.
            layers.append((shape.model.name, (shape.model._native, [])))
    wanted: dict[str, Any] = {
        "size": _pixels(size),
        "views": [view] if isinstance(view, str) else list(view),
        "camera": _numbers("camera", camera, 6),
        "section": _numbers("section", section, 4),
        "color_by": color_by,
        "background": [whole("background", v) for v in background],
        "legend": bool(legend),
        "svg": bool(svg),
    }
    if len(wanted["background"]) != 3 or max(wanted["background"]) > 255:
        raise IsoformError(
            f"background is {background!r}", "usage", "red, green and blue, 0 to 255 each"
        )
    if not 1 <= len(wanted["views"]) <= 16:
        raise IsoformError(f"{len(wanted['views'])} views: a sheet has 1 to 16", "usage")
    with asked(threads, time_limit, progress) as limits:
        return Picture(_isoform.picture(layers, wanted, corners(box), limits), bool(svg))


def _pixels(size: Any) -> list[int]:
    """Width and height; what most viewers still open."""
    try:
        width, height = (whole("size", v, 1) for v in size)
    except (TypeError, ValueError):
        raise IsoformError(f"size is {size!r}", "usage", "(width, height) in pixels") from None
    if max(width, height) > 32_768 or width * height > 100_000_000:
        raise IsoformError(f"size is {size!r}", "usage", "at most 100 million pixels")
    return [width, height]


def _numbers(name: str, numbers: Any, count: int) -> list[float] | None:
    """As many numbers as there have to be."""
    if numbers is None:
        return None
    try:
        found = [float(v) for v in numbers]
    except (TypeError, ValueError):
        found = []
    if len(found) != count:
        raise IsoformError(f"{name} is {numbers!r}", "usage", f"{count} numbers are expected")
    return found
