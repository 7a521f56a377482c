"""Calls of verbs: conversion of arguments, threads, time limit, progress."""

from __future__ import annotations

import contextlib
import json
import math
import operator
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np

from . import _isoform
from ._errors import IsoformError, UncertifiedWarning
from ._points import PointCloud, as_points, read_points

#: Callback with the name of a phase and its completed share; a result of False stops the work.
Progress = Union[Callable[[str, float], Any], bool, None]
#: Messages about results that are not all that was asked for, by verb.
_UNCERTIFIED = {
    "fit": "the fit is not accepted, see .reasons",
    "recover": "the fit is not accepted, or its shape not certified, see .to_dict()",
    "mesh": "the mesh is not certified, see .certificate",
    "brep": "the solid is not certified, see .certificate",
}
#: Limits as the compiled half takes them: threads, seconds, callback.
Asked = tuple[Union[int, None], Union[float, None], Union[Callable[[str, float], Any], None]]


@dataclass
class Answer:
    """Outcome of a verb: its document, warnings, and the result in memory."""

    document: str
    warnings: list[str]
    native: Any


def run(
    verb: str,
    arguments: dict[str, Any],
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Answer:
    """Run a verb; arguments that are None are omitted."""
    with asked(threads, time_limit, progress) as limits:
        *answer, is_as_asked = _isoform.run_verb(verb, given(arguments), limits)
    # Values that are undefined have a warning of their own; distances are compared by the caller.
    if not is_as_asked and verb not in ("eval", "compare"):
        text = _UNCERTIFIED.get(verb, "the result is not certified, see .to_dict()")
        warnings.warn(f"isoform.{verb}: {text}", UncertifiedWarning, stacklevel=_depth())
    return Answer(*answer)


def _depth() -> int:
    """Return the stack level of the caller of a verb."""
    frame, depth = sys._getframe(1), 1
    while frame.f_back and frame.f_globals.get("__name__", "").startswith("isoform._"):
        frame, depth = frame.f_back, depth + 1
    return depth


def given(arguments: dict[str, Any]) -> dict[str, Any]:
    """Select the arguments that are neither None nor False."""
    return {k: v for k, v in arguments.items() if v is not None and v is not False}


def open_ended(bound: float) -> float | None:
    """Convert a bound; None if it is infinite."""
    return bound if math.isfinite(bound) else None


def written(
    kind: Callable[..., Any],
    ending: str,
    verb: str,
    arguments: dict[str, Any],
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
) -> Any:
    """Run a verb that writes a file, and wrap its content with the warnings."""
    file = _isoform.Output(ending)
    answer = run(verb, {**arguments, "output": file}, threads, time_limit, progress)
    made = kind(file.content())
    made.warnings = answer.warnings
    return made


def handed(shape: Any) -> Any:
    """Convert a shape to a file in memory; paths are kept."""
    if shape is None:
        return None
    if isinstance(shape, (str, os.PathLike)):
        return os.fspath(shape)
    if hasattr(shape, "_handed"):
        name, native = shape._handed()
        return _isoform.Input(name, native)
    if isinstance(shape, PointCloud):
        return _isoform.Input(shape.name, shape._native)
    if isinstance(shape, Mapping):
        return _isoform.Input("polynomial" if "F" in shape else "map", _json(shape))
    if callable(shape):
        hint = 'isoform.sample(function, box), or a formula in quotes, as "x^2 + y^2 + z^2 = 1"'
        raise IsoformError("functions of Python are not shapes", "usage", hint)
    return _isoform.Input("array", _isoform.Cloud(as_points(shape)))


def _json(shape: Mapping[Any, Any]) -> str:
    """Convert a document, with arrays and expressions of other packages, to JSON."""

    def plain(value: Any) -> Any:
        if isinstance(value, (np.ndarray, np.generic)):
            return value.tolist()
        return str(value).replace("**", "^")

    try:
        return json.dumps(dict(shape), default=plain, allow_nan=False)
    except ValueError:
        hint = "numbers that are neither NaN nor infinite"
        raise IsoformError("a number is not finite", "shape", hint) from None


def label_file(labels: Any, points: Any) -> Any:
    """Convert the labels of points to a file in memory; files of them are kept."""
    if labels is None or isinstance(labels, (str, os.PathLike, PointCloud)):
        return handed(labels)
    if points is None:
        raise IsoformError("labels of no points", "usage", "points, (n, 3), with labels, (n,)")
    if isinstance(points, (str, os.PathLike)):
        points = read_points(points)
    native = points._native if isinstance(points, PointCloud) else _isoform.Cloud(as_points(points))
    values = np.asarray(labels)
    if values.ndim != 1 or values.dtype.kind not in "iu":
        hint = "one whole number for each point, -1 for none"
        raise IsoformError(f"labels are whole numbers (n,), not {values.dtype} {values.shape}", "shape", hint)
    return _isoform.Input("labels", native.with_column("entity", values.astype(float).tolist()))


def layer_files(shapes: Sequence[Any]) -> list[Any]:
    """Convert shapes to layers; a fit becomes its points and its model."""
    found: list[Any] = []
    for shape in shapes:
        found += shape._layers() if hasattr(shape, "_layers") else [shape]
    return [_shown(shape) for shape in found]


def _shown(shape: Any) -> Any:
    """Convert a layer to a file in memory; a triangulation is represented by its map."""
    if hasattr(shape, "_map"):
        return _isoform.Input("surface", shape._map)
    return handed(shape)


def bounds_file(bounds: Any) -> Any:
    """Convert bounds to a file in memory."""
    if not isinstance(bounds, Mapping):
        return bounds
    ends = {str(k): [open_ended(end) for end in _interval(k, v)] for k, v in bounds.items()}
    return _isoform.Input("bounds", json.dumps(ends))


def region_files(regions: Any) -> Any:
    """Convert regions to files in memory; names of objects are kept."""
    if not isinstance(regions, Mapping):
        return regions
    return [_region(name, region) for name, region in regions.items()]


def _region(name: str, region: Any) -> Any:
    """Convert a region: a model, or a model with values of its parameters."""
    pair = region if isinstance(region, tuple) else (region, None)
    if len(pair) != 2 or not name or "," in name or "/" in name:
        hint = "a name without commas and slashes, and a Model, or a Model with its values"
        raise IsoformError(f"region {name!r} cannot be", "usage", hint)
    model, params = pair
    if not hasattr(model, "_given"):
        raise IsoformError(f"region {name} is no Model", "usage")
    return _isoform.Input(name, (model._native, model._given(params)))


def _interval(name: str, interval: Any) -> tuple[float, float]:
    """Convert an interval to two numbers."""
    try:
        lower, upper = interval
        return float(lower), float(upper)
    except (TypeError, ValueError):
        raise IsoformError(f"bounds of {name}: two numbers are expected", "bounds") from None


def corners(box: Any) -> list[float] | None:
    """Convert a box, given by two corners or by half its width, to six numbers."""
    if box is None:
        return None
    try:
        if hasattr(box, "__len__"):
            numbers = [
                float(v) for part in box for v in (part if hasattr(part, "__len__") else [part])
            ]
        else:
            numbers = [-float(box)] * 3 + [float(box)] * 3
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 6:
        hint = "half its width, or ((x, y, z), (x, y, z))"
        raise IsoformError(f"box is {box!r}", "usage", hint)
    return numbers


def in_order(start: Any, model: Any) -> Any:
    """Order start values like the parameters of a model."""
    if not isinstance(start, Mapping):
        return start
    if not hasattr(model, "parameters"):
        raise IsoformError("start by name needs a Model", "usage", "Model.load(path)")
    missing = [p.name for p in model.parameters if p.name not in start]
    if missing:
        raise IsoformError(f"start has no value of {', '.join(missing)}")
    names = model._native.fitted_names(None)
    others = [name for name in start if name not in names]
    # Parameters of a requested pose follow those of the template.
    try:
        return [float(start[name]) for name in [*(n for n in names if n in start), *others]]
    except (TypeError, ValueError) as e:
        raise IsoformError(f"start: {e}", "usage") from None


def whole(name: str, number: Any, least: int = 0) -> int:
    """Convert to an integer in the range of the compiled half."""
    try:
        number = operator.index(number)
    except TypeError:
        raise TypeError(f"{name}: a whole number is expected, not {number!r}") from None
    if not least <= number < 1 << 63:
        raise IsoformError(f"{name} is {number}: at least {least} is expected")
    return int(number)


def some_whole(name: str, number: Any) -> int | None:
    """Convert an optional integer."""
    return None if number is None else whole(name, number)


def there(asked: float | None) -> float | None:
    """Check that the machine has this memory, in GiB; exceeding it would end the interpreter."""
    if asked is not None and hasattr(os, "sysconf"):
        there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / (1 << 30)
        if asked > there:
            raise IsoformError(f"memory is {asked} GiB: this machine has {there:.1f}", "memory")
    return asked


@contextlib.contextmanager
def asked(
    threads: int | None, time_limit: float | None, progress: Progress
) -> Iterator[Asked]:
    """Convert limits for the compiled half; a progress bar is closed after the call."""
    if threads is not None:
        threads = whole("threads", threads, 1)
        if threads > 1024:
            raise IsoformError(f"threads is {threads}: from 1 to 1024 are possible")
    if time_limit is not None:
        time_limit = float(time_limit)
        if math.isnan(time_limit) or time_limit < 0:
            raise IsoformError(f"time_limit is {time_limit}: seconds are expected")
        if time_limit > 1e9:
            time_limit = None
    if progress is True:
        with _bar() as show:
            yield threads, time_limit, show
        return
    if progress is not None and progress is not False and not callable(progress):
        raise TypeError("progress: a function, True or None is expected")
    yield threads, time_limit, progress or None


@contextlib.contextmanager
def _bar() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar by tqdm if it is installed, else lines on stderr."""
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
    """Create a callback that prints each phase once."""
    said: list[str] = []

    def show(phase: str, done: float) -> None:
        if phase not in said[-1:]:
            said.append(phase)
            print(phase, "...", file=sys.stderr)

    return show
