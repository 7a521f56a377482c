"""Fleets of scans, huge clouds, and meshes in blocks, on local processes, Ray or Dask.

Each scan of a fleet is fitted by one thread of one process, as many at once as there are cores; the
results are those of `isoform.fit`. Rows are written as they are completed. A cloud in chunks is
fitted by sums over them (`fit_large`). Ray and Dask are used on request, with the existing
connection.

A huge model is meshed in blocks. The steps of its blocks are tasks as well, which read and write
files in a folder next to the output; this process plans them and compares their reports.
"""

from __future__ import annotations

import collections
import contextlib
import hashlib
import itertools
import json
import math
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Protocol, Union

import numpy as np

from . import _isoform
from ._call import Asked, Progress, asked, corners, given, there, whole
from ._document import Documented
from ._errors import IsoformError, UncertifiedWarning
from ._large import Engine as Where
from ._large import Submits, fit_large, known
from ._model import Model, Values
from ._optional import need
from ._points import Path, read_points
from ._results import FitResult
from ._verbs import Box, fit

__all__ = ["BlockedMesh", "fit_large", "fit_many", "mesh_blocks"]

# The rows of a fleet say which fits are accepted.
warnings.filterwarnings("ignore", category=UncertifiedWarning, module=r"isoform\.distributed$")

#: Row of the table of results.
Row = dict[str, Any]
#: Function from sources to pairs of source and row, in the order of completion.
Engine = Callable[["Work", Iterable[str]], Iterator[tuple[str, Row]]]

#: Maximum number of attempts for a source whose worker dies: another source may have caused it, but
#: a scan that kills every worker must not repeat forever.
TRIES = 4
#: Number of tasks in flight per core: enough to keep it busy, few enough for memory.
AHEAD = 3


class Work(Protocol):
    """Work that can be sent to workers."""

    def row(self, source: str) -> Row:
        """Compute the row of a source; a problem of the source is an entry of the row."""


class Job:
    """Fits of one or several templates to a source."""

    def __init__(self, templates: Sequence[Model], options: dict[str, Any]) -> None:
        self.templates = list(templates)
        self.options = options

    def key(self) -> str:
        """Compute a key that differs between jobs with different rows."""
        options = json.dumps(self.options, sort_keys=True, default=list)
        texts = [text for t in self.templates for text in (t.name, t.text)]
        return _digest("\0".join([_isoform.__version__, *texts, options]))

    def names(self) -> list[str]:
        """List the distinct parameters of all templates."""
        pose = self.options.get("pose")
        names = [n for t in self.templates for n in t._native.fitted_names(pose)]
        return list(dict.fromkeys(names))

    def row(self, source: str) -> Row:
        """Compute the row of a source; a problem of the source is an entry of the row."""
        try:
            points = read_points(source)
        except Exception as e:
            return failed(source, _told(e))
        results, errors = [], []
        for template in self.templates:
            try:
                results.append(fit(points, template, threads=1, **self._options_of(template)))
            except Exception as e:
                errors.append(_told(e))
        if not results:
            return failed(source, errors[0])
        best = min(results, key=_rank)
        return {
            "source": source,
            "ok": True,
            "error": None,
            "template": best._name,
            "rms": best.rms,
            "acceptable": best.acceptable,
            "json": json.dumps(best.to_dict()),
            **best.values,
        }

    def _options_of(self, template: Model) -> dict[str, Any]:
        """Select the options of one of several templates: those of its own parameters."""
        if len(self.templates) == 1:
            return self.options
        names = template._native.fitted_names(self.options.get("pose"))
        options = dict(self.options)
        for key in ("start", "bounds", "fixed"):
            if isinstance(options.get(key), Mapping):
                options[key] = {k: v for k, v in options[key].items() if k in names} or None
        return options


def _rank(result: FitResult) -> tuple[int, float]:
    """Rank the fits of one scan: by the verdict, then by the Bayesian information criterion."""
    n = int(np.count_nonzero(~result.outliers))
    told = sum(status == "determined" for status in result.status.values())
    cost = 2 * n * math.log(max(result.rms, 1e-300)) + told * math.log(max(n, 1))
    return ["accepted", "doubtful", "refused"].index(result.verdict), cost


def _told(error: Exception) -> str:
    code = error.code if isinstance(error, IsoformError) else type(error).__name__
    return f"{code}: {error}"


def failed(source: str, error: str) -> Row:
    """Create the row of a source without a result."""
    return {"source": source, "ok": False, "error": error}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:24]


