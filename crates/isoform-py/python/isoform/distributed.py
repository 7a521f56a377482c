"""Fleets of scans, and clouds too large for one machine, on local processes, Ray or Dask.

Scans are fitted one by one, each by one thread of one process, so that a fleet takes as many of
them at once as there are cores; the numbers are those of `isoform.fit`. Rows are written as they
come. A cloud in chunks is fitted by sums over them (`fit_large`). Ray and Dask are taken where they
are asked for, with the connection that is there.
"""

from __future__ import annotations

import collections
import contextlib
import hashlib
import itertools
import json
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path as FilePath
from typing import Any, Union

from . import _isoform
from ._errors import IsoformError
from ._fit import fit
from ._large import fit_large
from ._model import Model
from ._optional import need
from ._points import Path, read_points

__all__ = ["fit_large", "fit_many"]

#: A row of the table.
Row = dict[str, Any]
#: Sources go in, and come out with their rows in the order in which they are done.
Engine = Callable[["Job", Iterable[str]], Iterator[tuple[str, Row]]]

#: How often a source is tried whose worker dies: the worker may have been killed for another's
#: sake, but a scan that kills each one must not go on for ever.
TRIES = 4
#: Tasks that are handed out for each core: enough that none waits, few enough to be kept in memory.
AHEAD = 3


class Job:
    """What is done with each source."""

    def __init__(self, template: Model, options: dict[str, Any]) -> None:
        self.template = template
        self.options = options

    def key(self) -> str:
        """Tells jobs apart that give other rows."""
        options = json.dumps(self.options, sort_keys=True, default=list)
        told = [_isoform.__version__, self.template.name, self.template.text, options]
        return _digest("\0".join(told))

    def row(self, source: str) -> Row:
        """The row of a source; what is wrong with it is an entry."""
        try:
            result = fit(read_points(source), self.template, threads=1, **self.options)
        except Exception as e:
            code = f"{e.code}: " if isinstance(e, IsoformError) else f"{type(e).__name__}: "
            return failed(source, code + str(e))
        return {
            "source": source,
            "ok": True,
            "error": None,
            "rms": result.rms,
            "acceptable": result.acceptable,
            "json": json.dumps(result.to_dict()),
            **result.values,
        }


def failed(source: str, error: str) -> Row:
    """The row of a source without a result."""
    return {"source": source, "ok": False, "error": error}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:24]


class _Table:
    """A folder of parquet files, one for each row: what is there is whole."""

    def __init__(self, folder: FilePath, job: Job) -> None:
        pyarrow = need("pyarrow")
        need("pyarrow.parquet")
        self._arrow = pyarrow
        self._folder = folder
        self._key = job.key()
        text, number, truth = pyarrow.string(), pyarrow.float64(), pyarrow.bool_()
        known = {"source": text, "ok": truth, "error": text, "rms": number}
        known |= {"acceptable": truth, "json": text}
        names = job.template._native.fitted_names(job.options.get("pose"))
        self._schema = pyarrow.schema({**known, **{n: number for n in names}})
        try:
            folder.mkdir(parents=True, exist_ok=True)
            files = [file.name for file in os.scandir(folder)]
        except OSError as e:
            raise IsoformError(f"cannot make the folder {folder}: {e}", "not-writable") from None
        rows = [name.removesuffix(".parquet") for name in files if name.endswith(".parquet")]
        # By source: the rows of this job, and those of others.
        self._there = {r.partition("-")[0] for r in rows if r.endswith(f"-{self._key}")}
        self._others = collections.defaultdict[str, list[str]](list)
        for row in rows:
            if not row.endswith(f"-{self._key}"):
                self._others[row.partition("-")[0]].append(f"{row}.parquet")

    def holds(self, source: str) -> bool:
        """Whether there is a row of the same source, template and options."""
        return _digest(source) in self._there

    def write(self, row: Row) -> None:
        """Writes a row, in the place of any other of its source."""
        source = _digest(row["source"])
        file = self._folder / f"{source}-{self._key}.parquet"
        table = self._arrow.Table.from_pylist([row], schema=self._schema)
        temporary = file.with_name(f".{file.name}.{os.getpid()}")
        self._arrow.parquet.write_table(
            table, temporary, compression="zstd", use_dictionary=False, write_statistics=False
        )
        os.replace(temporary, file)
        for other in self._others.pop(source, ()):
            (self._folder / other).unlink(missing_ok=True)


