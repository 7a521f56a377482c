"""Fleets of scans, huge clouds, and meshes in blocks, on local processes, Ray or Dask.

Scans are fitted one by one, each by one thread of one process, so that a fleet takes as many of
them at once as there are cores; the numbers are those of `isoform.fit`. Rows are written as they
come. A cloud in chunks is fitted by sums over them (`fit_large`). Ray and Dask are taken where they
are asked for, with the connection that is there.

A huge model is meshed in blocks. The steps of its blocks are tasks as well, which read files of a
folder beside the output and write others there; they are planned and their reports compared here.
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
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Protocol, Union

import numpy as np

from . import _isoform
from ._call import Asked, Progress, asked, corners, given, there, whole
from ._document import Documented
from ._errors import IsoformError
from ._large import Engine as Where
from ._large import Submits, fit_large, known
from ._model import Model, Values
from ._optional import need
from ._points import Path, read_points
from ._results import FitResult
from ._verbs import Box, fit

__all__ = ["BlockedMesh", "fit_large", "fit_many", "mesh_blocks"]

#: A row of the table.
Row = dict[str, Any]
#: Sources go in, and come out with their rows in the order in which they are done.
Engine = Callable[["Work", Iterable[str]], Iterator[tuple[str, Row]]]

#: How often a source is tried whose worker dies: the worker may have been killed for another's
#: sake, but a scan that kills each one must not go on for ever.
TRIES = 4
#: Tasks that are handed out for each core: enough that none waits, few enough to be kept in memory.
AHEAD = 3


class Work(Protocol):
    """What can be sent to workers."""

    def row(self, source: str) -> Row:
        """What comes of a source; what is wrong with it is an entry."""


class Job:
    """Fits, as they are done with each source."""

    def __init__(self, templates: Sequence[Model], options: dict[str, Any]) -> None:
        self.templates = list(templates)
        self.options = options

    def key(self) -> str:
        """Tells jobs apart that give other rows."""
        options = json.dumps(self.options, sort_keys=True, default=list)
        texts = [text for t in self.templates for text in (t.name, t.text)]
        return _digest("\0".join([_isoform.__version__, *texts, options]))

    def names(self) -> list[str]:
        """The parameters of all templates, each once."""
        pose = self.options.get("pose")
        names = [n for t in self.templates for n in t._native.fitted_names(pose)]
        return list(dict.fromkeys(names))

    def row(self, source: str) -> Row:
        """The row of a source; what is wrong with it is an entry."""
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
        """The options of one of several templates: what names a parameter counts where it is."""
        if len(self.templates) == 1:
            return self.options
        names = template._native.fitted_names(self.options.get("pose"))
        options = dict(self.options)
        for key in ("start", "bounds", "fixed"):
            if isinstance(options.get(key), Mapping):
                options[key] = {k: v for k, v in options[key].items() if k in names} or None
        return options


def _rank(result: FitResult) -> tuple[int, float]:
    """Orders fits of one scan, the best first: by the verdict, then by Bayes' criterion."""
    n = int(np.count_nonzero(~result.outliers))
    told = sum(status == "determined" for status in result.status.values())
    cost = 2 * n * math.log(max(result.rms, 1e-300)) + told * math.log(max(n, 1))
    return ["accepted", "doubtful", "refused"].index(result.verdict), cost


def _told(error: Exception) -> str:
    code = error.code if isinstance(error, IsoformError) else type(error).__name__
    return f"{code}: {error}"


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
        known = {"source": text, "ok": truth, "error": text, "template": text, "rms": number}
        known |= {"acceptable": truth, "json": text}
        self._schema = pyarrow.schema({**known, **{n: number for n in job.names()}})
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
        Files of points (n, 3); workers must see them by the same names.
    template : Model or sequence of Model
        The template; of several the one with the best verdict, then the least value of Bayes'
        criterion (2 n ln rms + parameters ln n).
    engine : str or executor, optional
        ``"ray"`` or ``"dask"``: the connection that is there (``ray.init``,
        ``distributed.Client``); or an executor, such as a ``ProcessPoolExecutor`` or a client of
        Dask; by default processes of this machine.
    out : path
        A folder of parquet files, one row for each source, written as they come: ``source``,
        ``ok``, ``error``, ``template``, ``rms``, ``acceptable``, ``json`` (the document of the fit
        as text) and a column for each parameter of any template. ``pandas.read_parquet`` reads it.
    resume : bool
        Rows that are there with the same template and options stay; rows of others are made anew.
    processes : int, optional
        How many of this machine, by default one for each core.
    **options
        Those of `isoform.fit`: start, bounds, seed, fixed, pose, method, loss, keep, time_limit. Of
        several templates, start, bounds and fixed count where a parameter has that name.

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
    """Who does the work: the engine of a name, or an executor."""
    if not isinstance(name, str) and name is not None:
        return _pool(name)
    run = ENGINES.get(name)
    if run is None:
        names = ", ".join(repr(name) for name in ENGINES)
        raise IsoformError(f"engine is {name!r}", "usage", f"one of: {names}")
    return run


