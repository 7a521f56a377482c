"""Fits of clouds in chunks. Each chunk is evaluated by the worker that holds it."""

from __future__ import annotations

import collections
import inspect
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Protocol, Union

import numpy as np
import numpy.typing as npt

from . import _isoform
from ._call import Answer, Progress, asked, bounds_file, given, in_order
from ._errors import IsoformError
from ._model import Model
from ._optional import need
from ._points import PointCloud, as_points, read_points
from ._results import FitResult
from ._verbs import fit

#: An array (n, 3), a path, or a function without arguments that returns an array.
Chunk = Union[npt.ArrayLike, str, "os.PathLike[str]", PointCloud, Callable[[], npt.ArrayLike]]
#: Chunks with their indices and the messages to them.
Asked = Iterator[tuple[int, Any, bytes]]



class Submits(Protocol):
    """Executor of `concurrent.futures`, or client of Dask."""

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Any:
        """Submit a task; returns a future with `done` and `result`."""


#: Execution engine: ``"ray"``, ``"dask"``, an executor, or this machine (None).
Engine = Union[str, Submits, None]

#: Maximum number of attempts for a chunk whose worker dies.
TRIES = 4
#: Number of chunks in flight per core.
AHEAD = 2


def points_of(chunk: Any, number: int) -> npt.NDArray[np.float64]:
    """Load the points of a chunk, (n, 3)."""
    try:
        if callable(chunk) and not isinstance(chunk, PointCloud):
            chunk = chunk()
        if isinstance(chunk, (str, os.PathLike)):
            return read_points(chunk).points
        if isinstance(chunk, np.ndarray) and chunk.size == 0:
            return np.empty((0, 3))
        return as_points(chunk)
    except IsoformError as e:
        raise at_chunk(e, number) from None


def at_chunk(error: IsoformError, number: int) -> IsoformError:
    """Add the index of the chunk to an error."""
    place = (error.line, error.column)
    return IsoformError(f"chunk {number}: {error}", error.code, error.hint, *place)


def answer(template: Model, chunk: Any, number: int, message: bytes) -> bytes:
    """Compute the answer of a chunk to a message of the compiled half."""
    points = points_of(chunk, number)
    try:
        return _isoform.answer(template._native, points, message)
    except IsoformError as e:
        raise at_chunk(e, number) from None


def _outcome(template: Model, chunk: Any, number: int, message: bytes) -> Any:
    """Run the task of a cluster: return the answer, or the exception."""
    try:
        return answer(template, chunk, number, message)
    except Exception as e:
        return e


def _checked(outcome: Any) -> bytes:
    """Return an answer; raise an exception."""
    if isinstance(outcome, BaseException):
        raise outcome
    told: bytes = outcome
    return told


# ---- engines -----------------------------------------------------------------------------------


class _Here:
    """Evaluates chunks in turn in this process, each by all threads of the fit."""

    def __init__(self, template: Model, chunks: Sequence[Any]) -> None:
        self._template = template

    def answers(self, asked: Asked) -> Iterator[bytes]:
        """Answers in the order of the chunks."""
        for number, chunk, message in asked:
            yield answer(self._template, chunk, number, message)


class _Ray:
    """Evaluates chunks by tasks of Ray."""

    def __init__(self, template: Model, chunks: Sequence[Any]) -> None:
        self._ray = ray = need("ray")
        if not ray.is_initialized():
            ray.init()
        self._template = ray.put(template)
        self._task = ray.remote(num_cpus=1, max_retries=TRIES)(_outcome)
        self._room = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
        # Arrays are sent once.
        self._sent: dict[int, Any] = {}

    def _place(self, number: int, chunk: Any) -> Any:
        if not isinstance(chunk, (np.ndarray, PointCloud)):
            return chunk
        if number not in self._sent:
            self._sent[number] = self._ray.put(as_points(chunk))
        return self._sent[number]

    def answers(self, asked: Asked) -> Iterator[bytes]:
        """Answers in the order of the chunks."""

        def hand_out(one: tuple[int, Any, bytes]) -> Any:
            number, chunk, message = one
            return self._task.remote(self._template, self._place(number, chunk), number, message)

        for pending in _window(asked, hand_out, self._room):
            try:
                outcome = self._ray.get(pending)
            except self._ray.exceptions.RayError as e:
                raise IsoformError(f"a worker died: {e}", "worker") from None
            yield _checked(outcome)


