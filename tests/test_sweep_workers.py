"""Sweeps on Dask: each row once whoever dies, on workers that know nothing of this project."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from errno import EAGAIN
from pathlib import Path
from threading import Event
from typing import Any

import pytest

import build_fmu
from tests.test_sweep import rows_of, same
from validation.fmu import Experiment, Fmu, describe
from validation.sweep.__main__ import main
from validation.sweep.errors import BrokenError, WrongUseError
from validation.sweep.interface import interface
from validation.sweep.plan import Common, Plan, axis, of_axes

dask = pytest.importorskip("dask", reason="Dask is not installed: pip install '.[sweep]'")
workers = pytest.importorskip(
    "validation.sweep.workers", reason="Dask is not installed", exc_type=ImportError
)
ROOT = Path(__file__).resolve().parent.parent
NAMES = ("one", "two")  # of the workers of a cluster
# A busy machine may take any time for what a test waits for, so that Dask shall not give up before.
PATIENCE = "1000 days"
PATIENT = {"distributed.comm.timeouts.connect": PATIENCE, "distributed.scheduler.worker-ttl": None}


def plan(fmu: Path, *axes: str, stop: float = 1.0, interval: float = 0.01) -> Plan:
    known = interface(describe(fmu))
    names, count, runs = of_axes([axis(text, known) for text in axes])
    return Plan(Common(known, names, stop, interval), count, runs)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let Dask wait, here and in the processes that are started."""
    monkeypatch.setattr(workers, "PATIENCE", PATIENCE)
    for name, value in PATIENT.items():
        monkeypatch.setenv("DASK_" + name.replace(".", "__").replace("-", "_").upper(), repr(value))
    with dask.config.set(PATIENT):
        yield


def until(condition: Callable[[], object], started: subprocess.Popen[Any]) -> None:
    """Wait for a condition, however long it takes; fail if the process that brings it about has ended before."""
    pause, never = 0.05, Event()
    while not condition():
        running = started.poll() is None
        assert running or condition(), started.args
        never.wait(pause)


