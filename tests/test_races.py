"""Races are judged by an interval, once, by the command; the tests read no clock."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle
from math import comb, isnan, nan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from validation import races, studies, work_precision
from validation.__main__ import main
from validation.checks import Check, Note, Result
from validation.fmu import Fmu

ROOT = Path(__file__).resolve().parent.parent
TESTS = sorted([*(ROOT / "tests").glob("*.py"), *(ROOT / "validation").glob("test_*.py")])


# No clock in the tests


def clocks(path: Path) -> set[str]:
    """Return what a test module uses of the modules that read or wait for a clock."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in ("time", "timeit", "datetime")}
        elif isinstance(node, ast.ImportFrom) and node.module in ("time", "timeit", "datetime"):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute) and node.attr in (
            "seconds",
            "perf_counter",
            "process_time",
            "thread_time",
        ):
            found.add(node.attr)
    return found


@pytest.mark.parametrize("path", TESTS, ids=lambda path: path.stem)
def test_a_test_reads_no_clock(path: Path) -> None:
    assert clocks(path) <= ({"seconds"} if path == Path(__file__) else set())


def test_a_clock_would_be_found(tmp_path: Path) -> None:
    for text in ("from time import perf_counter", "import time", "x.seconds", "time.perf_counter()"):
        (tmp_path / "x.py").write_text(text, "utf-8")
        assert clocks(tmp_path / "x.py")


def test_hypothesis_reads_no_clock_either() -> None:
    assert settings.default is not None
    assert settings.default.deadline is None
    assert HealthCheck.too_slow in settings.default.suppress_health_check


# The interval of a median


@pytest.mark.parametrize("n", [6, 7, 15, 21, 22, 41, 100])
def test_the_interval_of_the_median_is_the_shortest_with_its_probability(n: int) -> None:
    def inside(k: int) -> Fraction:
        # The median lies outside if fewer than k of n fair coins show heads, or fewer than k tails.
        return 1 - 2 * Fraction(sum(comb(n, i) for i in range(k)), 2**n)

    k = races.interval_rank(n)
    assert inside(k) >= Fraction(95, 100) > inside(k + 1)


def test_too_few_rounds_have_no_interval_and_prove_nothing() -> None:
    few = races.ratio([100.0] * 5, [1.0] * 5)
    assert few.median == 100.0
    assert isnan(few.low)
    assert not races.at_least("faster", few, 2.0, "").holds
    assert not races.at_most("not slower", races.ratio([0.1] * 5, [1.0] * 5), 2.0, "").holds


def test_a_race_has_enough_rounds() -> None:
    assert races.ROUNDS >= 15
    assert races.interval_rank(races.ROUNDS) >= 1


def test_the_ends_of_the_interval_are_quotients_of_rounds() -> None:
    n = 21
    slow = [2.0 + 0.01 * i for i in range(n)]
    measured = races.ratio(slow, [1.0] * n)
    k = races.interval_rank(n)
    assert (measured.low, measured.median, measured.high) == (slow[k - 1], slow[10], slow[n - k])


# Races and their rows


def test_the_step_of_a_clock_is_the_least_that_it_makes() -> None:
    ticks = iter([0.0, 0.0, 0.5, 0.5, 0.5, 0.75, *(float(i) for i in range(1, 100))])
    assert races.granularity(lambda: next(ticks)) == 0.25


def runner(times: list[float]) -> Callable[[], float]:
    endless = cycle(times)
    return lambda: next(endless)


def test_all_run_in_every_round_as_long_as_is_asked_for_and_take_turns_in_beginning() -> None:
    order = []

    def logged(name: str, seconds: float) -> Callable[[], float]:
        def run() -> float:
            order.append(name)
            return seconds

        return run

    times = races.race({"short": logged("short", 1.0), "long": logged("long", 4.0)}, rounds=2, spend=3.0)
    assert times == {"short": [1.0] * 2, "long": [4.0] * 2}
    assert order == ["short"] * 3 + ["long"] + ["long"] + ["short"] * 3


def test_what_slows_a_few_rounds_down_does_not_move_a_ratio() -> None:
    busy = [9.0 if i % 5 == 0 else 3.0 for i in range(21)]
    times = races.race({"slow": runner(busy), "fast": runner([1.0])}, spend=0.0)
    measured = races.ratio(times["slow"], times["fast"])
    assert (measured.low, measured.median, measured.high) == (3.0, 3.0, 3.0)