class _Table:
    """Folder of parquet files, one per row; each file is complete."""

    def __init__(self, folder: FilePath, job: Job) -> None:
        pyarrow = need("pyarrow")
        need("pyarrow.parquet")
        self._arrow = pyarrow
        self._folder = folder
        self._key = job.key()
        text, number, truth = pyarrow.string(), pyarrow.float64(), pyarrow.bool_()
        known = {"source": text, "ok": truth, "error": text, "template": text, "rms": number}
        known |= {"acceptable": truth, "json": text}
        self._schema = pyarrow.schema({**known, **{n: number for n in job.names()}})
        try:
            folder.mkdir(parents=True, exist_ok=True)
            files = [file.name for file in os.scandir(folder)]
        except OSError as e:
            raise IsoformError(f"cannot make the folder {folder}: {e}", "not-writable") from None
        rows = [name.removesuffix(".parquet") for name in files if name.endswith(".parquet")]
        # Rows of this job, and of others, by source.
        self._there = {r.partition("-")[0] for r in rows if r.endswith(f"-{self._key}")}
        self._others = collections.defaultdict[str, list[str]](list)
        for row in rows:
            if not row.endswith(f"-{self._key}"):
                self._others[row.partition("-")[0]].append(f"{row}.parquet")

    def holds(self, source: str) -> bool:
        """Return True if a row of this source, template and options exists."""
        return _digest(source) in self._there

    def write(self, row: Row) -> None:
        """Write a row, which replaces other rows of its source."""
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
    template: Model | Sequence[Model],
    engine: Where = None,
    out: Path = "results.parquet",
    resume: bool = True,
    processes: int | None = None,
    **options: Any,
) -> FilePath:
    """Fit a template, or the best of several, to many scans, on this machine or a cluster.

    Parameters
    ----------
    sources : iterable of path
        Files of points (n, 3); all workers must see them under equal names.
    template : Model or sequence of Model
        The template; of several, the one with the best verdict is selected, then the one with the
        smallest value of the Bayesian information criterion (2 n ln rms + parameters ln n).
    engine : str or executor, optional
        ``"ray"`` or ``"dask"``: the existing connection (``ray.init``, ``distributed.Client``); or
        an executor, such as a ``ProcessPoolExecutor`` or a client of Dask; by default processes of
        this machine.
    out : path
        Folder of parquet files, one row per source, written when completed: ``source``, ``ok``,
        ``error``, ``template``, ``rms``, ``acceptable``, ``json`` (the document of the fit as text)
        and a column for each parameter of any template. ``pandas.read_parquet`` reads it.
    resume : bool
        Keep existing rows with equal template and options; other rows are computed again.
    processes : int, optional
        Number of processes of this machine, by default one per core.
    **options
        Options of `isoform.fit`: start, bounds, seed, fixed, pose, method, loss, keep, time_limit.
        With several templates, start, bounds and fixed apply to those with such a parameter.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    IsoformError
        If the engine is unknown, or the folder cannot be written. Problems of a scan are reported
        in its row.

    Notes
    -----
    A worker that dies is replaced; its scan is tried four times at most.
    """
    run = _engine(engine)
    known(options)
    templates = [template] if isinstance(template, Model) else list(template)
    if not templates or not all(isinstance(t, Model) for t in templates):
        raise TypeError(f"template: a Model, or several, are expected, not {template!r}")
    names = [t.name for t in templates]
    if len(set(names)) < len(names):
        raise IsoformError(f"templates share a name: {', '.join(names)}", "usage")
    job, folder = Job(templates, options), FilePath(os.fspath(out))
    table = _Table(folder, job)
    every = dict.fromkeys(os.fspath(source) for source in sources)
    wanted = (name for name in every if not (resume and table.holds(name)))
    rows = run(job, wanted) if processes is None else _local(job, wanted, processes)
    for _, row in rows:
        table.write(row)
    return folder


def _engine(name: Where) -> Engine:
    """Return the engine for a name or an executor."""
    if not isinstance(name, str) and name is not None:
        return _pool(name)
    run = ENGINES.get(name)
    if run is None:
        names = ", ".join(repr(name) for name in ENGINES)
        raise IsoformError(f"engine is {name!r}", "usage", f"one of: {names}")
    return run


# ---- meshes in blocks ----------------------------------------------------------------------------