def fit_many(
    sources: Iterable[Path],
    template: Model,
    engine: str | None = None,
    out: Path = "results.parquet",
    resume: bool = True,
    processes: int | None = None,
    **options: Any,
) -> FilePath:
    """Fit a template to many scans, on this machine or a cluster.

    Parameters
    ----------
    sources : iterable of path
        Files of points (n, 3); workers must see them by the same names.
    template : Model
        The template.
    engine : str, optional
        ``"ray"`` or ``"dask"``: the connection that is there (``ray.init``,
        ``distributed.Client``); by default processes of this machine.
    out : path
        A folder of parquet files, one row for each source, written as they come: ``source``,
        ``ok``, ``error``, ``rms``, ``acceptable``, ``json`` (the document of the fit as text) and
        a column for each parameter. ``pandas.read_parquet`` reads it.
    resume : bool
        Rows that are there with the same template and options stay; rows of others are made anew.
    processes : int, optional
        How many of this machine, by default one for each core.
    **options
        Those of `isoform.fit`: start, bounds, seed, fixed, pose, method, loss, keep, time_limit.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    IsoformError
        If there is no such engine, or the folder cannot be written. What is wrong with a scan is
        in its row.

    Notes
    -----
    A worker that dies is replaced, and its scan tried again, four times at most.
    """
    run = ENGINES.get(engine)
    if run is None:
        names = ", ".join(repr(name) for name in ENGINES)
        raise IsoformError(f"engine is {engine!r}", "usage", f"one of: {names}")
    unknown = set(options) - OPTIONS
    if unknown:
        raise IsoformError(
            f"fit has no option {', '.join(sorted(unknown))}", "usage", ", ".join(sorted(OPTIONS))
        )
    job, folder = Job(template, options), FilePath(os.fspath(out))
    table = _Table(folder, job)
    every = dict.fromkeys(os.fspath(source) for source in sources)
    wanted = (name for name in every if not (resume and table.holds(name)))
    rows = run(job, wanted) if processes is None else _local(job, wanted, processes)
    for _, row in rows:
        table.write(row)
    return folder


#: Options of `fit` that a fleet may have.
OPTIONS = frozenset(
    ["start", "bounds", "seed", "fixed", "pose", "method", "loss", "keep", "time_limit"]
)


# ---- processes of this machine -------------------------------------------------------------------


def _local(job: Job, sources: Iterable[str], processes: int | None = None) -> Iterator[Any]:
    """Rows by processes of this machine, each fed by a thread."""
    count = processes or os.cpu_count() or 1
    waiting: queue.Queue[str | None] = queue.Queue(count * AHEAD)
    done: queue.Queue[tuple[str, Row]] = queue.Queue()
    feeders = [_Feeder(job, waiting, done) for _ in range(count)]
    left = 0
    try:
        for source in sources:
            waiting.put(source)
            left += 1
            while not done.empty():
                yield _taken(done)
                left -= 1
        for _ in range(left):
            yield _taken(done)
    finally:
        # What nobody has begun is dropped, where an exception ends this.
        with contextlib.suppress(queue.Empty):
            while True:
                waiting.get_nowait()
        for feeder in feeders:
            waiting.put(None)
        for feeder in feeders:
            feeder.end()


def _taken(done: queue.Queue[Any]) -> Any:
    """The next row; looks up now and then, so that Ctrl-C is heard."""
    while True:
        try:
            return done.get(timeout=0.2)
        except queue.Empty:
            continue


