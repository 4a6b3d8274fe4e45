"""The command line of the validation: wrong use is one line and exit status 2."""

import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Timer

import pytest

import build_fmu
from tests.toolchain import on_linux
from validation.command import INTERRUPTED, Parser
from validation.fmu import Experiment, Fmu

ROOT = Path(__file__).resolve().parent.parent


def command(
    module: str, *arguments: str | Path, optimize: Sequence[str] = ()
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *optimize, "-m", module, *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


@pytest.fixture(scope="module")
def other_fmu(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    entries = build_fmu.read_entries(fmu_path)
    name = "modelDescription.xml"
    entries[name] = entries[name].replace(b'name="phi_start"', b'name="theta0"')
    path = tmp_path_factory.mktemp("other") / "other.fmu"
    build_fmu.write_entries(path, entries)
    return path


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["pendelum"], "unknown study 'pendelum' (allowed: elliptic_period, trajectory"),
        (["--fmu", "missing.fmu"], "missing.fmu does not exist: build it with python build_fmu.py"),
        (["--fmu", "LICENSE"], "LICENSE is not a readable FMU"),
        (["--fmu", "tests"], "tests is not a file"),
        (["--fmu", "LICENSE/x.fmu"], "LICENSE/x.fmu cannot be read: Not a directory"),
        (
            ["--picture", "missing/a.png"],
            "--picture missing/a.png: must be a file in a directory that exists",
        ),
        (["--speed", "3"], "--speed"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(arguments: list[str], words: str) -> None:
    result = command("validation", *arguments)
    assert result.returncode == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_report_needs_a_directory_and_makes_none_in_vain(fmu_path: Path, tmp_path: Path) -> None:
    result = command("validation", "--fmu", fmu_path, "--output", "LICENSE")
    assert result.returncode == 2
    assert result.stderr == "python -m validation: --output LICENSE: must be a directory (File exists)\n"
    assert command("validation", "--fmu", "missing.fmu", "--output", tmp_path / "report").returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_an_fmu_of_another_interface_is_refused(other_fmu: Path) -> None:
    result = command("validation", "--fmu", other_fmu)
    assert result.returncode == 2
    assert "has another interface: no variable phi_start" in result.stderr
    assert len(result.stderr.splitlines()) == 1


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of temporary files of the commands."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    return folder


@pytest.mark.parametrize("module", ["validation", "validation.quickstart"])
def test_an_fmu_without_a_binary_for_this_machine_is_refused_and_leaves_nothing_behind(
    fmu_path: Path, tmp_path: Path, temporary: Path, module: str
) -> None:
    entries = build_fmu.read_entries(fmu_path)
    path = tmp_path / "bare.fmu"
    build_fmu.write_entries(path, {name: data for name, data in entries.items() if "binaries/" not in name})
    result = command(module, "--fmu", path)
    assert result.returncode == 2
    assert "bare.fmu cannot be instantiated: Cannot find" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(temporary.iterdir()) == []


def test_a_damaged_fmu_is_refused_and_leaves_nothing_behind(
    fmu_path: Path, tmp_path: Path, temporary: Path
) -> None:
    path = tmp_path / "damaged.fmu"
    data = bytearray(fmu_path.read_bytes())
    with zipfile.ZipFile(fmu_path) as archive:
        binary = archive.getinfo("binaries/linux64/DampedPendulum.so")
    data[binary.header_offset + binary.compress_size // 2] ^= 1
    path.write_bytes(data)
    result = command("validation", "--fmu", path)
    assert result.returncode == 2
    assert "damaged.fmu cannot be instantiated: " in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(temporary.iterdir()) == []


def shortest(module: str, folder: Path) -> list[str]:
    """Return what makes the shortest run of a command."""
    return ["errata", "--no-faults", "--output", str(folder / "report")] if module == "validation" else []


@on_linux
@pytest.mark.parametrize("module", ["validation", "validation.quickstart"])
def test_a_full_disk_is_one_line_and_leaves_nothing_behind(
    fmu_path: Path, tmp_path: Path, temporary: Path, module: str
) -> None:
    limited = (
        "import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); "
        "runpy.run_module(sys.argv.pop(1), run_name='__main__')"
    )
    result = subprocess.run(
        [sys.executable, "-c", limited, module, *shortest(module, tmp_path), "--fmu", fmu_path],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert result.returncode == 2
    assert "File too large" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(temporary.iterdir()) == []


@on_linux
def test_an_output_that_cannot_be_written_is_one_line_and_status_2(fmu_path: Path, temporary: Path) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        result = subprocess.run(
            [sys.executable, "-m", "validation.quickstart", "--fmu", fmu_path],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            check=False,
        )
    assert (result.returncode, result.stderr) == (
        2,
        "python -m validation.quickstart: cannot go on: No space left on device\n",
    )
    assert list(temporary.iterdir()) == []


@on_linux
@pytest.mark.parametrize("module", ["validation", "validation.quickstart"])
def test_a_reader_that_has_seen_enough_is_no_error(
    fmu_path: Path, tmp_path: Path, temporary: Path, module: str
) -> None:
    started = subprocess.Popen(
        [sys.executable, "-m", module, *shortest(module, tmp_path), "--fmu", fmu_path],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=ROOT,
    )
    assert started.stdout is not None
    assert started.stderr is not None
    started.stdout.close()
    with started.stderr:
        assert started.stderr.read() == b""
    assert started.wait() == 1
    assert list(temporary.iterdir()) == []


def test_a_chosen_study_is_run_and_reported(fmu_path: Path, tmp_path: Path) -> None:
    result = command(
        "validation",
        "impulse_response",
        "--fmu",
        fmu_path,
        "--output",
        tmp_path / "r",
        "--no-plots",
        "--no-faults",
    )
    assert result.returncode == 0, result.stderr
    assert "rows about the FMU hold" in result.stdout
    page = (tmp_path / "r" / "index.html").read_text("utf-8")
    assert "Linear impulse response" in page
    assert "Elliptic period" not in page
    assert "<svg" not in page
    assert (tmp_path / "r" / "checks.csv").read_text("utf-8").startswith("check,about,measured")


def test_quickstart_prints_measured_and_exact(fmu_path: Path) -> None:
    result = command("validation.quickstart", "--fmu", fmu_path)
    assert result.returncode == 0, result.stderr
    assert "2.041338465858" in result.stdout  # the exact period at 30 deg, 20 digits: 2.0413384658583683343
    assert "impulse" in result.stdout


@pytest.mark.parametrize("module", ["validation", "validation.quickstart", "validation.sweep"])
def test_help_is_the_same_without_docstrings(module: str) -> None:
    full, bare = command(module, "--help"), command(module, "--help", optimize=["-OO"])
    assert full.returncode == bare.returncode == 0
    assert full.stdout == bare.stdout


@pytest.mark.parametrize("optimize", ["-O", "-OO"])
def test_the_numbers_are_the_same_without_assertions_and_docstrings(fmu_path: Path, optimize: str) -> None:
    full, bare = (
        command("validation.quickstart", "--fmu", fmu_path, optimize=options) for options in ((), [optimize])
    )
    assert bare.returncode == 0, bare.stderr
    assert bare.stdout == full.stdout


def test_a_study_runs_without_assertions_and_docstrings(fmu_path: Path, tmp_path: Path) -> None:
    result = command(
        "validation",
        *("impulse_response", "--fmu", fmu_path, "--output", tmp_path, "--no-plots", "--no-faults"),
        optimize=["-OO"],
    )
    assert result.returncode == 0, result.stderr
    assert "rows about the FMU hold" in result.stdout


@pytest.mark.parametrize(
    ("module", "file", "arguments", "words"),
    [
        (
            "validation",
            "index.html",
            ["errata", "--no-faults", "--no-plots", "--output"],
            "the report cannot be",
        ),
        ("validation.quickstart", "a.png", ["--plot"], "--plot"),
    ],
)
def test_what_cannot_be_written_is_one_line_and_status_2(
    fmu_path: Path, tmp_path: Path, module: str, file: str, arguments: list[str], words: str
) -> None:
    (tmp_path / file).mkdir()
    target = tmp_path if module == "validation" else tmp_path / file
    result = command(module, "--fmu", fmu_path, *arguments, target)
    assert result.returncode == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert list(tmp_path.glob("*.partial")) == []


@pytest.mark.parametrize("arrived", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_of_a_command_is_a_line(
    capsys: pytest.CaptureFixture[str], arrived: signal.Signals
) -> None:
    with pytest.raises(SystemExit) as exit, Parser(prog="command").interruptible():
        signal.raise_signal(arrived)
    assert exit.value.code == INTERRUPTED
    assert capsys.readouterr().err == "command: interrupted\n"


def test_an_interrupt_within_a_long_step_is_one_of_the_program(fmu_path: Path) -> None:
    """The FMU reports it as an error, as which a study would go on."""
    timer = Timer(0.5, signal.raise_signal, [signal.SIGINT])
    with Fmu(fmu_path) as fmu, pytest.raises(KeyboardInterrupt):  # noqa: PT012  # it may come at once
        timer.start()
        fmu.run(Experiment(1e3, 1e3, {"solver.stepSize": 1e-5}))


def study_of_faults(fmu: Path, report: Path) -> subprocess.Popen[bytes]:
    """Return a command that puts faults into a study, in processes of its own, and has shown a row of it."""
    arguments = ("impulse_response", "--no-plots", "--fmu", fmu, "--output", report)
    started = subprocess.Popen(
        [sys.executable, "-m", "validation", *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert started.stdout is not None
    assert any(b"holds" in line for line in started.stdout)
    return started


@on_linux
@pytest.mark.parametrize(
    ("arrived", "send"),
    [(signal.SIGINT, os.killpg), (signal.SIGTERM, os.kill)],  # as a terminal and as a batch system do
    ids=["Ctrl-C", "SIGTERM"],
)
def test_an_interrupt_ends_the_study_of_faults_without_noise(
    fmu_path: Path,
    tmp_path: Path,
    temporary: Path,
    arrived: signal.Signals,
    send: Callable[[int, signal.Signals], None],
) -> None:
    started = study_of_faults(fmu_path, tmp_path / "report")
    send(started.pid, arrived)
    assert started.wait() == 130
    _, noise = started.communicate()  # until no process is left that could write
    assert noise == b"python -m validation: interrupted\n"
    assert list(temporary.iterdir()) == []


@on_linux
def test_a_lost_process_of_the_study_of_faults_is_one_line(
    fmu_path: Path, tmp_path: Path, temporary: Path
) -> None:
    started = study_of_faults(fmu_path, tmp_path / "report")
    children = Path(f"/proc/{started.pid}/task/{started.pid}/children").read_text("utf-8").split()
    workers = [pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(int(workers[0]), signal.SIGKILL)  # as the system does for want of memory
    _, said = started.communicate()
    assert started.returncode == 2
    assert said == (
        b"python -m validation: one of the processes that study the faults has ended "
        b"(--no-faults leaves them out)\n"
    )
    assert list(temporary.iterdir()) == []
