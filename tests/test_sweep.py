"""Sweeps without Dask: what is asked for, what a row holds, and files that are whole whenever a sweep ends."""

import csv
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from errno import ENOSPC
from importlib.util import find_spec
from itertools import product
from math import hypot, log, nan, sqrt
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from tests.conftest import Builds
from tests.plants import PENDULUM
from validation import references
from validation.fmu import W0, W02, Experiment, Fmu, describe
from validation.references import discrete
from validation.references import taylor as taylor_series
from validation.sweep import __main__ as command
from validation.sweep.files import FORMATS, Store, _taken, locked
from validation.sweep.interface import Interface, interface
from validation.sweep.plan import Common, axis, of_axes, of_file
from validation.sweep.row import Row, Trajectory, columns, run

ROOT = Path(__file__).resolve().parent.parent
EPS = 2.0**-52
needs_pyarrow = pytest.mark.skipif(
    find_spec("pyarrow") is None, reason="pyarrow is not installed: pip install '.[sweep]'"
)
SUFFIXES = ["csv", pytest.param("parquet", marks=needs_pyarrow)]


@pytest.fixture(scope="module")
def fmu(native_path: Path) -> Iterator[Fmu]:
    with Fmu(native_path) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def known(native_path: Path) -> Interface:
    return interface(describe(native_path))


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file, numbers as numbers and what there is none of as None."""
    if path.suffix == ".parquet":
        import pyarrow.parquet as pq

        return pq.read_table(path).to_pylist()
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: _read(text) for name, text in row.items()} for row in csv.DictReader(file)]


def _read(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text or None


# What is asked for


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("gamma=0:1:5", [0.0, 0.25, 0.5, 0.75, 1.0]),
        ("gamma=1:0:3", [1.0, 0.5, 0.0]),
        ("gamma=0.1:0.3:1", [0.1]),
        ("gamma=0.3:0.3:7", [0.3]),
        ("gamma=0.1,0.2,0.1", [0.1, 0.2]),
        ("phi_start=180:deg", [180 / 57.29577951308232]),
        ("phi_start=1:rad", [1.0]),
        ("phi_start=0:180:3:deg", [0.0, 90 / 57.29577951308232, 180 / 57.29577951308232]),
        ("solver.method=ExplicitRungeKutta4,SDIRK4", [3.0, 7.0]),
        ("solver.method=1:8:8", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]),
        ("solver.method=TRBDF2,3", [6.0, 3.0]),
        ("tau=-1,1", [-1.0, 1.0]),
    ],
)
def test_an_axis_has_its_values_in_the_unit_of_the_interface(
    known: Interface, text: str, values: list[float]
) -> None:
    assert axis(text, known).values == values


def test_a_logarithmic_axis_has_equal_quotients_and_its_ends(known: Interface) -> None:
    values = axis("solver.stepSize=log:1e-4:0.3:9", known).values
    assert values[0] == 1e-4
    assert values[-1] == 0.3
    quotients = np.diff(np.log(values))
    assert quotients == pytest.approx([log(0.3 / 1e-4) / 8] * 8, rel=1e-13, abs=0)  # roundings of a power


def test_axes_are_multiplied_and_the_last_changes_first(known: Interface) -> None:
    names, count, runs = of_axes([axis("m=1,2", known), axis("L=3,4,5", known)])
    assert names == ("m", "L")
    assert list(runs()) == list(product((1.0, 2.0), (3.0, 4.0, 5.0)))
    assert count == 6


def test_a_file_of_runs_has_a_column_a_variable(known: Interface, tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    path.write_text("phi_start:deg,solver.method,gamma\n90,SDIRK4,0\n\n  \n10,3,1e-3\n90,7,0\n", "utf-8-sig")
    names, count, runs = of_file(path, known)
    assert names == ("phi_start", "solver.method", "gamma")
    assert list(runs()) == [(90 / 57.29577951308232, 7.0, 0.0), (10 / 57.29577951308232, 3.0, 1e-3)]
    assert count == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "the runs are either axes"),
        (["m=1", "--runs", "x.csv"], "the runs are either axes"),
        (["m"], "'m' is no axis (allowed: NAME=START:STOP:COUNT"),
        (["m=1:2:3:kg:5"], "m=1:2:3:kg:5 is no axis"),
        (["m=log:1:2"], "m=log:1:2 is no axis"),
        (["mass=1"], "the FMU has no variable 'mass' (allowed: m, L, gamma,"),
        (["phi=1"], "phi is an output and cannot be set"),
        (["solver.nfev=1"], "solver.nfev is a local and cannot be set"),
        (["phi_start=1:2:3:grad"], "phi_start: the FMU does not know the unit 'grad' (allowed: rad, deg)"),
        (["solver.method=3:rad"], "solver.method: the FMU does not know the unit 'rad' (allowed: none)"),
        (["solver.method=RK4"], "solver.method = 'RK4': must be a number or one of ExplicitEuler, "),
        (["solver.method=1:2:3"], "solver.method = 1.5: must be a whole number or one of ExplicitEuler"),
        (["m=1:2:0"], "m: the count is 0 (allowed: a whole number from 1 to 1000000)"),
        (["m=1:2:1000000000"], "m: the count is 1000000000 (allowed: a whole number from 1 to 1000000)"),
        (["m=1:2:10001", "L=1:2:10000"], "the axes make 100010000 runs (allowed: up to 100000000)"),
        (["m=1:2:2.5"], "m: the count is 2.5"),
        (["m="], "m=: the list is empty"),
        (["m=1,,2"], "m = '': must be a number"),
        (["m=1,nan"], "m = nan: must be finite"),
        (["m=inf:1:2"], "m = inf: must be finite"),
        (["gamma=log:-1:1:3"], "gamma: log:-1:1 has no logarithm (allowed: > 0)"),
        (["gamma=log:1:0:3"], "gamma: log:1:0 has no logarithm (allowed: > 0)"),
        (["m=1", "L=2", "m=3"], "m stands 2 times (allowed: once)"),
        (["--runs", "missing.csv"], "missing.csv cannot be read: No such file or directory"),
        (["--runs", "names.csv"], "names.csv has no runs"),
        (["--runs", "blank.csv"], "blank.csv has no runs"),
        (["--runs", "short.csv"], "short.csv, line 3: 1 values for 2 names"),
        (["--runs", "word.csv"], "word.csv, line 2: L = 'long': must be a number"),
        (["--runs", "twice.csv"], "m stands 2 times"),
        (["m=1", "--output", "rows.xlsx"], "--output rows.xlsx: must end in .csv or .parquet"),
        (["m=1", "--output", "nowhere/rows.csv"], "--output nowhere/rows.csv: nowhere is no directory"),
        (["m=1", "--output", "a\nb/rows.csv"], r"--output a\nb/rows.csv: a\nb is no directory"),
        (["m=1", "--output", "rows.trajectories.csv"], "must not end in .trajectories.csv"),
        (["m=1", "--output", f"{'x' * 300}.csv"], ".csv.lock: File name too long"),
        (["m=1", "--output", "names.csv"], "names.csv is there already (--resume goes on with it)"),
        (["m=1", "--output", "names.csv", "--resume"], "names.csv has other columns: m, L"),
        (["m=1", "--output", "empty.csv", "--resume"], "empty.csv has other columns: none"),
        (["m=1", "--output", "folder.csv", "--resume"], "folder.csv cannot be read: Is a directory"),
        (["m=1", "--output", "latin.csv", "--resume"], "latin.csv cannot be read: 'utf-8' codec"),
        (["m=1", "--fmu", "missing.fmu"], "missing.fmu does not exist"),
        (["m=1", "--stop-time", "0"], "--stop-time 0: must be finite and > 0"),
        (["m=1", "--output-interval", "nan"], "--output-interval nan: must be finite and > 0"),
        (
            ["m=1", "--output-interval", "1e-9"],
            "--output-interval 1e-09: 1e+10 steps a run (allowed: up to 1e+08)",
        ),
        (["m=1", "--stop-time", "0.7", "--output-interval", "0.3"], "(the nearest that does: 0.35)"),
        (
            ["m=1", "--stop-time", "1", "--output-interval", "5"],
            "--output-interval 5 does not divide --stop-time 1 (the nearest that does: 1.0)",
        ),
        (["m=1", "--record", "phi,m"], "--record: 'm' is no output (allowed: phi, w, a, E)"),
        (["m=1", "--jobs", "0"], "--jobs 0: must be > 0"),
        (["m=1", "--scheduler", "foo://bar"], "--scheduler foo://bar: unknown address scheme 'foo'"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(
    arguments: list[str],
    words: str,
    native_path: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    # In this process, because a Python of its own for each would take a minute.
    monkeypatch.chdir(tmp_path)
    for name, text in (
        ("names.csv", "m,L\n"),
        ("blank.csv", "m,L\n\n \n"),
        ("empty.csv", ""),
        ("short.csv", "m,L\n1,2\n3\n"),
        ("word.csv", "m,L\n1,long\n"),
        ("twice.csv", "m,m\n1,2\n"),
    ):
        Path(name).write_text(text, "utf-8")
    Path("latin.csv").write_bytes(b"\xe4\n")
    Path("folder.csv").mkdir()
    before = sorted(tmp_path.iterdir())
    with pytest.raises(SystemExit) as exit:
        command.main(["--fmu", str(native_path), *arguments])
    said = capsys.readouterr().err
    assert exit.value.code == 2
    assert words in said
    assert len(said.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--output", "rows.parquet"], "--output rows.parquet needs pyarrow: pip install '.[sweep]'"),
        (["--scheduler", "tcp://127.0.0.1:1"], "--scheduler needs dask.distributed: pip install '.[sweep]'"),
    ],
)
def test_what_is_not_installed_is_named(
    arguments: list[str],
    words: str,
    native_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(command, "find_spec", without("distributed", "pyarrow"))
    with pytest.raises(SystemExit) as exit:
        command.main(["--fmu", str(native_path), "m=1", *arguments])
    assert exit.value.code == 2
    assert words in capsys.readouterr().err


def without(*modules: str) -> Callable[[str], Any]:
    """Return the find_spec of a Python where `modules` are not installed."""
    return lambda name: None if name in modules else find_spec(name)


# What a row holds


def row(fmu: Fmu, known: Interface, *axes: str, stop: float = 10.0, series: bool = False) -> Row:
    """Return the row of a single run."""
    names, _, runs = of_axes([axis(text, known) for text in axes])
    (values,) = runs()
    return run(fmu, Common(known, names, stop, 0.1, series=series), values)[0]


def test_a_row_has_the_numbers_of_a_run(fmu: Fmu, known: Interface) -> None:
    found = row(fmu, known, "phi_start=1", "tau=0.5", "solver.method=SDIRK4", "solver.stepSize=0.02")
    start = {"phi_start": 1.0, "tau": 0.5, "solver.method": 7, "solver.stepSize": 0.02}
    expected = fmu.run(Experiment(10.0, 0.1, start, record=("phi", "w", "a", "E")))
    assert {name: found[name] for name in ("phi", "w", "a", "E")} == {
        name: expected[name][-1] for name in ("phi", "w", "a", "E")
    }
    assert found["solver.nfev"] == expected.nfev
    assert found["solver.method"] == "SDIRK4"
    assert (found["m"], found["gamma"], found["tau"]) == (1.0, 0.002, 0.5)
    assert (found["stop_time"], found["output_interval"]) == (10.0, 0.1)
    assert found["fmu"] == known.guid
    assert (found["failure"], found["warnings"]) == (None, None)
    assert isinstance(found["seconds"], float)
    assert found["seconds"] > 0


def test_a_failure_is_the_sentence_of_the_fmu_on_either_carrier(
    fmu: Fmu, known: Interface, builds: Builds
) -> None:
    with Fmu(builds.path(PENDULUM.name, "pythonfmu")) as other:
        for axis, words in (("gamma=-1", "cannot initialize"), ("gamma=1e6", "diverged at t = ")):
            found = [str(row(one, known, axis)["failure"]) for one in (other, fmu)]
            assert found[0].startswith(f"DampedPendulum: {words}")
            assert found[0].replace("DampedPendulum:", "DampedPendulumNative:") == found[1]


def test_a_run_that_fails_is_a_row_with_the_sentence_of_the_fmu(fmu: Fmu, known: Interface) -> None:
    failed = row(fmu, known, "gamma=-1")
    assert "gamma = -1.0 N.s/m (allowed: >= 0)" in str(failed["failure"])
    assert [failed[name] for name in ("phi", "w", "a", "E", "error")] == [None] * 5
    assert failed["reference"] is None
    assert row(fmu, known, "gamma=0")["failure"] is None


def test_a_run_that_diverges_says_so_and_a_warning_is_kept(fmu: Fmu, known: Interface) -> None:
    diverged = row(fmu, known, "gamma=1e6")
    assert "diverged" in str(diverged["failure"])
    assert "solver.stepSize" in str(diverged["warnings"])


def test_outputs_that_are_no_numbers_are_a_failure(
    fmu: Fmu, known: Interface, monkeypatch: pytest.MonkeyPatch
) -> None:
    healthy = fmu.run

    def silent(experiment: Experiment) -> Any:
        done = healthy(experiment)
        done.columns["w"][-1] = nan
        return done

    monkeypatch.setattr(fmu, "run", silent)
    found = row(fmu, known, "gamma=0")
    assert "not finite" in str(found["failure"])
    assert found["phi"] is None


@pytest.mark.parametrize("method", ["ExplicitRungeKutta4", "ImplicitTrapezoid", "TRBDF2"])
def test_the_error_is_that_of_the_discrete_motion(fmu: Fmu, known: Interface, method: str) -> None:
    h = 0.05
    found = row(fmu, known, "gamma=0", "phi_start=1", f"solver.method={method}", f"solver.stepSize={h}")
    phi, w = discrete.motion(method, [0.0, 10.0], 1.0, 0.0, 0.0, W02, h)
    exact = references.motion(10.0, 1.0, 0.0, W02)
    predicted = hypot(phi[-1] - exact[0], (w[-1] - exact[1]) / W0)
    assert found["reference"] == "elliptic"
    # 200 substeps and the phase w0*t are rounded; the phase is 31 rad and its error grows with the time.
    assert found["error"] == pytest.approx(predicted, rel=0, abs=200 * 4 * EPS * W0 * 10)
    assert predicted > 1e-6


def test_the_error_of_a_small_swing_is_that_of_the_linear_motion(fmu: Fmu, known: Interface) -> None:
    h, k2 = 0.1, 0.5
    found = row(fmu, known, f"gamma={k2}", "phi_start=1e-9", f"solver.stepSize={h}", stop=1.0)
    exact = references.free_evolution(1.0, 1e-9, 0.0, k2, W02)
    predicted = np.hypot(*(x / scale for x, scale in zip(_rk4(h, 10, k2, exact), (1.0, W0), strict=True)))
    assert found["reference"] == "linear"
    assert found["error"] == pytest.approx(predicted, rel=1e-6, abs=0)  # ten roundings against errors of 1e-4


def _rk4(h: float, n: int, k2: float, exact: references.State) -> np.ndarray:
    """Return what n steps of RK4 from (1e-9, 0) are off by, by the matrix of a step."""
    A = h * np.array([[0.0, 1.0], [-W02, -k2]])
    step = sum((np.linalg.matrix_power(A, j) / f for j, f in enumerate((1, 1, 2, 6, 24))), np.zeros((2, 2)))
    return np.linalg.matrix_power(step, n) @ [1e-9, 0.0] - np.array(exact)


@pytest.mark.parametrize("axes", [("gamma=0.5",), ("gamma=0", "tau=0.5"), ("gamma=0", "g=-3"), ("g=0",)])
def test_where_no_closed_form_is_known_there_is_an_error_only_for_the_asking(
    fmu: Fmu, known: Interface, axes: Sequence[str]
) -> None:
    axes = (*axes, "phi_start=1", "w_start=0.1", "solver.method=TaylorSeries", "solver.stepSize=0.01")
    without, with_series = (row(fmu, known, *axes, stop=2.0, series=series) for series in (False, True))
    assert (without["reference"], without["error"]) == (None, None)
    assert with_series["reference"] == "series"
    error = with_series["error"]
    assert isinstance(error, float)
    # Two hundred Taylor steps that are right to rounding; exp(w0*t) is what instability can make of one.
    assert error < 200 * 4 * EPS * np.exp(sqrt(3) * 2)
    given = {name: with_series[name] for name in ("phi_start", "w_start", "gamma", "g", "tau")}
    phi, w = taylor_series.motion([0.0, 2.0], *(float(given[name]) for name in given))  # type: ignore[arg-type]
    w0 = sqrt(abs(given["g"]) or 1.0)  # type: ignore[arg-type]
    assert error == hypot(with_series["phi"] - phi[-1], (with_series["w"] - w[-1]) / w0)  # type: ignore[operator]


@pytest.mark.parametrize(
    "axes", [("gamma=1e9",), ("phi_start=1e6", "gamma=0.5"), ("w_start=1e200", "gamma=0")]
)
def test_beyond_what_a_reference_can_reach_there_is_none(
    fmu: Fmu, known: Interface, axes: Sequence[str]
) -> None:
    found = row(fmu, known, *axes, "solver.method=SDIRK4", "solver.stepSize=1", series=True)
    assert (found["reference"], found["error"]) == (None, None)


def test_a_run_is_known_by_its_parameters_and_not_by_the_axes_that_gave_them(known: Interface) -> None:
    few = Common(known, ("phi_start",), 10.0, 0.1)
    many = Common(known, ("gamma", "phi_start"), 10.0, 0.1)
    assert few.identity((1.0,)) == many.identity((0.002, 1.0))
    others = (
        few.identity((1.0 + EPS,)),
        many.identity((0.003, 1.0)),
        Common(known, ("phi_start",), 10.0, 0.2).identity((1.0,)),
        Common(known, ("phi_start",), 9.0, 0.1).identity((1.0,)),
        Common(known, ("phi_start",), 10.0, 0.1, series=True).identity((1.0,)),
    )
    assert few.identity((1.0,)) not in others


# Files


@pytest.fixture
def sweep(
    native_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    """Return the command without Dask, which gives its status and what it says."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "find_spec", without("distributed"))

    def run_it(*arguments: str) -> tuple[int, str]:
        capsys.readouterr()
        status = command.main(
            ["--fmu", str(native_path), "--stop-time", "1", "--output-interval", "0.1", *arguments]
        )
        return status, capsys.readouterr().out

    return run_it