class _Feeder:
    """A thread that gives sources to a process, and a new process where that dies."""

    def __init__(self, job: Job, waiting: queue.Queue[Any], done: queue.Queue[Any]) -> None:
        self._job = job
        self._worker: _Worker | None = None
        self._is_over = False
        self._thread = threading.Thread(target=self._run, args=(waiting, done), daemon=True)
        self._thread.start()

    def _run(self, waiting: queue.Queue[Any], done: queue.Queue[Any]) -> None:
        while (source := waiting.get()) is not None:
            done.put((source, self._row(source)))

    def _row(self, source: str) -> Row:
        for _ in range(TRIES):
            if self._is_over:
                break
            try:
                self._worker = self._worker or _Worker()
                return self._worker.row(self._job, source)
            except (OSError, EOFError, pickle.UnpicklingError):
                self._close()
        return failed(source, "worker: its process died each time")

    def _close(self) -> None:
        worker, self._worker = self._worker, None
        if worker:
            worker.close()

    def end(self) -> None:
        """Ends the process, whatever it does, and the thread."""
        self._is_over = True
        if self._worker:
            self._worker.kill()
        self._thread.join()
        self._close()


class _Worker:
    """A process that makes rows."""

    def __init__(self) -> None:
        command = [sys.executable, "-m", "isoform._worker"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._job: Job | None = None

    def row(self, job: Job, source: str) -> Row:
        """The row of a source."""
        assert self._process.stdin is not None and self._process.stdout is not None
        if self._job is not job:
            pickle.dump(job, self._process.stdin)
            self._job = job
        pickle.dump(source, self._process.stdin)
        self._process.stdin.flush()
        row: Row = pickle.load(self._process.stdout)
        return row

    def kill(self) -> None:
        """Lets the process die; who waits for it hears of that."""
        self._process.kill()

    def close(self) -> None:
        """Ends the process."""
        self._process.kill()
        with contextlib.suppress(OSError):
            self._process.__exit__(None, None, None)


# ---- clusters ------------------------------------------------------------------------------------


def _ray(job: Job, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
    """Rows by tasks of Ray."""
    ray = need("ray")
    if not ray.is_initialized():
        ray.init()
    shared = ray.put(job)
    task = ray.remote(num_cpus=1, max_retries=TRIES)(_row)
    room = AHEAD * max(1, int(ray.cluster_resources().get("CPU", 1)))
    pending: dict[Any, str] = {}
    waiting = iter(sources)
    while True:
        for source in itertools.islice(waiting, room - len(pending)):
            pending[task.remote(shared, source)] = source
        if not pending:
            return
        for ready in ray.wait(list(pending))[0]:
            source = pending.pop(ready)
            try:
                yield source, ray.get(ready)
            except ray.exceptions.RayError as e:
                yield source, failed(source, f"worker: {str(e).strip().splitlines()[0]}")


def _dask(job: Job, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
    """Rows by tasks of Dask."""
    cluster = need("distributed")
    client = cluster.get_client()
    room = AHEAD * max(1, sum(client.ncores().values()))
    waiting, names = iter(sources), dict[Any, str]()
    done, lost = cluster.as_completed(), collections.Counter[str]()

    def hand_out(source: str) -> None:
        # The job goes along: what is scattered dies with the worker that has it.
        future = client.submit(_row, job, source, pure=False)
        names[future] = source
        done.add(future)

    while True:
        for source in itertools.islice(waiting, room - len(names)):
            hand_out(source)
        if not names:
            return
        future = next(done)
        source = names.pop(future)
        try:
            yield source, future.result()
        except Exception as e:
            lost[source] += 1
            if future.cancelled() and lost[source] < TRIES:
                hand_out(source)
            else:
                yield source, failed(source, f"worker: {type(e).__name__}: {e}")


def _row(job: Job, source: str) -> Row:
    """What a task of a cluster does."""
    return job.row(source)


#: By name, who does the work.
ENGINES: dict[Union[str, None], Engine] = {None: _local, "ray": _ray, "dask": _dask}
