"""Faults put between the validation and the FMU: a row is about the FMU if one of them breaks it.

What the FMU gets or gives is changed a little; the FMU itself stays as it is. A row that no fault breaks says nothing
about the FMU, and a row about formulas must not change with one.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan
from multiprocessing import active_children, get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from . import studies
from .checks import About, Check, Result, Table, formula
from .command import cores, deaf
from .fmu import DEFAULTS, NATIVE_NAME, OUTPUTS, Experiment, Fmu, Run
from .metrics import Array

NAME = "faults"  # of the study
ROWS = "(rows about the FMU)"  # beside the names of faults


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
        torque, inputs = experiment.torque, experiment.inputs
        if inputs is not None:
            return replace(experiment, inputs=factor * inputs)
        return experiment if torque is None else replace(experiment, torque=lambda t: factor * torque(t))

    return change


def late_torque(experiment: Experiment) -> Experiment:
    """Return the experiment with each torque a communication step later, 0 in the first."""
    torque, inputs = experiment.torque, experiment.inputs
    if inputs is not None:
        return replace(experiment, inputs=np.vstack((np.zeros_like(inputs[:1]), inputs[:-1])))
    if torque is None:
        return experiment
    before = {now: then for then, now in pairwise(experiment.times())}
    return replace(experiment, torque=lambda t: torque(before[t]) if t in before else 0.0)


def outputs(change: Callable[[Array], object], *names: str) -> Callable[[Run], Run]:
    """Return the change of the recorded outputs `names`."""

    def changed(run: Run) -> Run:
        columns = {
            name: np.asarray(change(column), dtype=float) if name in names else column
            for name, column in run.columns.items()
        }
        return replace(run, columns=columns)

    return changed


def dropped(column: Array) -> Array:
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
    Fault("an evaluation more", gives=lambda run: replace(run, nfev=run.nfev + 1)),
    *(Fault(f"NaN in {name}", gives=outputs(lambda x: nan * x, name)) for name in OUTPUTS),
)


class Faulty(Fmu):
    """An FMU with a fault; runs that are the same are made once."""

    def __init__(self, fmu: Fmu, fault: Fault, made: dict[object, Run]) -> None:
        self.path, self.description = fmu.path, fmu.description
        self.native, self.interpolates = fmu.native, fmu.interpolates
        self._fmu, self._fault, self._made = fmu, fault, made

    def run(self, experiment: Experiment) -> Run:
        """Simulate, with the fault."""
        changed = self._fault.gets(experiment)
        key = _key(changed)
        if key not in self._made:
            self._made[key] = self._fmu.run(changed)
        return self._fault.gives(self._made[key])

    def renew(self) -> None:
        """Take a new instance."""
        self._fmu.renew()


def _key(experiment: Experiment) -> object:
    torque = experiment.torque
    times = experiment.times()
    held = None if torque is None else tuple(torque(t) for t in times[:-1])
    cubics = None if experiment.inputs is None else experiment.inputs.tobytes()
    start = tuple(sorted(experiment.start.items()))
    return tuple(times), start, tuple(experiment.record), held, cubics, experiment.ends


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


def inject(fmu: Fmu, scene: studies.Scene) -> Injected:
    """Put each fault between the FMU and a scene."""
    made: dict[object, Run] = {}
    healthy = _rows(Faulty(fmu, Fault("none"), made), scene)
    broken: dict[str, list[str]] = {fault.name: [] for fault in FAULTS}
    moved: set[str] = set()
    # A scene without a run, or without a row, has nothing to break.
    for fault in FAULTS if made and healthy else ():
        with np.errstate(all="ignore"):  # NaN goes through all that a study computes
            rows = _rows(Faulty(fmu, fault, made), scene)
        broken[fault.name] = [row.name for row in rows.values() if row.about is About.FMU and not row.holds]
        moved |= {name for name, row in healthy.items() if row.about is About.FORMULAS and rows[name] != row}
    return Injected([name for name, row in healthy.items() if row.about is About.FMU], broken, sorted(moved))


def _rows(fmu: Fmu, scene: studies.Scene) -> dict[str, Check]:
    return {row.name: row for row in scene.run(fmu) if isinstance(row, Check)}


# The study of the studies


@dataclass(frozen=True)
class Noticed:
    """A scene of the report: the faults put into all scenes of a study; `found` is what they did, by study."""

    study: str
    pending: Sequence[Future[Injected]]
    found: dict[str, Counter[str]]
    slow: bool = True

    @property
    def name(self) -> str:
        """The name in the progress bar."""
        return f"faults in {self.study}"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield how many rows are counted wrongly, and the faults that break each."""
        del fmu
        injections = [future.result() for future in self.pending]
        self.found[self.study] = Counter(
            {fault.name: sum(len(injected.broken[fault.name]) for injected in injections) for fault in FAULTS}
        )
        self.found[self.study][ROWS] = sum(len(injected.rows) for injected in injections)
        unbroken = [row for injected in injections for row in injected.unbroken]
        moved = [row for injected in injections for row in injected.moved]
        for what, rows in (
            ("rows about the FMU that no fault breaks", unbroken),
            ("rows about formulas that a fault moves", moved),
        ):
            yield formula(
                f"{self.study}: {what}",
                len(rows),
                0,
                "; ".join(rows) or "a count; NaN alone breaks no row",
            )
        yield Table(
            f"Faults that break each row of {self.study}",
            ("row", "faults"),
            [
                (row, ", ".join(fault for fault, rows in injected.broken.items() if row in rows))
                for injected in injections
                for row in injected.rows
            ],
        )


