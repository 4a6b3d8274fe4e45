"""Error against work: orders, floors and limits of the methods, and their race against other integrators.

The rows of SCENES are about errors, those of RACES about run times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache, partial
from math import inf, nan, pi, sqrt, ulp
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import loops, races
from ..checks import Check, Note, Result, Table
from ..fmu import METHOD_NAMES, W0, W02, Experiment, Fmu, SolverMethod
from ..loops import Loop
from ..metrics import ORDER, SAFETY, SIGMAS, observed_order
from ..race import carriers, contest, show
from ..race.compiler import NoCompilerError
from ..race.judging import GOALS, GROUPS, Goal, raced, rivals
from ..race.machine import provenance
from ..race.rivals import HEYOKA, heyoka_to_the_end
from ..race.scenes import CHAOS, DAMPED, EXTREME, GAUSSIAN, PULSE, SMALL, STIFF, TRAIN, UNDAMPED, exact
from ..race.scenes import SCENES as RACED
from ..race.scenes import Scene as RaceData
from ..races import clock
from ..references.methods import METHODS
from .scene import Case, Scene

TITLE = "Error against work"
FORMULA = (
    "error = |(phi, w/w0) - exact|; run times are those of the processor, medians of rounds that all share"
)

EULER, MIDPOINT, RK4 = (
    SolverMethod.ExplicitEuler,
    SolverMethod.ExplicitMidPoint2,
    SolverMethod.ExplicitRungeKutta4,
)
EXPLICIT = (EULER, MIDPOINT, RK4, SolverMethod.TaylorSeries)
REAL_LIMITS = {EULER: 2.0, MIDPOINT: 2.0, RK4: 2.7852935634, SolverMethod.TaylorSeries: 7.3243335628}


# Errors


class Point(NamedTuple):
    """A run: its substep [s] and its largest error on the grid, inf where the FMU failed."""

    h: float
    error: float


@dataclass(frozen=True)
class WorkScene(Scene):
    """The errors of a motion that is raced over, or of one like it; a method has 2^k substeps in a communication step.

    Attributes
    ----------
    data : the motion with its exact answer; a smooth drive is sampled in the middle of each substep, and held
    rate : fastest rate of a linear motion and its drive [1/s], 0 if it is not linear
    slopes : methods whose order shows over the whole run: method -> k of a run that is compared with k + 1
    floors : methods judged by rounding: method -> k of a run of truncation errors, k of the finest run
    limits : methods judged by their stability limit: method -> range of k
    """

    TITLE = "{0.data.name}"

    data: RaceData
    rate: float = 0.0
    slopes: Mapping[int, int] = field(default_factory=dict)
    floors: Mapping[int, tuple[int, int]] = field(default_factory=dict)
    limits: Mapping[int, range] = field(default_factory=dict)

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows of orders, floors and limits."""
        for method, k in self.slopes.items():
            yield self._slope(method, self.point(fmu, method, k), self.point(fmu, method, k + 1))
        for method, (coarse, fine) in self.floors.items():
            yield self._floor(method, self.point(fmu, method, coarse), self.point(fmu, method, fine))
        for method, exponents in self.limits.items():
            yield self.divergence(method, [self.point(fmu, method, k) for k in exponents])

    def point(self, fmu: Fmu, method: int, k: int) -> Point:
        """Return the error of the FMU with 2^k substeps in a communication step."""
        substeps = 2**k
        run = fmu.run(carriers.experiment(self.data, method, substeps, interpolates=False))
        errors = contest.errors(self.data, carriers.outcome(self.data, substeps, run))
        return Point(self.data.step / substeps, inf if run.failure else errors.largest)

    def _slope(self, method: int, coarse: Point, fine: Point) -> Check:
        order = observed_order(coarse.error, fine.error)
        expected = METHODS[METHOD_NAMES[method]].order if self.data.drive is None else 2
        bound, why = ORDER, "by convention: h is so small that the next term changes less"
        next_term = 2 * (coarse.h * self.rate) ** 2
        if self.rate and expected > 1 and next_term < ORDER:
            bound, why = (
                next_term,
                "2*(h*r)^2: the next term of a linear motion is at right angles to the error",
            )
        held = ", from holding the input" if self.data.drive else ""
        reason = f"observed {order:.6g}, theory {expected}{held}; {why}"
        return Check(f"slope of {METHOD_NAMES[method]}, {self.name}", abs(order - expected), bound, reason)

    def _floor(self, method: int, reference: Point, finest: Point) -> Check:
        """Return the row of the round-off floor: the finest run's error against truncation and a random walk.

        Each substep rounds the state once, to an ulp, whose standard deviation is 1/sqrt(12) of it, and the argument
        w0*t of the motion, the same way each time. What there is of both grows like any other error.
        """
        size, growth = float(np.max(np.abs(exact(self.data)[0]))), _growth(self.data)
        order = METHODS[METHOD_NAMES[method]].order
        truncation = reference.error * (finest.h / reference.h) ** order
        rounding = SIGMAS * sqrt(self.data.stop / finest.h) * ulp(size) / sqrt(12)
        phase = 2.0**-52 * W0 * self.data.stop * size
        reason = (
            f"{SAFETY} x h^{order} error {truncation:.1e} rad; {SIGMAS:g} sigma of rounding, {rounding:.1e} rad, and "
            f"that of the phase, {phase:.1e} rad, grown {growth:.3g}-fold at most, as neighbouring exact motions do"
        )
        bound = SAFETY * truncation + growth * (rounding + phase)
        return Check(
            f"round-off floor of {METHOD_NAMES[method]}, {self.name}", finest.error, bound, reason, "rad"
        )

    def divergence(self, method: int, points: Sequence[Point]) -> Check:
        """Return the row that runs beyond the stability limit, and no others, fail or end with an error above 1."""
        limit = REAL_LIMITS[SolverMethod(method)] / self.data.k2
        right = sum(point.error > 1 if point.h > limit else point.error <= 1 for point in points)
        return Check(
            f"{METHOD_NAMES[method]} is lost beyond its limit, and only there; {self.name}",
            len(points) - right,
            0,
            f"real stability limit {limit:.3e} s; {len(points)} runs, those on the wrong side",
        )


