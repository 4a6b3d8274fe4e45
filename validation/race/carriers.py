"""The methods of an FMU as solvers of a race."""

from __future__ import annotations

import ctypes
import tempfile
from functools import cache, partial
from pathlib import Path

from ..fmu import Experiment, Fmu, Host, SolverMethod
from ..fmu import Run as FmuRun
from .compiler import NoCompilerError, shared_library
from .rivals import Outcome, Run, Solver
from .scenes import Scene

FMU = "FMU"
MOST_SUBSTEPS = 20  # power of two, of those in a communication step
CUT_OFF = {False: 0.1, True: 0.01}  # [s], by whether the FMU is native


@cache
def solvers(fmu: Fmu) -> tuple[Solver, ...]:
    """Return the methods of the FMU as solvers, accurate by their number of substeps in a communication step."""
    return tuple(
        Solver(
            method.name,
            FMU,
            tuple(2**k for k in range(MOST_SUBSTEPS + 1)),
            partial(_prepare, fmu, method),
            counts_substeps=True,
            cut_off=CUT_OFF[fmu.native],
        )
        for method in SolverMethod
    )


@cache
def compiled_host() -> Host:
    """Return the host in C.

    Raises
    ------
    NoCompilerError : there is no C compiler, or it fails
    """
    source = Path(__file__).resolve().parent / "host.c"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        run = ctypes.CDLL(str(shared_library(source, Path(folder)))).run
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    run.argtypes = [pointer] * 5 + [size, pointer, size, pointer, pointer, ctypes.c_uint, pointer]
    run.restype = size
    host: Host = run
    return host


def host_of(fmu: Fmu) -> Host | None:
    """Return what runs the FMU: a host in C for the native one, if there is a compiler; else that in Python."""
    try:
        return compiled_host() if fmu.native else None
    except NoCompilerError:
        return None


def experiment(scene: Scene, method: int, substeps: float, interpolates: bool) -> Experiment:
    """Return the run with so many substeps in a communication step.

    With a smooth drive the communication step is the substep. The torque is that of its middle, held, or for an FMU
    that interpolates a cubic.
    """
    h, held = scene.step / substeps, scene.held
    start = {**scene.start, "solver.method": method, "solver.stepSize": h}
    record = ("phi", "w")
    if (drive := scene.drive) is None:
        torque = (lambda t: held[round(t / scene.step)]) if held else None
        return Experiment(scene.stop, scene.step, start, torque, record)
    if interpolates:
        inputs = drive.polynomials(h, round(scene.stop / h))
        return Experiment(scene.stop, h, start, record=record, inputs=inputs)
    return Experiment(scene.stop, h, start, lambda t: drive(t + h / 2), record)


def _prepare(fmu: Fmu, method: int, scene: Scene, substeps: float, _: float) -> Run:
    prepared = experiment(scene, method, substeps, fmu.interpolates)
    host = None if scene.held else host_of(fmu)  # the rivals are called from Python at each jump, too
    run = fmu.run if host is None else partial(fmu.run_in, host)
    return lambda: outcome(scene, substeps, run(prepared))


def outcome(scene: Scene, substeps: float, run: FmuRun) -> Outcome:
    """Return what a run of `experiment` has on the grid of the scene."""
    stride = 1 if scene.drive is None else int(substeps)
    failure = "diverged" if run.failure else ""
    return Outcome(run.seconds, run["phi"][::stride], run["w"][::stride], run.nfev, failure)
