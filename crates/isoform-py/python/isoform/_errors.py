"""The exceptions of the package."""

from __future__ import annotations

from typing import Any


class IsoformError(Exception):
    """What Isoform refuses, or has no result for.

    Where Python has an exception of its own for that, it is one, too: ``ValueError`` for arguments
    and input, ``FileNotFoundError`` and other ``OSError`` for files, ``TimeoutError`` for work that
    was stopped.

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

    def __new__(cls, message: str = "", code: str = "usage", *_: Any) -> IsoformError:
        kind = _kind(code, message) if cls is IsoformError else cls
        # Each class of Python's own makes its objects itself.
        return super().__new__(cls, message) if kind is cls else kind.__new__(kind, message, code)

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


class InvalidInput(IsoformError, ValueError):
    """An argument, a text or points that cannot be taken."""


class FileError(IsoformError, OSError):
    """A file that cannot be read or written."""


class FileMissing(IsoformError, FileNotFoundError):
    """A file that is not there."""


class Stopped(IsoformError, TimeoutError):
    """Work that was stopped before it had a result."""


#: Codes of arguments and input that cannot be taken.
INVALID = frozenset(
    """bounds dimension few-points json model no-points not-finite not_patches other-kind points
    polynomial region request shape spline syntax template tie usage""".split()
)


def _kind(code: str, message: str) -> type[IsoformError]:
    """The class of an error."""
    if code == "time-limit":
        return Stopped
    if code.startswith("file") or code == "not-writable":
        return FileMissing if "No such file" in message else FileError
    return InvalidInput if code in INVALID else IsoformError