class BlockedMesh(Documented):
    """Mesh of a huge model: files and their properties.

    Attributes
    ----------
    path : pathlib.Path
        The .pvtu file, which refers to the .vtu file of each block.
    certificate : dict
        Verified properties of the entire mesh: ``ok``, ``tets``, ``volume``, ``shared_faces`` ...
    blocks : list of dict
        Properties of each block, x fastest: its ``warnings``, and its ``figures`` with ``file``,
        ``tets``, ``dihedral_angles``, ``failures`` ...
    """

    def __init__(self, path: FilePath, document: str) -> None:
        self.path = path
        self._document = document
        told = self.to_dict()
        self.certificate: dict[str, Any] = told["certificate"]
        self.blocks: list[dict[str, Any]] = told["blocks"]

    def __repr__(self) -> str:
        tets = self.certificate["tets"]
        return f"<isoform.BlockedMesh: {tets} tetrahedra in {len(self.blocks)} blocks>"


class Blocks:
    """Steps of blocks, each executed by one thread of a worker."""

    def __init__(self, model: Model, params: Values, wanted: dict[str, Any]) -> None:
        self.model = model
        self.params = params
        self.wanted = wanted

    def row(self, source: str) -> Row:
        """Execute a task and return its report; a problem is an entry."""
        try:
            return {"ok": True, "report": self.report(source, (1, None, None))}
        except IsoformError as e:
            return {"ok": False, "error": str(e), "code": e.code, "hint": e.hint}

    def report(self, task: str, limits: tuple[int | None, float | None, Any]) -> str:
        """Execute a task and return its report."""
        shape = self.model._native, self.model._given(self.params)
        return _isoform.block_task(shape, self.wanted, task, limits)


