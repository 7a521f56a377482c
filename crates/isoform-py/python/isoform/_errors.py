"""The exceptions of the package."""

from __future__ import annotations

from typing import Any


class IsoformError(Exception):
    """Error of Isoform: invalid input, or a computation without a result.

    It is also an instance of the matching built-in exception: ``ValueError`` for arguments and
    input, ``FileNotFoundError`` and other ``OSError`` for files, ``TimeoutError`` for work that was
    stopped.

    Parameters
    ----------
    message : str
        Description of the problem, with its position.
    code : str
        Short stable identifier, for programs: ``"syntax"``, ``"shape"``, ...
    hint : str, optional
        Suggested remedy.
    line, column : int, optional
        Position in a program or file, counted from 1.

    Attributes
    ----------
    code : str
        Short stable identifier.
    hint : str or None
        Suggested remedy.
    line, column : int or None
        Position in a program or file, counted from 1.
    """

    def __new__(cls, message: str = "", code: str = "usage", *_: Any) -> IsoformError:
        kind = _kind(code, message) if cls is IsoformError else cls
        # Built-in exception classes create their own instances.
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


class UncertifiedWarning(UserWarning):
    """Result that is not certified, or a fit that is doubtful: the program's exit code 3."""


class InvalidInput(IsoformError, ValueError):
    """Invalid argument, text or points."""


class FileError(IsoformError, OSError):
    """File that cannot be read or written."""


class FileMissing(IsoformError, FileNotFoundError):
    """Missing file."""


class Stopped(IsoformError, TimeoutError):
    """Work stopped before it had a result."""


#: Codes of invalid arguments and input.
INVALID = frozenset(
    """bounds dimension few-points json model no-points not-finite not_patches other-kind points
    polynomial region request shape spline syntax template tie usage""".split()
)


def _kind(code: str, message: str) -> type[IsoformError]:
    """Select the class of an error by its code."""
    if code == "time-limit":
        return Stopped
    if code.startswith("file") or code == "not-writable":
        return FileMissing if "No such file" in message else FileError
    return InvalidInput if code in INVALID else IsoformError