# ---- meshes in blocks ----------------------------------------------------------------------------


class BlockedMesh(Documented):
    """The mesh of a huge model: files, and what is known of them.

    Attributes
    ----------
    path : pathlib.Path
        The .pvtu, which names the .vtu of each block.
    certificate : dict
        What is proved of the whole: ``ok``, ``tets``, ``volume``, ``shared_faces`` and so on.
    blocks : list of dict
        What is known of each block, x fastest: its ``warnings``, and its ``figures`` with
        ``file``, ``tets``, ``dihedral_angles``, ``failures`` and so on.
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
    """Steps of blocks, done by one thread of a worker."""

    def __init__(self, model: Model, params: Values, wanted: dict[str, Any]) -> None:
        self.model = model
        self.params = params
        self.wanted = wanted

    def row(self, source: str) -> Row:
        """The report of a task; what is wrong is an entry."""
        try:
            return {"ok": True, "report": self.report(source, (1, None, None))}
        except IsoformError as e:
            return {"ok": False, "error": str(e), "code": e.code, "hint": e.hint}

    def report(self, task: str, limits: tuple[int | None, float | None, Any]) -> str:
        """The report of a task."""
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
    """Mesh a huge model in blocks, which meet node for node.

    Parameters
    ----------
    model : Model
        What to mesh.
    blocks : tuple of int
        How many along x, y and z.
    out : path
        A .pvtu; each block is a .vtu beside it. Files between the steps lie in a hidden folder
        there, which workers must see by the same name.
    engine : str or executor, optional
        ``"ray"`` or ``"dask"``: the connection that is there (``ray.init``,
        ``distributed.Client``); by default blocks are done here, one after the other, in the
        memory for one of them.
    size : float, optional
        Length of edges in the model's unit, the largest one where sizes vary; by default a
        fortieth of the diagonal.
    params : dict or sequence of float, optional
        Values of the model's parameters by name, or in their order.
    box : float or sequence, optional
        Mesh what lies in it: half the width of a box around the origin, or its two corners.
    grade : float, optional
        Smaller edges where a face would leave the surface by more than this length.
    angles : tuple of float, optional
        Bounds of dihedral angles, degrees: worked towards, and required in the certificates.
    memory : float, optional
        Refuse blocks that take more than this many GiB each, by estimate; 16 by default.
    processes : int, optional
        How many of this machine work on blocks, where there is no engine.
    threads : int, optional
        How many to use here, where blocks are done one after the other; by default all cores.
    progress : callable or bool, optional
        Called with the name of a step and the share of it that is done. True shows a bar.

    Returns
    -------
    BlockedMesh
        With ``.path`` and ``.certificate``. The files are the same, byte for byte, with every
        engine.

    Raises
    ------
    IsoformError
        If there is no mesh, there are more blocks than cells, or blocks do not meet.
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
    """The reports of tasks, one after the other in this process."""
    reports = []
    for done, task in enumerate(tasks):
        _tell(limits[2], step, done / len(tasks))
        reports.append(work.report(task, (limits[0], None, None)))
    return reports


def _reports(rows: Iterator[Any], step: str, count: int, progress: Any) -> list[str]:
    """The reports of tasks that workers do."""
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
        self._job: Work | None = None

    def row(self, job: Work, source: str) -> Row:
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


def _ray(job: Work, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
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


def _dask(job: Work, sources: Iterable[str]) -> Iterator[tuple[str, Row]]:
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


def _row(job: Work, source: str) -> Row:
    """What a task of a cluster does."""
    return job.row(source)


def _pool(executor: Submits) -> Engine:
    """Rows by tasks of an executor: what has `submit`, and gives futures with `done`, `result`."""

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


#: By name, who does the work.
ENGINES: dict[Union[str, None], Engine] = {None: _local, "ray": _ray, "dask": _dask}