def mesh_blocks(
    model: Model,
    blocks: tuple[int, int, int],
    out: Path,
    engine: Where = None,
    size: float | None = None,
    *,
    params: Values = None,
    box: Box = None,
    grade: float | None = None,
    angles: tuple[float, float] | None = None,
    memory: float | None = None,
    processes: int | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> BlockedMesh:
    """Mesh a huge model in blocks with matching nodes.

    Parameters
    ----------
    model : Model
        Model to be meshed.
    blocks : tuple of int
        Numbers of blocks along x, y and z.
    out : path
        A .pvtu file; each block is a .vtu file next to it. Intermediate files lie in a hidden
        folder there, which all workers must see under an equal name.
    engine : str or executor, optional
        ``"ray"`` or ``"dask"``: the existing connection (``ray.init``, ``distributed.Client``); by
        default this process meshes the blocks in turn, with memory for one of them.
    size : float, optional
        Length of edges in the model's unit, the maximum if sizes vary; by default a fortieth of the
        diagonal.
    params : dict or sequence of float, optional
        Values of the model's parameters by name, or in their order.
    box : float or sequence, optional
        Region to be meshed: half the width of a box around the origin, or its two corners.
    grade : float, optional
        Maximum distance of faces from the surface; edges are shortened to respect it.
    angles : tuple of float, optional
        Bounds of dihedral angles in degrees: targets of the optimisation, and requirements of the
        certificates.
    memory : float, optional
        Maximum estimated memory per block, in GiB; 16 by default. Larger blocks are refused.
    processes : int, optional
        Number of processes of this machine that work on blocks, if no engine is given.
    threads : int, optional
        Number of threads if blocks are meshed in turn; by default all cores.
    progress : callable or bool, optional
        Called with the name of a step and its completed share. True shows a bar.

    Returns
    -------
    BlockedMesh
        With ``.path`` and ``.certificate``. The files are identical, byte for byte, for every
        engine.

    Raises
    ------
    IsoformError
        If the mesh is empty, there are more blocks than cells, or blocks do not match.
    KeyboardInterrupt
        After Ctrl-C.

    Examples
    --------
    >>> import isoform, tempfile
    >>> from isoform.distributed import mesh_blocks
    >>> ball = isoform.template("sphere")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = mesh_blocks(ball, (2, 1, 1), folder + "/ball.pvtu", size=0.3,
    ...                        params={"radius": 1})
    >>> made.certificate["ok"], round(made.certificate["volume"])
    (True, 4)
    """
    run = _engine(engine)
    if not isinstance(model, Model):
        raise TypeError(f"model: a Model is expected, not {type(model).__name__}")
    counts = [whole("blocks", count, 1) for count in blocks]
    if len(counts) != 3:
        raise IsoformError(f"blocks are {len(counts)} numbers: three are expected")
    options = {"size": size, "box": corners(box), "grade": grade, "angles": angles}
    wanted = given({"model": "-", **options, "memory": there(memory)})
    path = FilePath(os.fspath(out))
    with asked(threads, None, progress) as limits:
        x, y, z = counts
        shape = model._native, model._given(params)
        job = _isoform.BlocksWork(shape, (x, y, z), path, wanted, limits)
        try:
            work = Blocks(model, params, {**wanted, "size": job.size})
            while tasks := job.tasks():
                if engine is None and processes is None:
                    reports = _here(work, job.step, tasks, limits)
                else:
                    rows = run(work, tasks) if engine else _local(work, tasks, processes)
                    reports = _reports(rows, job.step, len(tasks), limits[2])
                job.advance(reports)
            return BlockedMesh(path, job.finish())
        finally:
            job.close()


def _here(work: Blocks, step: str, tasks: list[str], limits: Asked) -> list[str]:
    """Execute tasks in turn in this process, and return their reports."""
    reports = []
    for done, task in enumerate(tasks):
        _tell(limits[2], step, done / len(tasks))
        reports.append(work.report(task, (limits[0], None, None)))
    return reports


def _reports(rows: Iterator[Any], step: str, count: int, progress: Any) -> list[str]:
    """Collect the reports of tasks executed by workers."""
    reports: list[str] = []
    with contextlib.closing(rows) as rows:  # type: ignore[type-var]
        for _, row in rows:
            if not row["ok"]:
                raise IsoformError(row["error"], row.get("code", "worker"), row.get("hint"))
            reports.append(row["report"])
            _tell(progress, step, len(reports) / count)
    return reports


def _tell(progress: Any, step: str, done: float) -> None:
    if progress is not None and progress(step, done) is False:
        raise IsoformError("stopped", "time-limit")


# ---- processes of this machine -------------------------------------------------------------------


def _local(job: Work, sources: Iterable[str], processes: int | None = None) -> Iterator[Any]:
    """Compute rows by processes of this machine, each fed by a thread."""
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
        # After an exception, tasks that are still waiting are dropped.
        with contextlib.suppress(queue.Empty):
            while True:
                waiting.get_nowait()
        for feeder in feeders:
            waiting.put(None)
        for feeder in feeders:
            feeder.end()


def _taken(done: queue.Queue[Any]) -> Any:
    """Return the next row; waits in short intervals, so that Ctrl-C is handled."""
    while True:
        try:
            return done.get(timeout=0.2)
        except queue.Empty:
            continue


class _Feeder:
    """Thread that feeds sources to a process, which it replaces if it dies."""

    def __init__(self, job: Work, waiting: queue.Queue[Any], done: queue.Queue[Any]) -> None:
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
        """End the process, even if busy, and the thread."""
        self._is_over = True
        if self._worker:
            self._worker.kill()
        self._thread.join()
        self._close()


class _Worker:
    """Process that computes rows."""

    def __init__(self) -> None:
        command = [sys.executable, "-m", "isoform._worker"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._job: Work | None = None

    def row(self, job: Work, source: str) -> Row:
        """Compute the row of a source."""
        assert self._process.stdin is not None and self._process.stdout is not None
        if self._job is not job:
            pickle.dump(job, self._process.stdin)
            self._job = job
        pickle.dump(source, self._process.stdin)
        self._process.stdin.flush()
        row: Row = pickle.load(self._process.stdout)
        return row

    def kill(self) -> None:
        """Kill the process; a thread that waits for its row gets an error."""
        self._process.kill()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        with contextlib.suppress(OSError):
            self._process.__exit__(None, None, None)


# ---- clusters ------------------------------------------------------------------------------------


def _ray(job: Work, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
    """Compute rows by tasks of Ray."""
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


def _dask(job: Work, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
    """Compute rows by tasks of Dask."""
    cluster = need("distributed")
    client = cluster.get_client()
    room = AHEAD * max(1, sum(client.ncores().values()))
    waiting, names = iter(sources), dict[Any, str]()
    done, lost = cluster.as_completed(), collections.Counter[str]()

    def hand_out(source: str) -> None:
        # The job is sent each time: scattered data are lost with their worker.
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


def _row(job: Work, source: str) -> Row:
    """Run the task of a cluster."""
    return job.row(source)


def _pool(executor: Submits) -> Engine:
    """Compute rows by tasks of an executor (`submit`, with futures of `done` and `result`)."""

    def rows(job: Work, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
        waiting, pending = iter(sources), dict[Any, str]()
        room = AHEAD * (os.cpu_count() or 1)
        while True:
            for source in itertools.islice(waiting, room - len(pending)):
                pending[executor.submit(_row, job, source)] = source
            if not pending:
                return
            for future in [f for f in pending if f.done()]:
                source = pending.pop(future)
                try:
                    yield source, future.result()
                except Exception as e:
                    yield source, failed(source, f"worker: {type(e).__name__}: {e}")
            time.sleep(0.005)

    return rows


#: Engines by name.
ENGINES: dict[Union[str, None], Engine] = {None: _local, "ray": _ray, "dask": _dask}
