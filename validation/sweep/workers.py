"""The runs of a sweep on Dask: processes of this machine, or a cluster.

The workers need FMPy, NumPy and SciPy. The code of this package and the FMU travel to them, because they share neither
disk nor folder with the sweep; the scheduler passes both on without opening them.
"""

from __future__ import annotations

import logging
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from itertools import count, islice
from math import inf
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from threading import Lock
from time import perf_counter
from typing import Any
from uuid import uuid4

import cloudpickle
import dask
from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin, get_worker

from ..command import deaf, reason
from ..fmu import Fmu
from .errors import BrokenError, WrongUseError
from .plan import Common, Values
from .row import Row, Trajectory, empty, run

if sys.platform != "win32":
    import resource

Done = tuple[Row, Trajectory | None]
SPEND = 0.5  # what a batch is meant to take [s]: a thousand times what Dask spends on it
LONGEST = 1.0  # time [s] after which a batch returns what is done
LARGEST = 1000  # runs of a batch
AHEAD = 4  # batches that are under way for each thread of the workers
PATIENCE = 5.0  # to reach the scheduler [s]
FILES = 60  # that the process of the sweep has open: 21 with Dask 2026.7, and some to spare
FILES_A_JOB = 12  # that each worker adds: 10

# Dask hands objects of a registered module to cloudpickle, which takes the code along from a registered package.
cloudpickle.register_pickle_by_value(sys.modules[__name__])
cloudpickle.register_pickle_by_value(sys.modules[__name__.partition(".")[0]])


class Bench(WorkerPlugin):
    """What a worker keeps for a sweep: the FMU, extracted once, and one instance of it, which its threads share."""

    def __init__(self, name: str, fmu: bytes, common: Common) -> None:
        self.name, self._bytes, self._common = name, fmu, common

    def setup(self, worker: Any) -> None:
        """Take a place on the disk of the worker."""
        self._folder = Path(worker.local_directory) / self.name
        self._fmu: Fmu | None = None
        self._turn = Lock()
        self._ended = False

    def teardown(self, worker: Any) -> None:
        """Give the instance and the place back, now or when the run of another thread has ended."""
        del worker
        self._ended = True
        if self._turn.acquire(blocking=False):
            self._close()
            self._turn.release()

    def _close(self) -> None:
        if self._fmu is not None:
            self._fmu.close()
            self._fmu = None
        rmtree(self._folder, ignore_errors=True)

    def work(self, batch: tuple[Values, ...]) -> tuple[list[Done], float]:
        """Return what was done of a batch until it took too long, at least one run, and the time of one [s]."""
        done: list[Done] = []
        with self._turn:
            begin = perf_counter()
            while (
                not self._ended and len(done) < len(batch) and (perf_counter() - begin < LONGEST or not done)
            ):
                done.append(self._run(batch[len(done)]))
            if self._ended:
                self._close()
            return done, (perf_counter() - begin) / max(1, len(done))

    def _run(self, values: Values) -> Done:
        if self._fmu is None:
            self._folder.mkdir(parents=True, exist_ok=True)
            path = self._folder / "sweep.fmu"
            path.write_bytes(self._bytes)
            self._fmu = Fmu(path, self._folder / "extracted")
        return run(self._fmu, self._common, values)


def work(name: str, batch: tuple[Values, ...]) -> tuple[list[Done], float] | None:
    """Run a batch on the worker that this is called on; return None where the sweep is over."""
    bench: Any = get_worker().plugins.get(name)
    done: tuple[list[Done], float] | None = bench and bench.work(batch)
    return done


