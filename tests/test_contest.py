"""How solvers are fitted to errors and compared: with solvers whose errors and times are known."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import inf, isnan, nan, sin

import numpy as np
import pytest

from validation import references
from validation.fmu import W0, W02, Fmu, SolverMethod
from validation.race import calls, contest, judging
from validation.race.contest import Errors, Race, Rung
from validation.race.judging import Goal, compare, why_not
from validation.race.rivals import PYTHON_RIVALS, Outcome, Run, Solver
from validation.race.scenes import DAMPED, PULSE, SCENES, TRAIN, UNDAMPED, Scene, exact
from validation.styles import STYLES

SCENE = replace(UNDAMPED[0], name="a scene of the tests", targets=(1e-2, 1e-4))


def outcome(error: float, seconds: float, evaluations: float = nan, failure: str = "") -> Outcome:
    phi, w = exact(SCENE)
    return Outcome(seconds, phi + error, w, evaluations, failure)


def solver(
    name: str,
    error: Callable[[float], float],
    seconds: Callable[[float], float],
    knobs: tuple[float, ...],
    evaluations: Callable[[float], float] = lambda knob: nan,
    failure: str = "",
    counts_substeps: bool = False,
) -> Solver:
    def prepare(scene: Scene, knob: float, cut_off: float) -> Run:
        return lambda: outcome(error(knob), seconds(knob), evaluations(knob), failure)

    return Solver(name, name, knobs, prepare, counts_substeps, cut_off=1.0)


POWERS = tuple(2**k for k in range(12))
second_order = partial(
    solver, error=lambda n: n**-2, seconds=lambda n: 1e-3 * n, knobs=POWERS, counts_substeps=True
)


def test_the_error_that_counts_is_the_largest_on_the_grid() -> None:
    phi, w = exact(SCENE)
    off = np.zeros_like(phi)
    off[3], off[-1] = 4e-3, 3e-3
    errors = contest.errors(SCENE, Outcome(0.0, phi + off, w, nan))
    # phi + off is rounded to a unit of 0.5 rad, 1e-16: a relative 4e-14 of 3e-3.
    assert errors.largest == pytest.approx(4e-3, rel=1e-13, abs=0)
    assert errors.final == pytest.approx(3e-3, rel=1e-13, abs=0)
    assert errors.rms == pytest.approx(5e-3 / len(phi) ** 0.5, rel=1e-13, abs=0)


def test_a_motion_that_is_late_has_an_error_of_the_period_and_none_of_the_energy() -> None:
    late = 1e-6
    phi, w = references.motion(np.array(SCENE.grid) - late, SCENE.phi0, 0.0, W02)
    errors = contest.errors(SCENE, Outcome(0.0, phi, w, nan))
    # The next term is late*a/w, less than 10*late*w0 where w is not small; of the energy, those of the functions.
    assert errors.period == pytest.approx(late / SCENE.stop, rel=10 * late * W0, abs=0)
    assert errors.energy <= 1e-13


def test_a_change_of_the_energy_is_the_largest_relative_one() -> None:
    phi, w = exact(SCENE)
    faster = w.copy()
    faster[3] *= 1 + 1e-6
    kinetic = w[3] ** 2 / 2 / (2 * W02 * sin(SCENE.phi0 / 2) ** 2)
    errors = contest.errors(SCENE, Outcome(0.0, phi, faster, nan))
    assert errors.energy == pytest.approx(2e-6 * kinetic, rel=1e-6, abs=0)
    assert errors.period == 0.0


@pytest.mark.parametrize("scene", [DAMPED, PULSE, TRAIN], ids=lambda scene: scene.name)
def test_where_the_energy_changes_it_has_no_error(scene: Scene) -> None:
    errors = contest.errors(scene, Outcome(0.0, *exact(scene), nan))
    assert errors.largest == 0.0
    assert isnan(errors.energy)
    assert isnan(errors.period)


@pytest.mark.parametrize("failed", [outcome(0.0, 1.0, failure="diverged"), outcome(nan, 1.0)])
def test_a_run_that_failed_or_is_no_number_reaches_nothing(failed: Outcome) -> None:
    assert isnan(contest.errors(SCENE, failed).largest)
    lost = solver("lost", lambda _: nan, lambda _: 0.1, (1e-3, 1e-4))
    assert contest.fitted(lost, SCENE, 1e-2) is None


def test_a_run_that_ends_early_reaches_nothing() -> None:
    phi, w = exact(SCENE)
    assert isnan(contest.errors(SCENE, Outcome(0.0, phi[:-1], w[:-1], nan)).largest)


def test_a_method_is_fitted_with_the_fewest_substeps_that_reach_the_error() -> None:
    found = contest.fitted(second_order("order 2"), SCENE, 1e-4)
    assert found is not None
    assert 100 <= found.knob <= 100 * (1 + contest.FINENESS) + 1
    assert found.errors.largest <= 1e-4


def test_a_rival_is_fitted_by_its_evaluations_not_by_a_time() -> None:
    by_knob = {1e-3: (1e-3, 50.0), 1e-4: (1e-5, 30.0), 1e-5: (1e-5, 40.0)}
    rival = solver(
        "rival",
        lambda knob: by_knob[knob][0],
        lambda knob: 0.1 if knob == 1e-4 else 0.01,
        tuple(by_knob),
        lambda knob: by_knob[knob][1],
    )
    found = contest.fitted(rival, SCENE, 1e-2)
    assert found is not None
    assert found.knob == 1e-4


def test_a_ladder_ends_at_the_least_error_or_at_the_cut_off() -> None:
    assert contest.ladder(second_order("to the error"), SCENE)[-1].knob == 128
    slow = second_order("to the cut-off", seconds=lambda n: 0.1 * n)
    assert contest.ladder(slow, SCENE)[-1].knob == 8
    assert why_not([slow], SCENE, 1e-4) == "cut off at 1 s"


def test_one_accident_with_a_large_tolerance_does_not_end_a_ladder() -> None:
    rival = solver(
        "stumbles", lambda knob: knob, lambda knob: 2.0 if knob == 1e-2 else 0.1, (1e-2, 1e-3, 1e-4)
    )
    assert contest.ladder(rival, SCENE)[-1].knob == 1e-4


def test_it_is_said_why_an_error_is_not_reached() -> None:
    assert why_not([], SCENE, 1e-2) == "left out"
    assert why_not([second_order("gets there")], SCENE, 1e-2) == ""
    coarse = solver("coarse", lambda _: 0.1, lambda _: 0.1, (1e-3,))
    assert why_not([coarse], SCENE, 1e-2) == "not reached"
    lost = solver("diverges", lambda _: 0.0, lambda _: 0.1, (1e-3,), failure="diverged")
    assert why_not([lost], SCENE, 1e-2) == "diverged"


@pytest.mark.parametrize(
    ("counts_substeps", "knob", "step", "expected"),
    [
        (True, 60.0, 1.0, 60.0),
        (True, 60.0, 0.1, 6.0),
        (True, 60.0, 0.02, 2.0),
        (True, 60.0, 0.001, 1.0),
        (False, 1e-7, 0.001, 1e-7),
    ],
)
def test_at_other_communication_steps_substeps_are_no_longer_and_tolerances_stay(
    counts_substeps: bool, knob: float, step: float, expected: float
) -> None:
    prepared = []

    def prepare(scene: Scene, knob: float, cut_off: float) -> Run:
        prepared.append((scene.step, knob))
        return lambda: outcome(0.0, 0.0)

    one = Solver("one", "one", (), prepare, counts_substeps)
    calls._often(Rung(one, knob, 1.0, Errors(*[nan] * 5), nan, ""), step)
    assert prepared == [(step, expected)]


# Comparisons and goals


def race(times: dict[str, list[float]], scene: Scene = SCENE, error: float = 1e-2) -> Race:
    keyed = {(name, 1.0): of for name, of in times.items()}
    return Race(scene, {}, keyed, {error: list(keyed)})


def test_the_fastest_has_the_least_median_and_quotients_are_those_of_rounds() -> None:
    raced = race({"a": [1.0, 9.0, 1.0], "b": [2.0, 2.0, 2.0], "c": [3.0, 6.0, 9.0]})
    found = compare(raced, ["a", "b"], ["c"], 1e-2)
    assert found.ours == ("a", 1.0)
    assert found.quotients == [3.0, 6.0 / 9.0, 9.0]
    assert compare(raced, ["a"], ["nobody"], 1e-2).ratio is None


@pytest.fixture
def three_scenes(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Goal]:
    """Return what makes a goal over three scenes with the given times, the same in every round."""

    def goal(ours: list[float], theirs: list[float], at_least: float = 3.0) -> Goal:
        scenes = tuple(replace(SCENE, name=str(i)) for i in range(len(ours)))
        found = {
            scene: race(
                {
                    name: [seconds] * contest.ROUNDS
                    for name, seconds in (("RK", a), ("rival", b))
                    if seconds < inf
                },
                scene,
            )
            for scene, a, b in zip(scenes, ours, theirs, strict=True)
        }
        monkeypatch.setattr(judging, "raced", lambda fmu, scene: found[scene])
        monkeypatch.setattr(judging, "OURS", ("RK",))
        return Goal("scenes", scenes, "the rival", ("rival",), (1e-2,), at_least)

    return goal


ANY: Fmu = None  # type: ignore[assignment]


def test_a_goal_is_judged_by_the_median_over_its_scenes(three_scenes: Callable[..., Goal]) -> None:
    row = three_scenes([1.0, 1.0, 1.0], [2.0, 4.0, 100.0]).judge(ANY)
    assert row.measured == 4.0
    assert row.holds


def test_a_scene_that_the_rival_alone_solves_counts_against_the_goal(
    three_scenes: Callable[..., Goal],
) -> None:
    row = three_scenes([inf, inf, 1.0], [1.0, 1.0, 100.0]).judge(ANY)
    assert row.measured == 0.0
    assert not row.holds


def test_no_ratio_is_infinite(three_scenes: Callable[..., Goal]) -> None:
    row = three_scenes([1.0, 1.0], [inf, inf]).judge(ANY)
    assert not row.holds
    assert "at 1e-02 only the FMU gets there" in row.reason
    row = three_scenes([1.0, 1.0], [inf, 5.0]).judge(ANY)
    assert row.measured == 5.0


def test_nobody_is_said_where_nobody_gets_there(three_scenes: Callable[..., Goal]) -> None:
    assert "nobody gets there" in three_scenes([inf], [inf]).judge(ANY).reason


# Names


def test_each_solver_has_a_style_of_its_own() -> None:
    names = {method.name for method in SolverMethod} | {rival.name for rival in PYTHON_RIVALS}
    names |= {name for group in judging.GROUPS[True].values() for name in group}
    assert set(STYLES) == names
    assert len({(style.line, style.marker) for style in STYLES.values()}) == len(names)


def test_the_table_has_each_task_once() -> None:
    tasks = [scene.task for scene in SCENES if scene.task]
    assert len(set(tasks)) == len(tasks) == 7
    assert len({scene.name for scene in SCENES}) == len(SCENES)


def test_rivals_begin_with_the_tolerance_of_the_scene() -> None:
    rival = solver("begins late", lambda knob: knob, lambda _: 0.1, (1e-2, 1e-3, 1e-4))
    assert [rung.knob for rung in contest.ladder(rival, replace(SCENE, loosest=1e-3))] == [1e-3, 1e-4]
