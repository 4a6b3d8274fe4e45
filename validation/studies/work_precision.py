"""Error against work: orders, floors and limits of the methods, and their race against other integrators.

The rows of SCENES are about errors, those of RACES about run times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from math import inf, sqrt, ulp
from typing import NamedTuple

import numpy as np

from .. import races
from ..checks import Check, Note, Result, Table
from ..fmu import EULER, METHOD_NAMES, MIDPOINT, RK4, W0, Fmu, SolverMethod
from ..metrics import ORDER, SAFETY, SIGMAS, SMALL, growth, observed_order
from ..race import calls, carriers, contest, show
from ..race.judging import GOALS, Goal, rivals
from ..race.machine import provenance
from ..race.rivals import HEYOKA, heyoka_to_the_end
from ..race.scenes import CHAOS, DAMPED, EXTREME, GAUSSIAN, PULSE, STIFF, TRAIN, UNDAMPED, exact
from ..race.scenes import SCENES as RACED
from ..race.scenes import Scene as RaceData
from ..references.methods import METHODS
from .scene import Case, Scene

TITLE = "Error against work"
FORMULA = (
    "error = |(phi, w/w0) - exact|; run times are those of the processor, medians of rounds that all share"
)


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
            bound = next_term
            why = "2*(h*r)^2: the next term of a linear motion is at right angles to the error"
        held = ", from holding the input" if self.data.drive else ""
        reason = f"observed {order:.6g}, theory {expected}{held}; {why}"
        return Check(f"slope of {METHOD_NAMES[method]}, {self.name}", abs(order - expected), bound, reason)

    def _floor(self, method: int, reference: Point, finest: Point) -> Check:
        """Return the row of the round-off floor: the finest run's error against truncation and a random walk.

        Each substep rounds the state once, to an ulp, whose standard deviation is 1/sqrt(12) of it, and the argument
        w0*t of the motion, the same way each time. What there is of both grows like any other error.
        """
        size, grown = float(np.max(np.abs(exact(self.data)[0]))), _growth(self.data)
        order = METHODS[METHOD_NAMES[method]].order
        truncation = reference.error * (finest.h / reference.h) ** order
        rounding = SIGMAS * sqrt(self.data.stop / finest.h) * ulp(size) / sqrt(12)
        phase = 2.0**-52 * W0 * self.data.stop * size
        reason = (
            f"{SAFETY} x h^{order} error {truncation:.1e} rad; {SIGMAS:g} sigma of rounding, {rounding:.1e} rad, and "
            f"that of the phase, {phase:.1e} rad, grown {grown:.3g}-fold at most, as neighbouring exact motions do"
        )
        bound = SAFETY * truncation + grown * (rounding + phase)
        return Check(
            f"round-off floor of {METHOD_NAMES[method]}, {self.name}", finest.error, bound, reason, "rad"
        )

    def divergence(self, method: int, points: Sequence[Point]) -> Check:
        """Return the row that runs beyond the stability limit, and no others, fail or end with an error above 1."""
        limit = METHODS[METHOD_NAMES[method]].real_limit / self.data.k2
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
    near = exact(replace(data, phi0=data.phi0 + 1e-9))
    return float(np.max(growth(exact(data), near, W0)))


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
    race = contest.race([taylor_series, heyoka_to_the_end()], TO_THE_END, calls.SPEND)
    (error,) = TO_THE_END.targets
    ours, theirs = race.fastest(["TaylorSeries"], error), race.fastest([HEYOKA], error)
    if ours is None or theirs is None:
        return races.not_measured(AGAINST_HEYOKA, 1.0, "one of the two does not reach the error")
    ratio = races.ratio(race.times[theirs], race.times[ours])
    reason = f"h = {TO_THE_END.stop / ours[1]:.3g} s, heyoka's tolerance {theirs[1]:.1e}"
    return races.at_least(AGAINST_HEYOKA, ratio, 1.0, reason)


def _against_heyoka(fmu: Fmu) -> Iterator[Check]:
    if fmu.native:
        yield against_heyoka(fmu)


def _goals(fmu: Fmu) -> Iterator[Result]:
    """Yield the goals against the rivals, and what became of all goals that are about this carrier."""
    goals = GOALS[fmu.native]
    judged = [goal.judge(fmu) for goal in goals]
    yield from judged
    rows = [*judged, *_against_heyoka(fmu), *(row for row in calls.substeps(fmu) if isinstance(row, Check))]
    undamped = [
        f"at least {row.measured:.2g} times as fast as with {goal.rival}"
        for goal, row in zip(goals, judged, strict=True)
        if goal.scenes == UNDAMPED
    ]
    swings = f"undamped swings run {' and '.join(undamped)}; " if undamped else ""
    text = f"Speed: {swings}{sum(row.holds for row in rows)} of {len(rows)} goals of speed are met on this machine."
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


def _choice(fmu: Fmu) -> Iterator[Result]:
    yield show.choice(fmu)
    yield Table("Where the run times were measured", ("what", "value"), provenance())


RACES: tuple[Scene, ...] = (
    *map(RaceScene, RACED),
    Case("race: the Taylor series against heyoka's", _against_heyoka),
    Case(
        "race: substeps against bare loops, and one carrier against the other",
        lambda fmu: iter(calls.substeps(fmu)),
    ),
    Case("cost of a call and of a substep", calls.cost),
    Case("cost of short communication steps", calls.communication),
    Case("goals", _goals),
    Case("which method for which task", _choice),
)
