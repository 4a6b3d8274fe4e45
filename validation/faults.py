"""Faults put between the validation and the FMU: a row is about the FMU if one of them breaks it.

What the FMU gets or gives is changed a little; the FMU itself stays as it is. A row that no fault breaks says nothing
about the FMU, and a row about formulas must not change with one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan

import numpy as np

from .checks import About, Check
from .fmu import Experiment, Fmu, Run
from .studies import Scene

DEFAULTS = {"m": 1.0, "L": 1.0, "gamma": 0.002, "g": 9.80665, "solver.stepSize": 1e-3}
OUTPUTS = ("phi", "w", "a", "E")


@dataclass(frozen=True)
class Fault:
    """A change of what the FMU gets, an experiment, or of what it gives, a run."""

    name: str
    gets: Callable[[Experiment], Experiment] = lambda experiment: experiment
    gives: Callable[[Run], Run] = lambda run: run


def scaled(name: str, factor: float) -> Callable[[Experiment], Experiment]:
    """Return the change that multiplies a parameter."""

    def change(experiment: Experiment) -> Experiment:
        value = experiment.start.get(name, DEFAULTS[name]) * factor
        return replace(experiment, start={**experiment.start, name: value})

    return change


def scaled_torque(factor: float) -> Callable[[Experiment], Experiment]:
    """Return the change that multiplies the torque."""

    def change(experiment: Experiment) -> Experiment:
        torque = experiment.torque
        return experiment if torque is None else replace(experiment, torque=lambda t: factor * torque(t))

    return change


def late_torque(experiment: Experiment) -> Experiment:
    """Return the experiment with each torque held a communication step later, 0 in the first."""
    torque = experiment.torque
    if torque is None:
        return experiment
    before = {now: then for then, now in pairwise(experiment.times())}
    return replace(experiment, torque=lambda t: torque(before[t]) if t in before else 0.0)


def outputs(change: Callable[[np.typing.NDArray[np.float64]], object], *names: str) -> Callable[[Run], Run]:
    """Return the change of the recorded outputs `names`."""

    def changed(run: Run) -> Run:
        columns = {
            name: np.asarray(change(column), dtype=float) if name in names else column
            for name, column in run.columns.items()
        }
        return replace(run, columns=columns)

    return changed


def dropped(column: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.float64]:
    """Return what is recorded if the step in the middle is not made."""
    middle = len(column) // 2
    return np.concatenate((column[:middle], column[max(middle - 1, 0) : -1]))


FAULTS = (
    Fault("g x (1 + 1e-6)", scaled("g", 1 + 1e-6)),
    Fault("L x (1 + 1e-6)", scaled("L", 1 + 1e-6)),
    Fault("gamma x (1 + 1e-3)", scaled("gamma", 1 + 1e-3)),
    Fault("m x (1 + 1e-3)", scaled("m", 1 + 1e-3)),
    Fault("tau x (1 + 1e-6)", scaled_torque(1 + 1e-6)),
    Fault("tau late by a step", late_torque),
    Fault("substep x 2", scaled("solver.stepSize", 2.0)),
    Fault("substep x 1.1", scaled("solver.stepSize", 1.1)),
    Fault("substep x 0.5", scaled("solver.stepSize", 0.5)),
    Fault("outputs x (1 + 1e-6)", gives=outputs(lambda x: x * (1 + 1e-6), *OUTPUTS)),
    Fault("one step dropped", gives=outputs(dropped, *OUTPUTS)),
    Fault("messages lost", gives=lambda run: replace(run, failure="", warnings=())),
    *(Fault(f"NaN in {name}", gives=outputs(lambda x: nan * x, name)) for name in OUTPUTS),
)


class Faulty(Fmu):
    """An FMU with a fault; runs that are the same are made once."""

    def __init__(self, fmu: Fmu, fault: Fault, made: dict[object, Run]) -> None:
        self.path, self.native = fmu.path, fmu.native
        self._fmu, self._fault, self._made = fmu, fault, made

    def run(self, experiment: Experiment) -> Run:
        """Simulate, with the fault."""
        changed = self._fault.gets(experiment)
        key = _key(changed)
        if key not in self._made:
            self._made[key] = self._fmu.run(changed)
        return self._fault.gives(self._made[key])


def _key(experiment: Experiment) -> object:
    torque = experiment.torque
    times = experiment.times()
    held = None if torque is None else tuple(torque(t) for t in times[:-1])
    return tuple(times), tuple(sorted(experiment.start.items())), tuple(experiment.record), held


@dataclass(frozen=True)
class Injected:
    """What the faults did to a scene: the rows that each breaks, and the rows about formulas that changed.

    `rows` are the rows about the FMU, `broken` those that each fault breaks, by its name.
    """

    rows: Sequence[str]
    broken: Mapping[str, Sequence[str]]
    moved: Sequence[str]

    @property
    def unbroken(self) -> list[str]:
        """The rows about the FMU that no fault breaks; NaN alone does not count."""
        found = {row for fault, rows in self.broken.items() if not fault.startswith("NaN") for row in rows}
        return [row for row in self.rows if row not in found]


def inject(fmu: Fmu, scene: Scene) -> Injected:
    """Put each fault between the FMU and a scene."""
    made: dict[object, Run] = {}
    healthy = _rows(Faulty(fmu, Fault("none"), made), scene)
    broken, moved = {}, set()
    for fault in FAULTS:
        rows = _rows(Faulty(fmu, fault, made), scene)
        broken[fault.name] = [row.name for row in rows.values() if row.about is About.FMU and not row.holds]
        moved |= {name for name, row in healthy.items() if row.about is About.FORMULAS and rows[name] != row}
    return Injected([name for name, row in healthy.items() if row.about is About.FMU], broken, sorted(moved))


def _rows(fmu: Fmu, scene: Scene) -> dict[str, Check]:
    return {row.name: row for row in scene.run(fmu) if isinstance(row, Check)}
