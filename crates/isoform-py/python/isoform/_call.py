"""What all calls that take time share: threads, a time limit, progress."""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Iterator
from typing import Any, Union

from ._errors import IsoformError

#: Called with the name of a phase and the share of it that is done; False stops.
Progress = Union[Callable[[str, float], Any], bool, None]
#: What the compiled half takes.
Asked = tuple[Union[int, None], Union[float, None], Union[Callable[[str, float], Any], None]]


def whole(name: str, number: Any, least: int = 0) -> int:
    """A whole number that the compiled half can take."""
    try:
        number = operator.index(number)
    except TypeError:
        raise TypeError(f"{name}: a whole number is expected, not {number!r}") from None
    if not least <= number < 1 << 63:
        raise IsoformError(f"{name} is {number}: at least {least} is expected")
    return int(number)


@contextlib.contextmanager
def asked(
    threads: int | None, time_limit: float | None, progress: Progress
) -> Iterator[Asked]:
    """The arguments as the compiled half takes them; a bar ends with the call."""
    if threads is not None:
        threads = whole("threads", threads, 1)
        if threads > 1024:
            raise IsoformError(f"threads is {threads}: from 1 to 1024 are possible")
    if time_limit is not None:
        time_limit = float(time_limit)
        if math.isnan(time_limit) or time_limit < 0:
            raise IsoformError(f"time_limit is {time_limit}: seconds are expected")
    if progress is True:
        with _bar() as show:
            yield threads, time_limit, show
        return
    if progress is not None and progress is not False and not callable(progress):
        raise TypeError("progress: a function, True or None is expected")
    yield threads, time_limit, progress or None


@contextlib.contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """A bar of tqdm where that is installed, else lines on stderr."""
    try:
        from tqdm.auto import tqdm  # type: ignore[import-untyped]
    except ImportError:
        yield _lines()
        return
    with tqdm(total=100, bar_format="{desc} {percentage:3.0f} %|{bar}| {elapsed}") as bar:

        def show(phase: str, done: float) -> None:
            bar.set_description_str(phase, refresh=False)
            bar.n = round(100 * done)
            bar.refresh()

        yield show


def _lines() -> Callable[[str, float], None]:
    """Says each phase once."""
    import sys

    said: list[str] = []

    def show(phase: str, done: float) -> None:
        if phase not in said[-1:]:
            said.append(phase)
            print(phase, "...", file=sys.stderr)

    return show