@dataclass(frozen=True)
class Overview:
    """A scene of the report: how many rows notice each fault."""

    found: dict[str, Counter[str]]
    name: str = "overview"
    slow: bool = False

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the table of faults and studies."""
        del fmu
        names = list(self.found)
        rows = [
            (what, *counts, sum(counts))
            for what in (ROWS, *(fault.name for fault in FAULTS))
            for counts in [[self.found[name][what] for name in names]]
        ]
        yield Table(
            "How many rows about the FMU each fault breaks",
            ("fault", *names, "all"),
            rows,
            "Each fault changes what the FMU gets or gives, and nothing else. A row that stands for the FMU has to "
            "break by one of them.",
            folded=False,
        )


@contextmanager
def study(names: Sequence[str], path: Path) -> Iterator[studies.Study]:
    """Begin to put the faults into the studies `names`, and yield the study of what they break, but for run times.

    The faults are put before the FMU at `path`, or before the native one that lies beside it, which is faster: they are
    outside of both. Each core has an FMU of its own, and works from the start: no race may be run beside.
    """
    native = path.with_name(NATIVE_NAME)
    found: dict[str, Counter[str]] = {}
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(
            cores(),
            mp_context=get_context("spawn"),
            initializer=_begin,
            initargs=(native if native.is_file() else path, folder),
        ) as pool,
    ):
        try:
            with deaf():  # the processes of the pool begin here
                pending = {
                    name: [pool.submit(_inject_here, name, i) for i in range(len(studies.load(name).scenes))]
                    for name in names
                }
            yield studies.Study(
                NAME,
                "What would notice a fault",
                "a fault is put between the validation and the FMU; the rows that fail notice it",
                (*(Noticed(name, futures, found) for name, futures in pending.items()), Overview(found)),
                (),
            )
        except BaseException:
            for process in active_children():
                process.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


# In a process of the pool

_fmus: list[Fmu] = []


def _begin(path: Path, folder: str) -> None:
    """Take the FMU of this process."""
    _fmus.append(Fmu(path, Path(folder) / str(os.getpid())))


def _inject_here(name: str, scene: int) -> Injected:
    """Put each fault between the FMU of this process and a scene of the study `name`."""
    return inject(_fmus[0], studies.load(name).scenes[scene])