@cache
def _growth(data: RaceData) -> float:
    """Return by how much an error grows at most, from two neighbouring exact motions."""
    (phi, w), (near, near_w) = exact(data), exact(replace(data, phi0=data.phi0 + 1e-9))
    distance = np.hypot(near - phi, (near_w - w) / W0)
    return float(np.max(distance / np.minimum.accumulate(distance)))


# Slopes are read where h is so small that the next term of the error expansion changes them by less than 0.1: the
# amplitude error of the Euler methods, pi*h*w0 a period, is then below 0.1 over the whole run.
SLOPES: Mapping[int, int] = {
    EULER: 13,
    MIDPOINT: 9,
    RK4: 7,
    SolverMethod.ImplicitEuler: 12,
    SolverMethod.ImplicitTrapezoid: 9,
    SolverMethod.TRBDF2: 9,
    SolverMethod.SDIRK4: 7,
}

SCENES: tuple[Scene, ...] = (
    WorkScene(UNDAMPED[0], slopes=SLOPES, floors={RK4: (8, 12), SolverMethod.TaylorSeries: (1, 4)}),
    WorkScene(UNDAMPED[1], floors={RK4: (8, 12), SolverMethod.TaylorSeries: (2, 5)}),
    WorkScene(
        DAMPED,
        slopes={MIDPOINT: 10, RK4: 8, SolverMethod.TRBDF2: 10, SolverMethod.SDIRK4: 8},
    ),
    WorkScene(
        RaceData(
            "impulse response, k2 = 0.002/s, 20 s",
            20.0,
            20,
            0.0,
            rate0=SMALL * W0,
            k2=0.002,
            reference="free linear motion",
            scale=SMALL,
        ),
        rate=W0,
        slopes={**SLOPES, SolverMethod.TaylorSeries: 0},
    ),
    WorkScene(
        PULSE,
        rate=sqrt(5 / GAUSSIAN.variance),  # the sixth derivative over the fourth
        slopes={RK4: 7, SolverMethod.SDIRK4: 7, SolverMethod.TaylorSeries: 7},
    ),
    WorkScene(
        TRAIN,
        slopes=SLOPES,
        floors={RK4: (7, 11), SolverMethod.TaylorSeries: (1, 3)},
    ),
    WorkScene(
        CHAOS,
        slopes={RK4: 9},
        floors={RK4: (9, 13), SolverMethod.TaylorSeries: (4, 6)},
    ),
    WorkScene(
        replace(STIFF, name="stiff, k2 = 1e3/s, 90 deg, 1 s", stop=1.0, points=1),
        limits={
            EULER: range(7, 16),
            MIDPOINT: range(7, 14),
            RK4: range(7, 14),
            SolverMethod.TaylorSeries: range(5, 12),
        },
    ),
    WorkScene(
        EXTREME,
        slopes={SolverMethod.ImplicitEuler: 5, SolverMethod.TRBDF2: 3, SolverMethod.SDIRK4: 2},
    ),
    WorkScene(
        replace(EXTREME, name="stiff, k2 = 1e6/s, 90 deg, 0.01 s", stop=0.01, points=1),
        limits={
            EULER: range(10, 14),
            MIDPOINT: range(10, 14),
            RK4: range(10, 14),
            SolverMethod.TaylorSeries: range(8, 12),
        },
    ),
)


