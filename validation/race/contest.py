"""How solvers compete: each climbs a ladder of accuracies, is fitted to every error, and races the others in rounds.

The error that counts is the largest on the grid of the scene. What a solver is fitted by are errors and evaluations,
which no machine changes; run times decide who races, and are measured in rounds that all of a scene share.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from math import inf, isnan, nan
from typing import NamedTuple

import numpy as np

from .. import races
from ..fmu import W0, W02
from ..races import Name
from .rivals import Outcome, Run, Solver
from .scenes import COARSE, Scene, exact

ROUNDS = 15
CLOSE = 1.5  # who is slower than the fastest of its family by more takes part at the errors COARSE only,
SLOW = 0.01  # and only if it is done in so many seconds, or the scene leads the report
FINENESS = 0.03  # relative, of the substeps that just reach an error


class Errors(NamedTuple):
    """Errors on the grid; NaN for a run that failed.

    Attributes
    ----------
    final, rms, largest : distances of (phi, w/w0) from the exact ones in units of the scene's scale [rad]
    energy : largest relative change of the energy, NaN if it is not to stay
    period : by which part of the time the motion is early or late at the end, to first order, NaN as above
    """

    final: float
    rms: float
    largest: float
    energy: float
    period: float


class Rung(NamedTuple):
    """A run of a solver with a value of its knob; `seconds` are those of single runs, the least of a few."""

    solver: Solver
    knob: float
    seconds: float
    errors: Errors
    evaluations: float
    failure: str


Key = tuple[str, float]  # name of the solver, value of the knob


def errors(scene: Scene, outcome: Outcome) -> Errors:
    """Return the errors of a run on the grid of the scene."""
    phi, w = exact(scene)
    if outcome.failure or len(outcome.phi) != len(phi):
        return Errors(nan, nan, nan, nan, nan)
    distances = np.hypot(outcome.phi - phi, (outcome.w - w) / W0) / scene.scale
    largest = float(np.max(distances))
    rms = largest * float(np.sqrt(np.mean((distances / largest) ** 2))) if largest else 0.0
    conserved = _energy_and_period(scene, outcome) if scene.conserves else (nan, nan)
    return Errors(float(distances[-1]), rms, largest, *conserved)


def _energy_and_period(scene: Scene, outcome: Outcome) -> tuple[float, float]:
    energies = outcome.w**2 / 2 + 2 * W02 * np.sin(outcome.phi / 2) ** 2
    phi, w = (column[-1] for column in exact(scene))
    # The shift in time is what of the error at the end lies along the motion, over its speed.
    along = np.array([w, -W0 * np.sin(phi)])
    error = np.array([outcome.phi[-1] - phi, (outcome.w[-1] - w) / W0])
    shift = error @ along / (along @ along)
    return float(np.max(np.abs(energies / energies[0] - 1))), float(abs(shift)) / scene.stop


@cache
def measured(solver: Solver, scene: Scene, knob: float) -> Rung:
    """Return a run, repeated where it is short."""
    run = solver.prepare(scene, knob, solver.cut_off)
    outcome = run()
    seconds = outcome.seconds
    if seconds < 2e-3 and not outcome.failure:
        seconds = min(seconds, run().seconds, run().seconds)
    return Rung(solver, knob, seconds, errors(scene, outcome), outcome.evaluations, outcome.failure)


@cache
def ladder(solver: Solver, scene: Scene) -> Sequence[Rung]:
    """Return runs of rising accuracy, up to the least error of the scene or the cut-off.

    A run with twice the substeps takes twice the time, so that it is known before. A single run with a tolerance that
    takes too long may be an accident: some rivals lose their way if that is large.
    """
    accidents, longest = (0, solver.cut_off / 2) if solver.counts_substeps else (1, solver.cut_off)
    rungs: list[Rung] = []
    for knob in solver.knobs:
        if not solver.counts_substeps and knob > scene.loosest:
            continue
        rungs.append(measured(solver, scene, knob))
        too_long = [rung.seconds > longest for rung in rungs[-1 - accidents :]]
        if rungs[-1].errors.largest <= scene.targets[-1] or (len(rungs) > accidents and all(too_long)):
            break
    return rungs


def reaching(solver: Solver, scene: Scene, error: float) -> Rung | None:
    """Return the cheapest run of the ladder that reaches an error, None if there is none."""
    found = [rung for rung in ladder(solver, scene) if rung.errors.largest <= error]
    if solver.counts_substeps:
        return next(iter(found), None)
    return min(
        found, key=lambda rung: rung.seconds if isnan(rung.evaluations) else rung.evaluations, default=None
    )


@cache
def fitted(solver: Solver, scene: Scene, error: float) -> Rung | None:
    """Return the cheapest run that reaches an error, between the steps of the ladder, too."""
    found = reaching(solver, scene, error)
    if found is None or not solver.counts_substeps:
        return found
    low = max((rung.knob for rung in ladder(solver, scene) if rung.knob < found.knob), default=0)
    while found.knob - low > max(1, FINENESS * found.knob):
        middle = measured(solver, scene, (low + found.knob) // 2)
        if middle.errors.largest <= error:
            found = middle
        else:
            low = middle.knob
    return found


@dataclass(frozen=True)
class Race:
    """The times [s] of the solvers of a scene in rounds, a number a round, and which runs reach which error.

    Attributes
    ----------
    rungs, times : of all that took part
    reaching : error -> what reaches it, of each solver at most one
    """

    scene: Scene
    rungs: dict[Key, Rung]
    times: dict[Key, list[float]]
    reaching: dict[float, list[Key]]

    def fastest(self, names: Sequence[str], error: float) -> Key | None:
        """Return which of the named solvers has the least median time to an error, None if none reaches it."""
        keys = [key for key in self.reaching[error] if key[0] in names]
        return min(keys, key=self.median, default=None)

    def median(self, key: Key) -> float:
        """Return the median time [s]."""
        return float(np.median(self.times[key]))


def race(solvers: Sequence[Solver], scene: Scene, spend: float) -> Race:
    """Let the solvers climb their ladders, and race those that are fast enough, each for `spend` [s] a round."""
    rungs: dict[Key, Rung] = {}
    keys: dict[float, list[Key]] = {}
    for error in scene.targets:
        chosen = list(_contenders(solvers, scene, error))
        rungs |= {(rung.solver.name, rung.knob): rung for rung in chosen}
        keys[error] = [(rung.solver.name, rung.knob) for rung in chosen]
    runs = {key: rung.solver.prepare(scene, rung.knob, inf) for key, rung in rungs.items()}
    return Race(scene, rungs, timed(runs, spend), keys)


def timed(runs: Mapping[Name, Run], spend: float) -> dict[Name, list[float]]:
    """Return the times [s] of prepared runs in rounds, each for `spend` [s] a round."""
    runners = {name: partial(_seconds, run) for name, run in runs.items()}
    return races.race(runners, ROUNDS, spend) if runners else {}


def _seconds(run: Run) -> float:
    return run().seconds


def _contenders(solvers: Sequence[Solver], scene: Scene, error: float) -> Iterator[Rung]:
    """Yield the runs of those that are fast enough; a ladder can take twice the time of what is fitted in it."""
    slow = (inf if scene.leads else SLOW) if error in COARSE else 0.0
    for family in dict.fromkeys(solver.family for solver in solvers):
        of_family = [solver for solver in solvers if solver.family == family]
        coarse = _fast_enough((reaching(solver, scene, error) for solver in of_family), 2 * CLOSE, 2 * slow)
        yield from _fast_enough((fitted(rung.solver, scene, error) for rung in coarse), CLOSE, slow)


def _fast_enough(rungs: Iterable[Rung | None], close: float, slow: float) -> list[Rung]:
    """Return the runs that take `close` times the time of the fastest or less, or `slow` [s] or less."""
    found = [rung for rung in rungs if rung is not None]
    least = min((rung.seconds for rung in found), default=nan)
    return [rung for rung in found if rung.seconds <= max(close * least, slow)]