class _Dask:
    """Evaluates chunks by tasks of Dask."""

    def __init__(self, template: Model, chunks: Sequence[Any]) -> None:
        self._client = need("distributed").get_client()
        self._template = template
        self._room = AHEAD * max(1, sum(self._client.ncores().values()))

    def answers(self, asked: Asked) -> Iterator[bytes]:
        """Answers in the order of the chunks."""

        def hand_out(one: tuple[int, Any, bytes]) -> tuple[Any, Any]:
            # Arrays are sent each time: scattered data are lost with their worker.
            number, chunk, message = one
            task = (self._template, chunk, number, message)
            return self._client.submit(_outcome, *task, pure=False, retries=TRIES), one

        for future, one in _window(asked, hand_out, self._room):
            tries = 1
            while True:
                try:
                    outcome = future.result()
                    break
                except Exception as e:
                    if tries >= TRIES:
                        told = f"chunk {one[0]}: a worker died: {e}"
                        raise IsoformError(told, "worker") from None
                    tries += 1
                    future, one = hand_out(one)
            yield _checked(outcome)


class _Pool:
    """Evaluates chunks by tasks of an executor."""

    def __init__(self, executor: Any, template: Model) -> None:
        self._executor = executor
        self._template = template
        self._room = AHEAD * (os.cpu_count() or 1)

    def answers(self, asked: Asked) -> Iterator[bytes]:
        """Answers in the order of the chunks."""

        def hand_out(one: tuple[int, Any, bytes]) -> Any:
            number, chunk, message = one
            return self._executor.submit(_outcome, self._template, chunk, number, message)

        for future in _window(asked, hand_out, self._room):
            try:
                outcome = future.result()
            except Exception as e:
                raise IsoformError(f"a worker died: {e}", "worker") from None
            yield _checked(outcome)


def _window(asked: Asked, hand_out: Callable[[Any], Any], room: int) -> Iterator[Any]:
    """Yield submitted tasks in order, with at most `room` in flight."""
    pending: collections.deque[Any] = collections.deque()
    for one in asked:
        pending.append(hand_out(one))
        if len(pending) >= room:
            yield pending.popleft()
    yield from pending


#: Engines by name.
ENGINES: dict[Union[str, None], Callable[[Model, Sequence[Any]], Any]] = {
    None: _Here,
    "ray": _Ray,
    "dask": _Dask,
}


class _Questions:
    """Passes messages of the compiled half to the engine until the fit ends."""

    def __init__(self, engine: Any, chunks: Sequence[Any]) -> None:
        self._engine = engine
        self._chunks = chunks
        self.is_over = False

    def __call__(self, messages: list[bytes | None]) -> Iterator[bytes]:
        answers: Iterator[bytes] = self._engine.answers(self._to_ask(messages))
        return answers

    def _to_ask(self, messages: list[bytes | None]) -> Asked:
        for number, message in enumerate(messages):
            if self.is_over:
                # After Ctrl-C the fit has been abandoned.
                raise IsoformError("the fit is over", "stopped")
            if message is not None:
                yield number, self._chunks[number], message


#: Options of `isoform.fit` that fits of clouds in chunks and of fleets accept.
OPTIONS = frozenset(inspect.signature(fit).parameters) - {"points", "model", "threads", "progress"}


def known(options: dict[str, Any]) -> None:
    """Refuse options that `isoform.fit` lacks."""
    unknown = ", ".join(sorted(set(options) - OPTIONS))
    if unknown:
        raise IsoformError(f"fit has no option {unknown}", "usage", ", ".join(sorted(OPTIONS)))


