"""The methods of an FMU as solvers of a race."""

from __future__ import annotations

from functools import cache, partial

from ..fmu import Experiment, Fmu
from .rivals import Outcome, Run, Solver
from .scenes import Scene

FMU = "FMU"
MOST_SUBSTEPS = 20  # power of two, of those in a communication step
NATIVE_PATIENCE = 0.2  # a native FMU is cut off so much earlier


@cache
def methods(fmu: Fmu) -> dict[str, int]:
    """Return the names of the methods that the FMU has, and their numbers."""
    (enumeration,) = (t for t in fmu.description.typeDefinitions if t.name == "SolverMethod")
    return {item.name: int(item.value) for item in enumeration.items}


@cache
def solvers(fmu: Fmu) -> tuple[Solver, ...]:
    """Return the methods of the FMU as solvers, accurate by their number of substeps in a communication step."""
    return tuple(
        Solver(
            name,
            FMU,
            tuple(2**k for k in range(MOST_SUBSTEPS + 1)),
            partial(_prepare, fmu, number),
            counts_substeps=True,
            patience=NATIVE_PATIENCE if fmu.native else 1.0,
        )
        for name, number in methods(fmu).items()
    )


def experiment(scene: Scene, method: int, substeps: float) -> Experiment:
    """Return the run with so many substeps in a communication step.

    With a drive the communication step is the substep, and the torque that of its middle.
    """
    h = scene.step / substeps
    start = {**scene.start, "solver.method": method, "solver.stepSize": h}
    if (drive := scene.drive) is None:
        return Experiment(scene.stop, scene.step, start, record=("phi", "w"))
    return Experiment(scene.stop, h, start, lambda t: drive(t + h / 2), ("phi", "w"))


def _prepare(fmu: Fmu, method: int, scene: Scene, substeps: float) -> Run:
    prepared = experiment(scene, method, substeps)
    stride = 1 if scene.drive is None else int(substeps)

    def run() -> Outcome:
        done = fmu.run(prepared)
        failure = "diverged" if done.failure else ""
        return Outcome(done.seconds, done["phi"][::stride], done["w"][::stride], done.nfev, failure)

    return run