def test_a_claim_holds_only_if_the_whole_interval_does() -> None:
    noisy = races.Ratio(2.5, 1.9, 3.0, 21)
    faster, slower = races.at_least("", noisy, 2.0, "why"), races.at_most("", noisy, 2.9, "why")
    assert not faster.holds
    assert not slower.holds
    assert "why; median 2.5, 95 percent interval 1.9 to 3 of 21 rounds; undecided" in faster.reason
    assert races.at_least("", noisy, 1.9, "").holds
    assert races.at_most("", noisy, 3.0, "").holds
    lost = races.at_least("", noisy, 4.0, "")
    assert not lost.holds
    assert "undecided" not in lost.reason


def test_a_race_that_could_not_be_run_says_so_and_does_not_hold() -> None:
    row = races.not_measured("faster", 2.0, "no solver reaches it")
    assert not row.holds
    assert row.reason == "not measured: no solver reaches it"


# The command judges them


@dataclass(frozen=True)
class FakeScene:
    name: str = "a race"
    slow: bool = False


@pytest.mark.parametrize(("low", "status"), [(2.1, 0), (1.9, 1), (nan, 1)])
def test_the_command_fails_with_a_race(
    fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, low: float, status: int
) -> None:
    def run(fmu: Fmu, scene: Any) -> Iterator[Result]:
        yield races.at_least("time: the race", races.Ratio(3.0, low, 4.0, 21), 2.0, "because")

    monkeypatch.setattr(work_precision, "SCENES", ())
    monkeypatch.setattr(work_precision, "RACES", (FakeScene(),))
    monkeypatch.setattr(work_precision, "run", run)
    arguments = ["work_precision", "--fmu", str(fmu_path), "--no-plots", "--output", str(tmp_path)]
    assert main(arguments) == status
    assert "time: the race" in (tmp_path / "index.html").read_text("utf-8")


def test_rows_of_time_come_from_races_alone() -> None:
    names = {scene.name for name in studies.NAMES for scene in studies.load(name).races}
    assert names == {scene.name for scene in work_precision.RACES}
    assert not names & {scene.name for name in studies.NAMES for scene in studies.load(name).scenes}


on_native = pytest.mark.parametrize("carrier", ["native"], indirect=True, scope="session")


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Races of a single round: all of their code runs, and nothing is claimed."""
    monkeypatch.setattr(races, "ROUNDS", 1)
    monkeypatch.setattr(races, "SPEND", 0.0)


@on_native
@pytest.mark.usefixtures("hurried", "carrier")
def test_the_race_of_substeps_has_all_its_rows_if_both_carriers_are_there(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        rows = list(work_precision.run(fmu, work_precision.SubstepScene()))
    assert [type(row) for row in rows] == [Check] * 4
    assert {row.bound for row in rows if isinstance(row, Check)} == {1.4, 1.25, 10.0, 7.0}


@on_native
@pytest.mark.usefixtures("hurried", "carrier")
def test_what_is_left_out_of_the_races_is_said(
    fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = tmp_path / fmu_path.name
    alone.write_bytes(fmu_path.read_bytes())
    monkeypatch.setenv("PATH", str(tmp_path))
    with Fmu(alone) as fmu:
        rows = list(work_precision.run(fmu, work_precision.SubstepScene()))
    notes = [row.text for row in rows if isinstance(row, Note)]
    assert len(notes) == len(rows) == 2
    assert "Left out: the races with the other carrier, because there is no" in notes[0]
    assert "Left out: the race of the native FMU against a bare loop in C: no C compiler" in notes[1]


@pytest.mark.slow
@pytest.mark.usefixtures("hurried")
def test_the_race_against_scipy_has_a_row_for_every_error(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        rows = list(work_precision.run(fmu, work_precision.RatioScene()))
    assert sum(isinstance(row, Check) for row in rows) == len(work_precision.FASTER_AT)


def test_a_race_that_no_solver_finishes_is_a_row_that_does_not_hold(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        row = work_precision._faster(fmu, 1e-9, 1e-3, ("none", nan), None)
    assert not row.holds
    assert "no solver of solve_ivp reaches this error" in row.reason