class ByValue:
    """A function that takes its code along even inside of a graph, which Dask pickles by reference."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._pickled = cloudpickle.dumps(function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        return self._function(*arguments)

    def __reduce__(self) -> tuple[Callable[[bytes], Any], tuple[bytes]]:
        return cloudpickle.loads, (self._pickled,)


def _most_jobs() -> float:
    """Return how many workers the process can talk to; Dask would wait for ever for files that it cannot open."""
    if sys.platform == "win32":
        return inf
    allowed = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return inf if allowed == resource.RLIM_INFINITY else max(0, allowed - FILES) // FILES_A_JOB


@contextmanager
def local(jobs: int, starting: AbstractContextManager[None] | None = None) -> Iterator[Client]:
    """Yield a client of `jobs` processes of this machine, which are started in the context `starting`.

    Raises
    ------
    WrongUseError : they cannot be started
    """
    if jobs > (most := _most_jobs()):
        few = "the system allows too few open files"
        raise WrongUseError(f"--jobs {jobs}: {few} (allowed: up to {most}, more with ulimit -n)")
    with ExitStack() as stack:
        # The nanny of a worker starts it anew; the cluster would close both if that took more than 15 s.
        stack.enter_context(dask.config.set({"distributed.deploy.lost-worker-timeout": "1000 days"}))
        # Dask leaves the folder that its workers share.
        folder = stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({"temporary-directory": folder}))
        # Closed while workers run, the cluster leaves calls behind that nobody waits for.
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)
        with starting or nullcontext(), deaf():
            try:
                cluster = stack.enter_context(
                    LocalCluster(
                        n_workers=jobs,
                        threads_per_worker=1,
                        processes=True,
                        host="127.0.0.1",
                        dashboard_address="127.0.0.1:0",
                        memory_limit=None,
                        silence_logs=logging.CRITICAL,  # what goes wrong is in the rows, or ends the sweep
                    )
                )
                client = stack.enter_context(Client(cluster))
            except (RuntimeError, OSError) as error:  # Dask's RuntimeError tells the reason as its cause
                said = reason(error.__cause__ or error)
                raise WrongUseError(f"--jobs {jobs}: the workers cannot be started: {said}") from None
        yield client


@contextmanager
def remote(address: str) -> Iterator[Client]:
    """Yield a client of the scheduler at `address`.

    Raises
    ------
    WrongUseError : it cannot be reached
    """
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise WrongUseError(f"--scheduler {address}: {reason(error)}") from None
    with client:
        yield client


def outcomes(client: Client, fmu: Path, common: Common, runs: Iterator[Values]) -> Generator[Done]:
    """Yield what each run gives, in the order of the runs but for suspects; some batches are under way at a time.

    The batches of a worker whose process ends are given to others. A batch that several workers ended with is suspect:
    its runs are repeated behind all others, each alone, so that one that ends every worker is told from its neighbours.

    Raises
    ------
    BrokenError : the workers cannot run the FMU, or the scheduler is lost
    """
    bench = Bench(f"sweep-{uuid4().hex}", fmu.read_bytes(), common)
    function = ByValue(work)
    waiting: deque[tuple[Any, tuple[Values, ...]]] = deque()
    suspects: list[Values] = []

    keys = (f"{bench.name}-{i}" for i in count())

    def submitted(batch: tuple[Values, ...]) -> tuple[Any, tuple[Values, ...]]:
        return client.submit(function, bench.name, batch, key=next(keys)), batch

    size = 1
    try:
        client.register_plugin(bench, name=bench.name)
        while True:
            under_way = AHEAD * max(1, sum(client.nthreads().values()))
            while len(waiting) < under_way and (batch := tuple(islice(runs, size))):
                waiting.append(submitted(batch))
            if not waiting:
                break
            future, batch = waiting.popleft()
            try:
                returned = future.result()
            except KilledWorker:
                suspects += batch
                continue
            if returned is None:
                raise BrokenError("another client has removed the FMU from the workers")
            done, seconds = returned
            yield from done
            size = int(min(max(SPEND / max(seconds, 1e-9), 1), LARGEST))
            left = batch[len(done) :]
            parts = [left[i : i + size] for i in range(0, len(left), size)]
            waiting.extendleft(submitted(part) for part in reversed(parts))
        for values in suspects:
            try:
                yield from submitted((values,))[0].result()[0]
            except KilledWorker:
                lost = "the process of the worker ended while the run was under way"
                yield empty(common, values) | {"failure": lost}, None
    except BrokenError:
        raise
    except (Exception, CancelledError) as error:  # the workers' exceptions are of any kind
        kind, said = type(error).__name__, reason(error)
        raise BrokenError(kind if said == kind else f"{kind}: {said}") from error
    finally:
        with suppress(Exception):  # the scheduler may be lost
            client.cancel([future for future, _ in waiting])
            client.unregister_worker_plugin(bench.name)