def fit_large(
    chunks: Iterable[Chunk],
    template: Model,
    engine: Engine = None,
    *,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Progress = None,
    **options: Any,
) -> FitResult:
    """Fit a template to a cloud in chunks that exceeds the memory of a machine.

    Up to rounding, the result is that of `isoform.fit` of all points in the order of the chunks.

    Parameters
    ----------
    chunks : sequence of array_like, path or callable
        Each an array (n, 3), a file of points, or a function without arguments that returns an
        array; chunks may be empty. Each is evaluated, and loaded, 10 to 120 times: a function must
        return identical points each time. On a cluster, all workers must see files under equal
        names.
    template : Model
        The template.
    engine : str or executor, optional
        ``"ray"`` or ``"dask"``: the existing connection (``ray.init``, ``distributed.Client``); or
        an executor, such as a ``ProcessPoolExecutor``; by default this process evaluates the
        chunks in turn, each by all threads.
    threads : int, optional
        Number of threads of this process, by default all cores.
    time_limit : float, optional
        Seconds after which the search ends with the best result so far; the final statistics of
        all points take additional time.
    progress : callable or bool, optional
        As for `isoform.fit`.
    **options
        Options of `isoform.fit`: start, bounds, seed, fixed, pose, loss, ...

    Returns
    -------
    FitResult
        As by `isoform.fit`. For a cloud of more than 200,000 points ``.points``, (m, 3),
        ``.deviation`` and ``.outliers``, (m,), are those of a random sample of 200,000.

    Raises
    ------
    IsoformError
        If there are no points, an argument does not suit the template, or a chunk cannot be read:
        the message begins with its index, from 0.
    Exception
        Exceptions of functions that return chunks.
    KeyboardInterrupt
        After Ctrl-C, within two seconds.

    Notes
    -----
    Clouds of up to 200,000 points are gathered and fitted directly. From larger clouds a random
    sample of 200,000 is gathered for the search and for everything that needs neighbours, as in
    `isoform.fit`. All other figures are sums over chunks, added in the order of the chunks, so that
    the result does not depend on which is ready first. In addition to a chunk and the sample the
    process holds at most twelve bytes per point, half of the cloud, while it draws the sample.

    For meshes the vertices are used. Planes and objects around the part are reported, but only
    clouds of up to 200,000 points are fitted without them.

    Examples
    --------
    >>> import isoform, numpy as np
    >>> from isoform.distributed import fit_large
    >>> def on_ball(seed):
    ...     p = np.random.default_rng(seed).normal(size=(500, 3))
    ...     return 2 * p / np.linalg.norm(p, axis=1)[:, None]
    >>> chunks = [lambda k=k: on_ball(k) for k in range(4)]
    >>> result = fit_large(chunks, isoform.template("sphere"))
    >>> round(result.values["radius"], 6), result.acceptable
    (2.0, True)
    """
    wanted = fit_arguments(template, options)
    listed = _listed(chunks)
    ask = _Questions(_engine(engine, template, listed), listed)
    told = (f"{len(listed)} chunks", template.name)
    try:
        with asked(threads, time_limit, progress) as limits:
            document, native = _isoform.fit_large(
                ask, len(listed), template._native, told, wanted, limits
            )
    finally:
        ask.is_over = True
    return FitResult(Answer(document, [], native))


def _engine(engine: Engine, template: Model, chunks: Sequence[Any]) -> Any:
    """Return the engine for a name or an executor."""
    if not isinstance(engine, str) and engine is not None:
        return _Pool(engine, template)
    have = ENGINES.get(engine)
    if have is None:
        names = ", ".join(repr(name) for name in ENGINES)
        raise IsoformError(f"engine is {engine!r}", "usage", f"an executor, or one of: {names}")
    return have(template, chunks)


def fit_arguments(template: Model, options: dict[str, Any]) -> dict[str, Any]:
    """Convert the options of a fit for the compiled half."""
    known(options)
    if not isinstance(template, Model):
        raise TypeError(f"template: a Model is expected, not {type(template).__name__}")
    renamed = {"fix" if k == "fixed" else k: v for k, v in options.items()}
    start, bounds = in_order(options.get("start"), template), bounds_file(options.get("bounds"))
    return given({"scan": "-", **renamed, "start": start, "bounds": bounds})


def _listed(chunks: Any) -> list[Any]:
    """List the chunks; refuse a single cloud, which is a likely mistake."""
    if isinstance(chunks, (str, os.PathLike, PointCloud)) or callable(chunks):
        raise TypeError(f"chunks: a sequence is expected, not {type(chunks).__name__}")
    if isinstance(chunks, np.ndarray) and chunks.ndim < 3:
        raise TypeError(f"chunks: a sequence of arrays (n, 3) is expected, not {chunks.shape}")
    listed = list(chunks)
    if not listed:
        hint = "a sequence of arrays, paths or functions"
        raise IsoformError("there is no chunk", "no-points", hint)
    return listed
