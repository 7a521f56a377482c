"""Boxes as users write them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Union

from ._errors import IsoformError

#: Half the width of a box around the origin, its two corners, or their six numbers.
Box = Union[float, Sequence[float], Sequence[Sequence[float]], None]
#: What the compiled half takes.
Corners = Union[tuple[list[float], list[float]], None]


def corners(box: Any) -> Corners:
    """The lower and the upper corner of a box."""
    if box is None:
        return None
    try:
        if hasattr(box, "__len__"):
            numbers = [float(v) for part in box for v in (part if _is_row(part) else [part])]
        else:
            numbers = [-float(box)] * 3 + [float(box)] * 3
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 6:
        raise IsoformError(
            f"box is {box!r}", "usage", "half its width, or ((x, y, z), (x, y, z))"
        )
    return numbers[:3], numbers[3:]


def _is_row(part: Any) -> bool:
    return hasattr(part, "__len__")