AXES = ("phi_start=0:1:5", "gamma=-1,0,0.002")
Sweep = Callable[..., tuple[int, str]]


def same(rows: Sequence[dict[str, Any]], others: Sequence[dict[str, Any]]) -> bool:
    """Return whether two sweeps gave the same, but for their times."""
    return [{k: v for k, v in r.items() if k != "seconds"} for r in rows] == [
        {k: v for k, v in r.items() if k != "seconds"} for r in others
    ]


@needs_pyarrow
def test_csv_and_parquet_hold_the_same_numbers(sweep: Sweep) -> None:
    for name in ("rows.csv", "rows.parquet"):
        assert sweep(*AXES, "--output", name, "--record", "phi,E")[0] == 0
    text, binary = rows_of(Path("rows.csv")), rows_of(Path("rows.parquet"))
    assert len(text) == 15
    assert [type(value) for value in binary[1].values()][1:5] == [float] * 4
    assert same(text, binary)
    assert list(text[0]) == list(binary[0])
    assert rows_of(Path("rows.trajectories.csv")) == rows_of(Path("rows.trajectories.parquet"))


def test_trajectories_are_those_of_the_runs(sweep: Sweep, fmu: Fmu) -> None:
    sweep(*AXES, "--output", "rows.csv", "--record", "w")
    samples = rows_of(Path("rows.trajectories.csv"))
    for one in rows_of(Path("rows.csv")):
        start = {name: one[name] for name in ("phi_start", "gamma")}
        expected = fmu.run(Experiment(1.0, 0.1, start, record=("w",)))
        found = [(sample["time"], sample["w"]) for sample in samples if sample["run"] == one["run"]]
        assert found == ([] if one["failure"] else list(zip(expected.t, expected["w"], strict=True)))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_resume_runs_what_is_not_there(sweep: Sweep, suffix: str) -> None:
    output = f"rows.{suffix}"
    sweep(*AXES, "--output", "whole.csv")
    sweep(AXES[0], "gamma=0", "--output", output)
    first = rows_of(Path(output))
    status, said = sweep(*AXES, "--output", output, "--resume")
    assert status == 0
    assert "10 of 15 runs (5 failed, 0 with a warning), 5 were there" in said
    rows = rows_of(Path(output))
    assert rows[:5] == first
    assert {one["run"] for one in rows} == {one["run"] for one in rows_of(Path("whole.csv"))}
    assert len(rows) == 15
    assert "0 of 15 runs" in sweep(*AXES, "--output", output, "--resume")[1]
    assert rows_of(Path(output)) == rows
    assert {path.name for path in Path().iterdir()} == {"whole.csv", output}


