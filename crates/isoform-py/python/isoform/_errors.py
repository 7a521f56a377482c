"""The one exception of the package."""

from __future__ import annotations

from typing import Any


class IsoformError(Exception):
    """What Isoform refuses, or has no result for.

    Parameters
    ----------
    message : str
        What is wrong, with its place.
    code : str
        A short word that stays the same, for programs: ``"syntax"``, ``"shape"``, ...
    hint : str, optional
        What to try.
    line, column : int, optional
        The place in a program or file, counted from 1.

    Attributes
    ----------
    code : str
        The short word.
    hint : str or None
        What to try.
    line, column : int or None
        The place in a program or file, counted from 1.
    """

    def __init__(
        self,
        message: str,
        code: str = "usage",
        hint: str | None = None,
        line: int | None = None,
        column: int | None = None,
    ) -> None:
        super().__init__(message)
        self.code = code
        self.hint = hint
        self.line = line
        self.column = column

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.args[0], self.code, self.hint, self.line, self.column)
