"""Races are judged by an interval, once, by the command; the tests read no clock."""

import ast
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import cycle
from math import comb, isnan, nan
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from validation import loops, races, studies
from validation.__main__ import main
from validation.checks import Check, Note, Result, Table
from validation.fmu import Fmu, SolverMethod
from validation.race import calls, contest, judging
from validation.race.judging import GROUPS, OURS
from validation.race.scenes import EXTREME
from validation.report import page
from validation.report.section import Section
from validation.studies import work_precision

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
    low: float
    name: str = "a race"
    slow: bool = False

    def run(self, fmu: Fmu) -> Iterator[Result]:
        yield races.at_least("time: the race", races.Ratio(3.0, self.low, 4.0, 21), 2.0, "because")


@pytest.mark.parametrize(("low", "status"), [(2.1, 0), (1.9, 1), (nan, 1)])
def test_the_command_fails_with_a_race(
    fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, low: float, status: int
) -> None:
    monkeypatch.setattr(work_precision, "SCENES", ())
    monkeypatch.setattr(work_precision, "RACES", (FakeScene(low),))
    arguments = [
        "work_precision",
        "--fmu",
        str(fmu_path),
        "--no-plots",
        "--no-faults",
        "--output",
        str(tmp_path),
    ]
    assert main(arguments) == status
    assert "time: the race" in (tmp_path / "index.html").read_text("utf-8")


def test_a_scene_is_a_race_or_none() -> None:
    assert [name for name in studies.NAMES if studies.load(name).races] == ["work_precision", "atlas"]
    for name in studies.NAMES:
        study = studies.load(name)
        assert not {scene.name for scene in study.races} & {scene.name for scene in study.scenes}


on_native = pytest.mark.parametrize("carrier", ["native"], indirect=True, scope="session")


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Races of a single round: all of their code runs, and nothing is claimed."""
    for module, name in ((races, "ROUNDS"), (contest, "ROUNDS"), (calls, "MANY")):
        monkeypatch.setattr(module, name, 1)
    for module in (races, calls):
        monkeypatch.setattr(module, "SPEND", 0.0)
    monkeypatch.setattr(judging, "SPEND", {False: 0.0, True: 0.0})


@on_native
@pytest.mark.usefixtures("hurried", "carrier", "carriers")
def test_the_race_of_substeps_has_all_its_rows_if_both_carriers_are_there(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        rows = [row for row in calls.substeps(fmu) if isinstance(row, Check)]
    of_loops, of_carriers = 2 * len(SolverMethod), len(calls.EXPLICIT) + 1
    assert len({row.name for row in rows}) == len(rows) == of_loops + of_carriers
    assert {row.bound for row in rows} == {1.4, 1.25, 10.0, 7.0}


@on_native
@pytest.mark.usefixtures("hurried", "carrier")
def test_what_is_left_out_of_the_races_is_said(
    fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alone = tmp_path / fmu_path.name
    alone.write_bytes(fmu_path.read_bytes())
    monkeypatch.setenv("PATH", str(tmp_path))
    loops.c_loops.cache_clear()
    with Fmu(alone) as fmu:
        notes = [row.text for row in calls.substeps(fmu) if isinstance(row, Note)]
    assert len(notes) == 2
    assert "Left out: the races with the other carrier, because there is no" in notes[0]
    assert "Left out: the race of the native FMU against a bare loop in C: no C compiler" in notes[1]


@pytest.mark.slow
@pytest.mark.usefixtures("hurried")
def test_a_race_has_a_row_for_every_error_and_a_file_of_all_runs(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        results = list(work_precision.RaceScene(EXTREME).run(fmu))
    fastest, everything = (result for result in results if isinstance(result, Table))
    assert [row[0] for row in fastest.rows] == [f"{error:.0e}" for error in EXTREME.targets]
    assert (fastest.shown, everything.shown) == (True, False)
    assert {row[0] for row in everything.rows} == {*OURS, *GROUPS[False]["solve_ivp"], "odeint"}
    assert {"CPU", "date", "commit", "numpy"} <= {name for name, _ in everything.head}


def test_a_goal_that_nobody_measured_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_precision, "rivals", lambda native: ((), ("heyoka is left out",)))
    row = work_precision.against_heyoka.__wrapped__(None)
    assert not row.holds
    assert "pip install '.[peers]'" in row.reason
    assert (row.bound, row.at_least) == (1.0, True)


def test_a_table_that_is_not_shown_is_in_its_file_with_its_head(fmu_path: Path, tmp_path: Path) -> None:
    table = Table("All runs", ("seconds",), [(1.5,)], shown=False, head=(("CPU", "a fast one"),))
    written = page.write([Section("study", "", "", [table])], tmp_path, fmu_path, None)
    assert "All runs" not in written.read_text("utf-8")
    file = tmp_path / "study-all-runs.csv"
    assert file.read_text("utf-8").splitlines() == ["# CPU: a fast one", "seconds", "1.5"]