def test_what_was_recorded_is_recorded_on(sweep: Sweep, capsys: pytest.CaptureFixture[str]) -> None:
    sweep("gamma=0", "--output", "with.csv", "--record", "phi")
    sweep("gamma=0", "--output", "without.csv")
    for arguments, words in (
        (["without.csv", "--record", "phi"], "without.csv was written without --record"),
        (["with.csv"], "with.csv was written with --record"),
        (["with.csv", "--record", "w"], "with.trajectories.csv has other columns: run, time, phi"),
    ):
        with pytest.raises(SystemExit):
            sweep("gamma=1", "--resume", "--output", *arguments)
        assert words in capsys.readouterr().err


def refused(sweep: Sweep, capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the line that a sweep is refused with, which leaves everything as it was."""
    before = {path: path.is_file() and path.read_bytes() for path in Path().rglob("*")}
    with pytest.raises(SystemExit) as exit:
        sweep(*arguments)
    (*_, said) = capsys.readouterr().err.splitlines()
    assert exit.value.code == 2
    assert {path: path.is_file() and path.read_bytes() for path in Path().rglob("*")} == before
    return said


def test_a_csv_file_that_is_torn_is_not_resumed(sweep: Sweep, capsys: pytest.CaptureFixture[str]) -> None:
    sweep("gamma=0,1", "--output", "rows.csv", "--record", "phi")
    rows, samples = Path("rows.csv"), Path("rows.trajectories.csv")
    whole = {path: path.read_bytes() for path in (rows, samples)}
    resume = ("gamma=0,1", "--output", "rows.csv", "--record", "phi", "--resume")
    columns = len(whole[rows].split(b"\r\n", 1)[0].split(b","))
    for path, damage, words in (
        (rows, lambda text: text[:-5], "rows.csv cannot be read: its last line has no end"),
        (rows, lambda text: text[:-200] + b"\r\n", f"line 3 has another number of values than {columns}"),
        (rows, lambda text: text + b"\0\0\0\n", f"line 4 has another number of values than {columns}"),
        (samples, lambda text: text[:-5], "rows.trajectories.csv cannot be read: its last line has no end"),
    ):
        path.write_bytes(damage(whole[path]))
        assert words in refused(sweep, capsys, *resume)
        path.write_bytes(whole[path])
    rows.write_bytes(whole[rows] + b"\r\n")  # of an editor
    assert "0 of 2 runs" in sweep(*resume)[1]


@needs_pyarrow
def test_a_parquet_file_of_another_kind_is_not_resumed(
    sweep: Sweep, capsys: pytest.CaptureFixture[str]
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path, resume = Path("rows.parquet"), ("m=1,2", "--output", "rows.parquet", "--resume")
    path.write_text("junk\n", "utf-8")
    assert "rows.parquet cannot be read: " in refused(sweep, capsys, *resume)
    path.unlink()
    sweep("m=1", "--output", "rows.parquet")
    schema = pq.read_schema(path)
    integers = pa.schema([(name, pa.int64()) for name in schema.names])
    pq.write_table(pa.table({name: [1] for name in schema.names}, integers), path)
    assert "the values of run are int64 (allowed: string)" in refused(sweep, capsys, *resume)


@needs_pyarrow
def test_what_cannot_be_joined_ends_a_sweep_with_its_parts(
    sweep: Sweep, capsys: pytest.CaptureFixture[str], native_path: Path
) -> None:
    sweep("m=1", "--output", "rows.parquet", "--record", "phi")
    samples = Path("rows.trajectories.parquet")
    content = samples.read_bytes()
    samples.write_bytes(content[:8] + bytes(200) + content[208:])  # its end, which has the columns, is whole
    options = ("--fmu", str(native_path), "--stop-time", "1", "--output-interval", "0.1", "--record", "phi")
    assert command.main([*options, "m=1,2", "--output", "rows.parquet", "--resume"]) == 1
    said, complained = capsys.readouterr()
    assert said == ""
    assert "rows.trajectories.parquet cannot be read: " in complained.splitlines()[-1]
    assert len(rows_of(Path("rows.parquet.parts/rows-000001").rename("part.parquet"))) == 1


def test_trajectories_without_their_rows_are_no_sweep(
    sweep: Sweep, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("rows.trajectories.csv").write_text("run,time,phi\n", "utf-8")
    for record in ([], ["--record", "phi"]):
        said = refused(sweep, capsys, "m=1", "--output", "rows.csv", "--resume", *record)
        assert "rows.trajectories.csv is there without rows.csv" in said


def test_an_output_takes_one_sweep_at_a_time(sweep: Sweep, capsys: pytest.CaptureFixture[str]) -> None:
    with locked(Path("rows.csv")):
        for resume in ([], ["--resume"]):
            with pytest.raises(SystemExit) as exit:
                sweep("m=1", "--output", "rows.csv", *resume)
            assert exit.value.code == 2
            assert "rows.csv is in use by another sweep" in capsys.readouterr().err
    lock = Path("rows.csv.lock")
    with lock.open("ab") as file:
        lock.unlink()  # the sweep before ends while the next one opens its lock
        assert not _taken(file, lock)
        lock.touch()  # as a sweep that was killed leaves it
        assert not _taken(file, lock)
    assert sweep("m=1", "--output", "rows.csv")[0] == 0
    assert [path.name for path in Path().iterdir()] == ["rows.csv"]


@pytest.mark.skipif(sys.platform != "linux", reason="a process is given no cores of its own")
def test_the_cores_are_those_that_the_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5, 8})
    assert command._parser().parse_args([]).jobs == 3


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text")
def test_a_name_that_is_no_text_can_be_shown(sweep: Sweep) -> None:
    name = os.fsdecode(b"\xff.csv")
    assert sweep("m=1", "--output", name)[1].endswith(r"\udcff.csv" + "\n")
    assert len(rows_of(Path(name))) == 1


KILLED = """
import os, signal, sys
from importlib.util import find_spec
from validation.sweep import __main__ as command, files
add = files.Store.add
def last(self, *row):
    add(self, *row)
    if self._number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
files.ROWS, files.Store.add = 1, last
command.find_spec = lambda name: None if name == "distributed" else find_spec(name)
command.main(sys.argv[1:])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no signal ends a process without its help")
def test_a_sweep_that_is_killed_leaves_its_parts_and_a_lock_until_the_next(
    sweep: Sweep, native_path: Path
) -> None:
    options = ("--fmu", str(native_path), "--stop-time", "1", "--output-interval", "0.1", "--record", "phi")
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, *AXES, *options, "--output", "rows.csv"],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert {path.name for path in Path().iterdir()} == {"rows.csv.lock", "rows.csv.parts"}
    assert "13 of 15 runs" in sweep(*AXES, "--output", "rows.csv", "--record", "phi", "--resume")[1]
    assert {path.name for path in Path().iterdir()} == {"rows.csv", "rows.trajectories.csv"}