# Races


@dataclass(frozen=True)
class RaceScene(Scene):
    """The race of the methods and their rivals over a motion."""

    TITLE = "race: {0.data.name}"

    data: RaceData

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield who is the fastest to which error, all runs, and pictures."""
        for reason in rivals(fmu.native)[1]:
            yield Note(f"{reason[0].upper()}{reason[1:]}.")
        yield show.fastest(fmu, self.data)
        yield show.everything(fmu, self.data)
        yield show.against_time(fmu, self.data)
        yield show.against_evaluations(fmu, self.data)


SUBSTEP = 0.01  # of the races of substeps [s]
# Of such a race, all in one communication step: so many that a call of the native FMU is 5 percent of it or less.
SUBSTEPS = {SolverMethod.TaylorSeries: 500, SolverMethod.SDIRK4: 1000}
MANY = 5000  # of the others
TORQUE = 0.1  # lets every term of the equation act [N.m]
LOOP_NAMES = {False: "bare loop in Python", True: "bare loop in C"}  # by whether the FMU is native
NO_SLOWER_THAN = {False: 1.4, True: 1.25}  # a substep of the FMU in units of that of the bare loop
NATIVE_FASTER_BY = 10.0
FEW = 100  # substeps in a communication step
NATIVE_FASTER_BY_WITH_FEW = 7.0
SPEND = 2e-3  # of each runner in a round [s]


def _carrier(native: bool) -> str:
    return "native FMU" if native else "FMU"


def _beside(fmu: Fmu) -> Path:
    """Return where the FMU that carries the same model otherwise lies, if it was built."""
    return fmu.path.with_name("DampedPendulum.fmu" if fmu.native else "DampedPendulumNative.fmu")


@cache
def substeps(fmu: Fmu) -> tuple[Result, ...]:
    """Return a substep of each method in the FMUs against bare loops, and one carrier against the other."""
    return tuple(_substeps(fmu))


def _substeps(fmu: Fmu) -> Iterator[Result]:
    with ExitStack() as stack:
        fmus = {fmu.native: fmu}
        bare: dict[bool, Mapping[str, Loop]] = {False: loops.PYTHON_LOOPS}
        if _beside(fmu).is_file():
            fmus[not fmu.native] = stack.enter_context(Fmu(_beside(fmu)))
        else:
            yield Note(f"Left out: the races with the other carrier, because there is no {_beside(fmu)}.")
        if True in fmus:
            try:
                bare[True] = loops.c_loops()
            except NoCompilerError as error:
                yield Note(f"Left out: the race of the native FMU against a {LOOP_NAMES[True]}: {error}.")
        yield from _race_substeps(fmus, {native: bare[native] for native in fmus if native in bare})


def _race_substeps(fmus: Mapping[bool, Fmu], bare: Mapping[bool, Mapping[str, Loop]]) -> Iterator[Result]:
    runners: dict[tuple[str, str], races.Runner] = {}
    for method in SolverMethod:
        for native, fmu in fmus.items():
            runners[_carrier(native), method.name] = partial(_seconds, fmu, _held(method, _many(method)))
        for native, of_method in bare.items():
            runners[LOOP_NAMES[native], method.name] = partial(
                _loop_seconds, of_method[method.name], _many(method)
            )
    times = races.race(runners, spend=SPEND)
    what = "all substeps in one communication step, all terms act"
    for native in bare:
        carrier, loop = _carrier(native), LOOP_NAMES[native]
        for method in SolverMethod:
            yield races.at_most(
                f"time: substep of {method.name} in the {carrier} against a {loop}",
                races.ratio(times[carrier, method.name], times[loop, method.name]),
                NO_SLOWER_THAN[native],
                f"{what}; the loop is written for this pendulum alone",
            )
    columns = ("method", *(f"{name} [us]" for name in dict.fromkeys(name for name, _ in runners)))
    rows = [
        (
            method.name,
            *(
                f"{1e6 * np.median(of) / _many(method):.3g}"
                for (_, name), of in times.items()
                if name == method.name
            ),
        )
        for method in SolverMethod
    ]
    yield Table("Time of a substep, median", columns, rows)
    if len(fmus) == 2:
        yield from _native_is_faster(fmus, times, what)


def _native_is_faster(
    fmus: Mapping[bool, Fmu], times: Mapping[tuple[str, str], list[float]], what: str
) -> Iterator[Result]:
    for method in EXPLICIT:
        ratio = races.ratio(times[_carrier(False), method.name], times[_carrier(True), method.name])
        name = f"time: substep of {method.name} in the FMU in units of that in the native FMU"
        yield races.at_least(name, ratio, NATIVE_FASTER_BY, what)
    short = _held(RK4, FEW, 20)
    of = races.race({native: partial(_seconds, fmu, short) for native, fmu in fmus.items()})
    yield races.at_least(
        f"time: communication step of {FEW} substeps of the FMU in units of that of the native FMU",
        races.ratio(of[False], of[True]),
        NATIVE_FASTER_BY_WITH_FEW,
        "RK4, all terms act; the call from Python counts for both",
    )


def _held(method: int, substeps: int, steps: int = 1) -> Experiment:
    """Return a run of communication steps of so many substeps under a held torque, of which nothing is recorded."""
    step = substeps * SUBSTEP
    start = {"tau": TORQUE, "solver.method": method, "solver.stepSize": SUBSTEP}
    return Experiment(steps * step, step, start, record=())


def _seconds(fmu: Fmu, experiment: Experiment) -> float:
    return fmu.run(experiment).seconds


def _many(method: SolverMethod) -> int:
    return SUBSTEPS.get(method, MANY)


def _loop_seconds(loop: Loop, substeps: int) -> float:
    """Return the time [s] of the default pendulum under `TORQUE` in a bare loop."""
    begin = clock()
    loop(TORQUE, 0.002, W02, pi / 6, 0.0, SUBSTEP, substeps)
    return clock() - begin


# The Taylor series against heyoka's, from one end to the other: neither pays for a grid.
TO_THE_END = replace(UNDAMPED[1], name="undamped 90 deg, 20 s in one step", points=1, targets=(1e-13,))
AGAINST_HEYOKA = (
    "time: undamped 90 deg, 20 s in one communication step, error 1e-13, TaylorSeries against heyoka"
)


@cache
def against_heyoka(fmu: Fmu) -> Check:
    """Return the row of the Taylor series of the native FMU against heyoka."""
    if HEYOKA not in {rival.name for rival in rivals(True)[0]}:
        return races.not_measured(AGAINST_HEYOKA, 1.0, "heyoka is not installed: pip install '.[peers]'")
    (taylor_series,) = (solver for solver in carriers.solvers(fmu) if solver.name == "TaylorSeries")
    race = contest.race([taylor_series, heyoka_to_the_end()], TO_THE_END, SPEND)
    (error,) = TO_THE_END.targets
    ours, theirs = race.fastest(["TaylorSeries"], error), race.fastest([HEYOKA], error)
    if ours is None or theirs is None:
        return races.not_measured(AGAINST_HEYOKA, 1.0, "one of the two does not reach the error")
    ratio = races.ratio(race.times[theirs], race.times[ours])
    reason = f"h = {TO_THE_END.stop / ours[1]:.3g} s, heyoka's tolerance {theirs[1]:.1e}"
    return races.at_least(AGAINST_HEYOKA, ratio, 1.0, reason)


def _against_heyoka(fmu: Fmu) -> Iterator[Result]:
    if fmu.native:
        yield against_heyoka(fmu)


def _cost(fmu: Fmu) -> Iterator[Result]:
    """Yield what a call of doStep costs, and what a substep costs."""
    many, one = 500, 500
    runners = {}
    for method in SolverMethod:
        runners[method, many] = partial(_seconds, fmu, _held(method, many))
        runners[method, 1] = partial(_seconds, fmu, _held(method, 1, one))
    times = races.race(runners, contest.ROUNDS, 0.0)
    rows = []
    for method in SolverMethod:
        substep = float(np.median(times[method, many])) / many
        step = float(np.median(times[method, 1])) / one
        call = step - substep
        rows.append((method.name, f"{1e6 * call:.3g}", f"{1e6 * substep:.3g}", f"{call / substep:.3g}"))
    yield Table(
        "Cost of a call of doStep and of a substep",
        ("method", "call [us]", "substep [us]", "substeps that cost as much as a call"),
        rows,
        "Called from Python by ctypes; default drag and a held torque, so that all terms act.",
    )


COMMUNICATION_STEPS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)  # [s]


def _communication(fmu: Fmu) -> Iterator[Result]:
    """Yield how the communication step eats the advantage over the best rival, which returns one grid of 1 s."""
    data, error = UNDAMPED[1], 1e-6
    race = raced(fmu, data)
    rival = race.fastest([name for names in GROUPS[fmu.native].values() for name in names], error)
    start = {**data.start, "solver.method": RK4, "solver.stepSize": 0.01}
    runs = {
        step: partial(_seconds, fmu, Experiment(data.stop, step, start, record=("phi", "w")))
        for step in COMMUNICATION_STEPS
    }
    times = races.race(runs, contest.ROUNDS, 0.0)
    fastest = race.median(rival) if rival else nan
    yield Table(
        f"How the communication step eats the advantage: RK4, h = 0.01 s, {data.name}",
        ("communication step [s]", "time [ms]", "best rival to 1e-6", "its time [ms]", "rival/FMU"),
        [
            (
                f"{step:g}",
                f"{1e3 * median:.3g}",
                rival[0] if rival else "none",
                f"{1e3 * fastest:.3g}",
                f"{fastest / median:.3g}",
            )
            for step, of in times.items()
            for median in [float(np.median(of))]
        ],
    )


def _choice(fmu: Fmu) -> Iterator[Result]:
    yield show.choice(fmu)
    yield Table("Where the run times were measured", ("what", "value"), provenance())


def goals(fmu: Fmu) -> Iterator[Check]:
    """Yield the rows of all goals that are about this carrier, in the order of the report."""
    yield from (goal.judge(fmu) for goal in GOALS[fmu.native])
    if fmu.native:
        yield against_heyoka(fmu)
    yield from (result for result in substeps(fmu) if isinstance(result, Check))


def _goals(fmu: Fmu) -> Iterator[Result]:
    yield from (goal.judge(fmu) for goal in GOALS[fmu.native])
    rows = list(goals(fmu))
    text = "Speed: "
    if GOALS[fmu.native]:
        text += (
            "undamped swings run "
            + " and ".join(
                f"at least {row.measured:.2g} times as fast as with {goal.rival}"
                for goal, row in zip(GOALS[fmu.native], rows, strict=False)
                if goal.scenes == UNDAMPED
            )
            + "; "
        )
    text += f"{sum(row.holds for row in rows)} of {len(rows)} goals of speed are met on this machine."
    yield Note(text, headline=True)
    yield Table(
        "Goals of speed",
        ("goal", "asked for", "met", "measured"),
        [
            (
                row.name.removeprefix("time: "),
                f"{'>=' if row.at_least else '<='} {row.bound:g}",
                "yes" if row.holds else "MISSED",
                row.reason,
            )
            for row in rows
        ],
    )
    yield from _by_error(fmu)


def _by_error(fmu: Fmu) -> Iterator[Table]:
    """Yield the ratios of the goals at every error."""
    goals = GOALS[fmu.native]
    if goals:
        yield Table(
            "Ratios of the goals at every error",
            ("error", *(f"{goal.what}: {goal.rival}/FMU" for goal in goals)),
            [
                (f"{error:.0e}", *(_ratio(goal, fmu, error) for goal in goals))
                for error in sorted({error for goal in goals for error in goal.errors}, reverse=True)
            ],
            "Median of the rounds, and interval of 95 percent.",
        )


def _ratio(goal: Goal, fmu: Fmu, error: float) -> str:
    if error not in goal.errors:
        return ""
    ratio = goal.ratio(fmu, error)
    return ratio if isinstance(ratio, str) else show.interval(ratio)


RACES: tuple[Scene, ...] = (
    *map(RaceScene, RACED),
    Case("race: the Taylor series against heyoka's", _against_heyoka),
    Case(
        "race: substeps against bare loops, and one carrier against the other",
        lambda fmu: iter(substeps(fmu)),
    ),
    Case("cost of a call and of a substep", _cost),
    Case("cost of short communication steps", _communication),
    Case("goals", _goals),
    Case("which method for which task", _choice),
)
