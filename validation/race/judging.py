"""What is compared, and the goals: which solvers of a scene, at which errors, and how much faster the FMU is to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from .. import races
from ..checks import Check
from ..fmu import Fmu, SolverMethod
from ..races import Ratio
from . import carriers, contest
from .contest import Key, Race, ladder, race, reaching
from .rivals import COMPILED_ODEINT, HEYOKA, ODEINT, PYTHON_RIVALS, SOLVE_IVP, Solver, compiled_rivals
from .scenes import CHAOS, COARSE, DAMPED, EXTREME, ROTATION, STIFF, TRAIN, UNDAMPED, Scene

# What a runner runs in a round at least [s]; a run of the native FMU takes a tenth of what it takes to begin it.
SPEND = {False: 3e-3, True: 1e-3}
OURS = tuple(method.name for method in SolverMethod)
OF_SOLVE_IVP = tuple(solver.name for solver in PYTHON_RIVALS if solver.family == SOLVE_IVP)

# Rivals by whether the FMU is native: who is compared as what.
GROUPS: dict[bool, dict[str, tuple[str, ...]]] = {
    False: {"solve_ivp": OF_SOLVE_IVP, "odeint": (ODEINT,)},
    True: {"heyoka": (HEYOKA,), "odeint, f in C": (COMPILED_ODEINT,)},
}


@cache
def rivals(native: bool) -> tuple[tuple[Solver, ...], tuple[str, ...]]:
    """Return the rivals of an FMU, and of those that are left out, why."""
    if not native:
        return PYTHON_RIVALS, ()
    found = list(compiled_rivals())
    return (
        tuple(rival for rival in found if isinstance(rival, Solver)),
        tuple(rival for rival in found if isinstance(rival, str)),
    )


@cache
def raced(fmu: Fmu, scene: Scene) -> Race:
    """Return the race of the FMU's methods and its rivals over a scene; it is run once."""
    return race([*carriers.solvers(fmu), *rivals(fmu.native)[0]], scene, SPEND[fmu.native])


class Comparison(NamedTuple):
    """The fastest of two groups to an error, None where none reaches it; quotients theirs/ours, a number a round."""

    error: float
    ours: Key | None
    theirs: Key | None
    quotients: Sequence[float]

    @property
    def ratio(self) -> Ratio | None:
        """How many times as fast ours is."""
        return races.ratio(self.quotients, [1.0] * len(self.quotients)) if self.quotients else None


def compare(raced: Race, ours: Sequence[str], theirs: Sequence[str], error: float) -> Comparison:
    """Compare the fastest of two groups of solvers at an error of the scene."""
    mine, other = raced.fastest(ours, error), raced.fastest(theirs, error)
    quotients: Sequence[float] = ()
    if mine is not None and other is not None:
        quotients = [a / b for a, b in zip(raced.times[other], raced.times[mine], strict=True)]
    return Comparison(error, mine, other, quotients)


def why_not(solvers: Sequence[Solver], scene: Scene, error: float) -> str:
    """Return why none of the solvers reaches an error: "" if one does."""
    if not solvers:
        return "left out"
    if any(reaching(solver, scene, error) for solver in solvers):
        return ""
    slow = [solver.cut_off for solver in solvers if ladder(solver, scene)[-1].seconds > solver.cut_off / 2]
    if slow:
        return f"cut off at {max(slow):g} s"
    failed = all(rung.failure for solver in solvers for rung in ladder(solver, scene))
    return "diverged" if failed else "not reached"


@dataclass(frozen=True)
class Goal:
    """A claim on the ratio of run times at each of some errors, the median over some scenes.

    Attributes
    ----------
    what : the scenes in words
    theirs : the rivals, of whom the fastest counts
    at_least : how many times as fast the FMU is to be
    """

    what: str
    scenes: tuple[Scene, ...]
    rival: str
    theirs: tuple[str, ...]
    errors: tuple[float, ...]
    at_least: float

    def judge(self, fmu: Fmu) -> Check:
        """Return the row of the error at which the claim is weakest; its measured number is the lower end there."""
        name = f"time: {self.what}, errors {self.errors[0]:.0e} to {self.errors[-1]:.0e}, FMU against {self.rival}"
        ratios = {}
        alone = []
        for error in self.errors:
            ratio = self.ratio(fmu, error)
            if isinstance(ratio, Ratio):
                ratios[error] = ratio
            elif ratio:
                alone.append(f"at {error:.0e} {ratio}")
        if not ratios:
            return races.not_measured(name, self.at_least, "; ".join(alone) or "no error is reached by both")
        weakest = min(ratios, key=lambda error: ratios[error].low)
        reason = "; ".join([f"weakest at {weakest:.0e}", *alone])
        return races.at_least(name, ratios[weakest], self.at_least, reason)

    def ratio(self, fmu: Fmu, error: float) -> Ratio | str:
        """Return the ratio at an error, in every round the median over the scenes, or why there is none.

        A scene in which the rivals alone reach the error counts as a ratio of 0; one in which they do not, not at all.
        """
        quotients = []
        reached = False
        for scene in self.scenes:
            found = compare(raced(fmu, scene), OURS, self.theirs, error)
            reached = reached or found.ours is not None
            if found.quotients:
                quotients.append(found.quotients)
            elif found.theirs is not None:
                quotients.append([0.0] * contest.ROUNDS)
        if not quotients:
            return "only the FMU gets there" if reached else "nobody gets there"
        return races.ratio(np.median(np.array(quotients), axis=0).tolist(), [1.0] * contest.ROUNDS)


NOT_STIFF = (
    ("undamped swings, median of the amplitudes", UNDAMPED),
    (ROTATION.name, (ROTATION,)),
    (DAMPED.name, (DAMPED,)),
    (TRAIN.name, (TRAIN,)),
    (CHAOS.name, (CHAOS,)),
)
GOALS: dict[bool, tuple[Goal, ...]] = {
    False: (
        *(
            Goal(what, scenes, f"the best of {SOLVE_IVP}", OF_SOLVE_IVP, scenes[0].targets, 3.0)
            for what, scenes in NOT_STIFF
        ),
        *(Goal(what, scenes, ODEINT, (ODEINT,), scenes[0].targets, 1.0) for what, scenes in NOT_STIFF),
        *(
            Goal(scene.name, (scene,), "the best of LSODA and Radau", ("LSODA", "Radau"), COARSE[:3], 2.0)
            for scene in (STIFF, EXTREME)
        ),
    ),
    True: (),
}