@pytest.mark.parametrize(
    ("folders", "files", "words"),
    [
        (["rows.csv.lock"], [], "cannot use rows.csv.lock: Is a directory"),
        ([], ["rows.csv.parts"], "cannot use rows.csv.parts/rows.partial: Not a directory"),
        ([], ["rows.csv.joined"], "cannot use rows.csv.joined"),
        (["rows.csv.parts", "rows.csv.parts/rows.partial"], [], "cannot use rows.csv.parts/rows.partial: "),
        (["rows.csv.parts", "rows.csv.parts/rows-000001"], [], "rows.csv.parts/rows-000001 cannot be read: "),
        (["rows.trajectories.csv"], [], "rows.trajectories.csv is there without rows.csv"),
    ],
)
def test_what_lies_in_the_way_is_named_before_anything_is_run(
    sweep: Sweep,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    folders: Sequence[str],
    files: Sequence[str],
    words: str,
) -> None:
    monkeypatch.setattr(command, "_sweep", None)
    for name in folders:
        Path(name).mkdir()
    for name in files:
        Path(name).touch()
    assert words in refused(sweep, capsys, "m=1", "--output", "rows.csv", "--resume")


@pytest.mark.parametrize("full_for", [1, 100])
def test_a_full_disk_ends_a_sweep_and_the_next_goes_on(
    sweep: Sweep,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    native_path: Path,
    full_for: int,
) -> None:
    left, text_files = iter(range(full_for)), cast(Any, FORMATS[".csv"])

    def write(*arguments: Any) -> None:
        if "rows.partial" in str(arguments[1]) and next(left, None) is not None:
            raise OSError(ENOSPC, "No space left on device")
        healthy(*arguments)

    healthy = text_files.write
    with monkeypatch.context() as patch:
        patch.setattr(text_files, "write", write)
        patch.setattr("validation.sweep.files.ROWS", 2)
        arguments = ("--fmu", str(native_path), "--stop-time", "1", "--output-interval", "0.1")
        status = command.main([*arguments, *AXES, "--output", "rows.csv", "--record", "phi"])
    said, complained = capsys.readouterr()
    assert (status, said) == (1, "")
    full = "rows.csv cannot be written: No space left on device; --resume goes on"
    assert complained.splitlines()[-1] == f"python -m validation.sweep: {full}"
    sweep(*AXES, "--output", "rows.csv", "--record", "phi", "--resume")
    sweep(*AXES, "--output", "whole.csv", "--record", "phi")
    for name in ("rows", "rows.trajectories"):
        assert same(rows_of(Path(f"{name}.csv")), rows_of(Path(f"{name.replace('rows', 'whole')}.csv")))