@contextmanager
def process(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a program of Dask that runs in a folder of its own, where nothing of this project can be imported."""
    folder.mkdir()
    with (folder / "log").open("wb") as log:
        started = subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments], cwd=folder, stdout=log, stderr=subprocess.STDOUT
        )
    try:
        yield started
    finally:
        started.kill()
        started.wait()


class Cluster:
    """A scheduler and its workers on loopback, which share no folder."""

    def __init__(self, folder: Path, stack: ExitStack, names: Sequence[str] = NAMES) -> None:
        file = folder / "scheduler.json"
        where = ("--scheduler-file", str(file))
        scheduler = ("--host", "127.0.0.1", "--port", "0", "--dashboard-address", "127.0.0.1:0")
        self.scheduler = stack.enter_context(process(folder / "scheduler", "scheduler", *where, *scheduler))
        self.workers = [
            stack.enter_context(
                process(
                    folder / name,
                    *("worker", *where, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name),
                    *("--local-directory", str(folder / name)),
                )
            )
            for name in names
        ]
        self.folder = folder
        until(lambda: file.exists() and file.read_text("utf-8").endswith("}"), self.scheduler)
        self.address: str = json.loads(file.read_text("utf-8"))["address"]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    with ExitStack() as stack:
        folder = tmp_path / "cluster"
        folder.mkdir()
        yield Cluster(folder, stack)


def test_the_numbers_are_the_same_here_on_a_cluster_and_without_dask(
    native_path: Path, cluster: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    axes = ("phi_start=10:170:4:deg", "solver.method=ExplicitRungeKutta4,SDIRK4", "gamma=-1,0,0.002")
    options = (*axes, "--fmu", str(native_path), "--stop-time", "1", "--output-interval", "0.01")
    places = {"here": ("--jobs", "2"), "there": ("--scheduler", cluster.address)}
    for name, place in places.items():
        assert main([*options, "--output", str(tmp_path / f"{name}.csv"), *place]) == 0
        assert capsys.readouterr().out.startswith("24 of 24 runs (8 failed, 0 with a warning)")
    rows = rows_of(tmp_path / "here.csv")
    assert same(rows, rows_of(tmp_path / "there.csv"))
    with Fmu(native_path) as fmu:
        for row in rows:
            method = 3 if row["solver.method"] == "ExplicitRungeKutta4" else 7
            start = {"phi_start": row["phi_start"], "gamma": row["gamma"], "solver.method": method}
            run = fmu.run(Experiment(1.0, 0.01, start, record=("phi", "w", "a", "E")))
            if row["failure"]:
                assert row["failure"] == run.failure
            else:
                assert [row[name] for name in run.columns] == [column[-1] for column in run.columns.values()]


def test_a_sweep_leaves_its_output_and_nothing_else(native_path: Path, tmp_path: Path) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    options = ("m=1,2", "--fmu", native_path, "--stop-time", "1", "--jobs", "2")
    done = subprocess.run(
        [sys.executable, "-m", "validation.sweep", *options, "--output", tmp_path / "rows.csv"],
        cwd=ROOT,
        env=os.environ | {"TMPDIR": str(temporary)},
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert {path.relative_to(tmp_path) for path in tmp_path.rglob("*")} == {
        Path("rows.csv"),
        Path("temporary"),
    }


def test_a_scheduler_that_cannot_be_reached_is_one_line_within_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 0.5)
    with (
        pytest.raises(WrongUseError, match=r"--scheduler 127\.0\.0\.1:1: .*connect"),
        workers.remote("127.0.0.1:1"),
    ):
        pass


@pytest.mark.parametrize("kind", [RuntimeError, OSError])
def test_workers_that_cannot_be_started_are_one_line(
    kind: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        cause = OSError(EAGAIN, "Resource temporarily unavailable")
        raise cause if kind is OSError else RuntimeError("Nanny failed to start.") from cause

    monkeypatch.setattr(workers, "LocalCluster", refused)
    words = r"--jobs 2: the workers cannot be started: Resource temporarily unavailable\Z"
    with pytest.raises(WrongUseError, match=words), workers.local(2):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="no limit of open files that a process can ask for")
def test_more_workers_than_files_can_be_open_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers.resource, "getrlimit", lambda _: (256, 1024))
    monkeypatch.setattr(workers, "LocalCluster", None)
    with (
        pytest.raises(WrongUseError, match=r"--jobs 17: .* open files \(allowed: up to 16, "),
        workers.local(17),
    ):
        pass


def test_a_lost_scheduler_ends_the_sweep_with_its_reason(
    native_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = plan(native_path, "phi_start=10:170:1000:deg")
    rows = []
    with ExitStack() as stack:
        monkeypatch.setattr(workers, "LARGEST", 10)  # so that batches are left, however fast the machine is
        cluster = Cluster(tmp_path, stack, NAMES[:1])
        client = stack.enter_context(workers.remote(cluster.address))
        done = workers.outcomes(client, native_path, asked.common, asked.runs())
        rows += [next(done) for _ in range(5)]
        cluster.scheduler.kill()
        # Nobody is to wait for one that is dead.
        stack.enter_context(dask.config.set({"distributed.comm.timeouts.connect": "1 s"}))
        client._timeout = 1.0
        with pytest.raises(BrokenError, match="Error"):
            rows += done
    assert len(rows) < 1000


DEADLY = """\
            if self.gamma == 0.25 or (self.gamma == 0.75 and not __import__("os").path.exists({once!r})):
                open({once!r}, "w").close()
                __import__("os").kill(__import__("os").getpid(), 9)
"""


@pytest.fixture
def deadly(tmp_path: Path) -> Path:
    """Return an FMU that kills its process where gamma is 0.25, and the first time where it is 0.75."""
    shutil.copytree(build_fmu.SOURCES, tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    model = tmp_path / "src" / "damped_pendulum" / "model.py"
    text, before = model.read_text("utf-8"), "            drive = tau / J\n"
    assert text.count(before) == 1
    model.write_text(text.replace(before, DEADLY.format(once=str(tmp_path / "once")) + before), "utf-8")
    return build_fmu.build(tmp_path / "deadly.fmu", tmp_path / "src")


@pytest.mark.skipif(sys.platform == "win32", reason="no signal ends a process without its help")
def test_each_row_is_there_once_when_a_worker_is_killed(deadly: Path, cluster: Cluster) -> None:
    asked = plan(deadly, "phi_start=10:170:10:deg", "gamma=-1,0.75", stop=0.1)
    with workers.remote(cluster.address) as client:
        rows = [row for row, _ in workers.outcomes(client, deadly, asked.common, asked.runs())]
    # Its runs were done by the other one, which is there still and has tidied its disk.
    until(lambda: [one.poll() for one in cluster.workers].count(None) == 1, cluster.scheduler)
    names = [name for name, one in zip(NAMES, cluster.workers, strict=True) if one.poll() is None]
    assert [row["run"] for row in rows] == [asked.common.identity(values) for values in asked.runs()]
    assert [bool(row["failure"]) for row in rows] == [row["gamma"] == -1 for row in rows]
    assert list((cluster.folder / names[0]).rglob("sweep*")) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no signal ends a process without its help")
def test_a_run_that_ends_its_process_is_a_row(deadly: Path) -> None:
    asked = plan(deadly, "gamma=0,0.25,0.5", stop=0.1)
    impatient = {
        "distributed.scheduler.allowed-failures": 0,
        "distributed.deploy.lost-worker-timeout": "1 ms",
    }
    with dask.config.set(impatient), workers.local(1) as client:
        rows = [row for row, _ in workers.outcomes(client, deadly, asked.common, asked.runs())]
    assert sorted(row["run"] for row in rows) == sorted(map(asked.common.identity, asked.runs()))
    failures = {row["gamma"]: row["failure"] for row in rows if row["failure"]}
    assert failures == {0.25: "the process of the worker ended while the run was under way"}


# Control-C at a terminal, and the end of a batch job, reach all processes.
each_end = pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])


@pytest.mark.skipif(sys.platform == "win32", reason="no process groups")
@each_end
def test_an_interrupt_leaves_a_whole_file_and_no_noise(
    native_path: Path, tmp_path: Path, end: signal.Signals
) -> None:
    output = tmp_path / "rows.parquet"
    options = (
        "phi_start=10:170:100000:deg",
        "--fmu",
        native_path,
        "--output",
        output,
        "--jobs",
        "1",
        "--output-interval",
        "0.001",  # a part is full of samples after some runs
        "--record",
        "phi",
    )
    started = subprocess.Popen(
        [sys.executable, "-W", "error", "-m", "validation.sweep", *options],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    parts = output.with_name("rows.parquet.parts")
    try:
        until(parts.exists, started)
        os.killpg(started.pid, end)
        said, complained = started.communicate()
    finally:
        started.kill()
    assert started.returncode == 130
    assert complained == "python -m validation.sweep: interrupted; --resume goes on\n"
    written = int(said.split(" of ")[0])
    assert len(rows_of(output)) == written > 0
    assert not parts.exists()


SIGNALLED = """
import os, signal, sys
from distributed.process import AsyncProcess
from validation.sweep.__main__ import main
start = AsyncProcess.start
async def signalled(self):
    await start(self)
    os.killpg(0, {end})
AsyncProcess.start = signalled
if __name__ == "__main__":
    sys.exit(main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no process groups")
@each_end
def test_an_interrupt_while_workers_start_is_one_line(
    native_path: Path, tmp_path: Path, end: signal.Signals
) -> None:
    script = tmp_path / "signalled.py"
    script.write_text(SIGNALLED.format(end=int(end)), "utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", script, "m=1,2", "--fmu", native_path, "--jobs", "1"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        start_new_session=True,
        check=False,
    )
    assert done.returncode == 130
    assert done.stdout == ""
    assert done.stderr == "python -m validation.sweep: interrupted\n"
    assert list(tmp_path.iterdir()) == [script]