class KilledError(Exception):
    """Stands for the end of the process."""


def some_rows(fmu: Fmu, known: Interface) -> tuple[Common, list[tuple[Row, Trajectory | None]]]:
    names, _, runs = of_axes([axis("phi_start=0.1:1:6", known)])
    common = Common(known, names, 1.0, 0.1, ("phi",))
    return common, [run(fmu, common, values) for values in runs()]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_sweep_that_is_killed_at_any_time_has_each_row_once(
    fmu: Fmu, known: Interface, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    common, done = some_rows(fmu, known)
    kinds = columns(common)
    left = 0
    # The n-th change of a name is the last thing that the process does, before it or behind it.
    for n, before in product(range(1, 100), (True, False)):
        output = tmp_path / f"{n}{before}" / f"rows.{suffix}"
        output.parent.mkdir()
        changes = iter(range(1, 1000))

        def dies(
            rename: Callable[..., Any], n: int = n, before: bool = before, changes: Iterator[int] = changes
        ) -> Callable[..., Any]:
            def renamed(path: Path, target: Path) -> Any:
                ends = next(changes) == n
                if ends and before:
                    raise KilledError
                result = rename(path, target)
                if ends:
                    raise KilledError
                return result

            return renamed

        with monkeypatch.context() as patch:
            patch.setattr("validation.sweep.files.ROWS", 2)
            patch.setattr(Path, "replace", dies(Path.replace))
            patch.setattr(Path, "rename", dies(Path.rename))
            try:
                for part in (done[:4], done[4:]):
                    store = Store(output, kinds, common.record, resume=True)
                    for one, trajectory in part:
                        store.add(one, trajectory)
                    store.close()
                left = n
            except KilledError:
                pass
        if output.exists():
            rows_of(output)  # a whole file
        store = Store(output, kinds, common.record, resume=True)
        for one, trajectory in done:
            if one["run"] not in store.done:
                store.add(one, trajectory)
        store.close()
        runs = [one["run"] for one in rows_of(output)]
        assert sorted(runs) == sorted(str(one["run"]) for one, _ in done)
        samples = rows_of(output.with_name(f"rows.trajectories.{suffix}"))
        assert len(samples) == 11 * len(done)
        assert len({(sample["run"], sample["time"]) for sample in samples}) == len(samples)
        assert len(list(output.parent.iterdir())) == 2
        shutil.rmtree(output.parent)
        if left:
            break
    assert left > 12  # three parts of two files, joined twice


def test_an_interrupted_sweep_leaves_a_whole_file(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    executor_of = command._executor

    @contextmanager
    def interrupted(*arguments: Any) -> Iterator[Any]:
        def some(runs: Iterator[Any]) -> Iterator[Any]:
            for i, done in enumerate(executor(runs)):
                if i == 4:
                    signal.raise_signal(signal.SIGTERM)
                yield done

        with executor_of(*arguments) as executor:
            yield some
            signal.raise_signal(signal.SIGINT)  # of someone impatient, which must not cost the report

    with monkeypatch.context() as patch:
        patch.setattr(command, "_executor", interrupted)
        status, said = sweep(*AXES, "--output", "rows.csv")
    assert status == 130
    assert "4 of 15 runs" in said
    assert len(rows_of(Path("rows.csv"))) == 4
    assert sweep(*AXES, "--output", "rows.csv", "--resume")[0] == 0
    sweep(*AXES, "--output", "whole.csv")
    assert same(rows_of(Path("rows.csv")), rows_of(Path("whole.csv")))
