"""Runs the built FMU through FMPy: one extraction, one instance, many runs."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import c_double, c_int, c_uint, c_void_p, cast
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from math import nan, pi, sqrt
from pathlib import Path
from stat import S_ISREG
from tempfile import mkdtemp
from types import TracebackType
from typing import Any, Self

import fmpy
import numpy as np
from fmpy.fmi2 import fmi2True, fmi2Warning
from numpy.typing import NDArray

from .command import reason
from .races import clock

DEFAULT_PATH = Path(__file__).resolve().parent.parent / "dist" / "DampedPendulum.fmu"
NATIVE_NAME = "DampedPendulumNative.fmu"  # of the native FMU of the same model, which may lie beside it


class SolverMethod(IntEnum):
    """The enumeration of the same name in the interface of the FMU."""

    ExplicitEuler = 1
    ExplicitMidPoint2 = 2
    ExplicitRungeKutta4 = 3
    ImplicitEuler = 4
    ImplicitTrapezoid = 5
    TRBDF2 = 6
    SDIRK4 = 7
    TaylorSeries = 8


EULER: int = SolverMethod.ExplicitEuler
MIDPOINT: int = SolverMethod.ExplicitMidPoint2
RK4: int = SolverMethod.ExplicitRungeKutta4
IMPLICIT_EULER: int = SolverMethod.ImplicitEuler
METHOD_NAMES: dict[int, str] = {method: method.name for method in SolverMethod}
OUTPUTS = ("phi", "w", "a", "E")
EVALUATIONS = "solver.nfev"
G = 9.80665  # default gravity acceleration [m/s2]
W02 = G  # squared angular frequency of small swings of the default pendulum [rad2/s2]
W0 = sqrt(W02)
T0 = 2 * pi / W0
K2 = 0.002  # damping rate of the default pendulum [1/s]
SUBSTEP = 1e-3  # default solver.stepSize [s]
DEFAULTS: Mapping[str, float] = {  # of all parameters, in the units of the interface
    "m": 1.0,
    "L": 1.0,
    "gamma": K2,
    "g": G,
    "phi_start": pi / 6,
    "w_start": 0.0,
    "solver.method": RK4,
    "solver.stepSize": SUBSTEP,
}


class UnusableFmuError(Exception):
    """A file that is not the FMU of this project, with what is wrong."""


@dataclass(frozen=True)
class Experiment:
    """What to simulate; everything that is not said stays at its default and costs nothing.

    Attributes
    ----------
    stop, step : end [s] and communication step [s]; the communication points are begin + n*step, the last is the stop
    start : start values that differ from the defaults, in the units of the interface
    torque : tau [N.m] as a function of the time [s], held from each communication point to the next
    record : outputs to read at every communication point
    begin : start time [s]
    points : communication points [s] instead of those from `begin` to `stop`
    inputs : tau [N.m] and its first three derivatives by time at the beginning of each communication step, a row
        each, instead of `torque`; for an FMU that interpolates
    ends : record at the first and the last communication point alone
    """

    stop: float
    step: float
    start: Mapping[str, float] = field(default_factory=dict)
    torque: Callable[[float], float] | None = None
    record: Sequence[str] = ("phi",)
    begin: float = 0.0
    points: Sequence[float] | None = None
    inputs: NDArray[np.float64] | None = None
    ends: bool = False

    def times(self) -> list[float]:
        """Return the communication points [s], formed without accumulation."""
        if self.points is not None:
            return list(self.points)
        n = max(1, round((self.stop - self.begin) / self.step))
        return [self.begin + i * self.step for i in range(n)] + [self.stop]


@dataclass(frozen=True)
class Run:
    """Recorded outputs up to the stop, or to where the FMU failed: `failure` says why, "" if it did not.

    The outputs at the end of the step or of the initialization that failed are NaN, so that no bound holds for want of
    them.
    """

    t: NDArray[np.float64]
    columns: Mapping[str, NDArray[np.float64]]
    seconds: float
    nfev: int
    failure: str
    warnings: Sequence[str]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.columns[name]


Host = Callable[..., int]
"""A compiled importer, see race/host.c."""


def describe(path: Path) -> Any:
    """Return the model description of the FMU of this project.

    Raises
    ------
    UnusableFmuError : no such file, no FMU, or one of another interface
    """
    try:
        is_file = S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        raise UnusableFmuError(f"{path} does not exist: build it with python build_fmu.py") from None
    except OSError as error:
        raise UnusableFmuError(f"{path} cannot be read: {reason(error)}") from None
    if not is_file:
        raise UnusableFmuError(f"{path} is not a file")
    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:  # FMPy raises many kinds
        raise UnusableFmuError(f"{path} is not a readable FMU: {reason(error)}") from None
    known = _references(description)
    missing = [name for name in (*DEFAULTS, "tau", *OUTPUTS, EVALUATIONS) if name not in known]
    if missing:
        raise UnusableFmuError(f"{path} has another interface: no variable {', '.join(missing)}")
    return description


def _references(description: Any) -> dict[str, int]:
    """Return the value references of the variables by name."""
    return {variable.name: variable.valueReference for variable in description.modelVariables}


class _Log:
    """What the FMUs of this process log; a pickled one begins anew in the other process.

    FMPy hands all that is logged in the process to the logger of the FMU that was instantiated last, freed or not.
    """

    def __init__(self) -> None:
        self.messages: list[tuple[int, str]] = []
        self.last: Any = None  # the callbacks of that FMU

    def __reduce__(self) -> tuple[type[_Log], tuple[()]]:
        return _Log, ()

    def add(self, _: Any, __: bytes, status: int, ___: bytes, message: bytes) -> None:
        self.messages.append((status, message.decode()))


_LOG = _Log()


@contextmanager
def _interrupts_heard() -> Iterator[None]:
    """Raise KeyboardInterrupt where it came inside of the FMU, which reports it as an error."""
    try:
        yield
    finally:
        if any(KeyboardInterrupt.__name__ in text for _, text in _LOG.messages):
            raise KeyboardInterrupt


class Fmu:
    """The built FMU, extracted and instantiated once.

    `native` says that it needs no Python, `interpolates` that it takes derivatives of its input.

    It is extracted into `folder`, which must not exist, or into a temporary one.

    Raises
    ------
    UnusableFmuError : no such file, no FMU, one of another interface, or one that does not run on this machine
    """

    def __init__(self, path: Path = DEFAULT_PATH, folder: Path | None = None) -> None:
        self.path = path
        self.description = describe(path)
        self._reference = _references(self.description)
        self.native = not self.description.coSimulation.needsExecutionTool
        self.interpolates = bool(self.description.coSimulation.canInterpolateInputs)
        self._folder = str(folder or mkdtemp())
        with ExitStack() as stack:
            stack.callback(shutil.rmtree, self._folder, ignore_errors=True)
            try:
                fmpy.extract(str(path), self._folder)
                self._instantiate()
            except Exception as error:  # FMPy raises many kinds
                raise UnusableFmuError(f"{path} cannot be instantiated: {reason(error)}") from None
            stack.pop_all()

    def _instantiate(self) -> None:
        self._slave = fmpy.instantiate_fmu(
            self._folder, self.description, "CoSimulation", debug_logging=True, logger=_LOG.add
        )
        _LOG.last = self._slave.callbacks

    def renew(self) -> None:
        """Take a new instance."""
        self._slave.freeInstance()
        self._instantiate()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance and remove the extracted files."""
        self._slave.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    def run(self, experiment: Experiment) -> Run:
        """Simulate from a fresh state; a failure of the FMU ends the run and is part of its result.

        The functions of the FMU are called as FMPy has loaded them, without the wrappers in Python around them, so
        that the time is that of the FMU.

        Raises
        ------
        ValueError : derivatives of the input, for an FMU that does not interpolate
        """
        with _interrupts_heard():
            return self._run(experiment, None)

    def run_in(self, host: Host, experiment: Experiment) -> Run:
        """Simulate in a compiled host, which has the loop over the communication steps and sets no held torque."""
        with _interrupts_heard():
            return self._run(experiment, host)

    def _run(self, experiment: Experiment, host: Host | None) -> Run:
        slave, component = self._slave, self._slave.component
        do_step = slave.dll.fmi2DoStep
        times = experiment.times()
        read = self._reader(experiment.record)
        set_torque = self._torque_setter(experiment)
        at_each = bool(experiment.record) and not experiment.ends
        rows: list[list[float]] = []
        reached = times[0]
        _LOG.messages.clear()
        slave.reset()
        slave.setupExperiment(startTime=times[0])
        for name, value in experiment.start.items():
            setter = slave.setInteger if name == "solver.method" else slave.setReal
            setter([self._reference[name]], [value])
        slave.enterInitializationMode()
        ready = slave.dll.fmi2ExitInitializationMode(component) <= fmi2Warning
        rows.append(read() if ready else [nan] * len(experiment.record))
        if host is not None and ready:
            seconds = self._loop_of(host, experiment, times, rows)
        else:
            begin = clock()
            for i, (now, reached) in enumerate(pairwise(times)) if ready else ():
                refused = set_torque is not None and set_torque(i, now) > fmi2Warning
                if refused or do_step(component, now, reached - now, fmi2True) > fmi2Warning:
                    rows.append([nan] * len(experiment.record))
                    break
                if at_each:
                    rows.append(read())
            else:
                if experiment.ends and ready:
                    rows.append(read())
            seconds = clock() - begin
        nfev = slave.getInteger([self._reference[EVALUATIONS]])[0]
        failure = next((text for status, text in _LOG.messages if status > fmi2Warning), "")
        table = np.array(rows, dtype=float).reshape(len(rows), len(experiment.record))
        return Run(
            t=np.array([times[0], reached][: len(rows)] if experiment.ends else times[: len(rows)]),
            columns={name: table[:, i] for i, name in enumerate(experiment.record)},
            seconds=seconds,
            nfev=nfev,
            failure=failure,
            warnings=[text for status, text in _LOG.messages if status == fmi2Warning],
        )

    def _loop_of(
        self, host: Host, experiment: Experiment, times: Sequence[float], rows: list[list[float]]
    ) -> float:
        """Run in a compiled host, append to `rows` what it reads, and return its time [s]."""
        dll, steps, width = self._slave.dll, len(times) - 1, len(experiment.record)
        names = ("fmi2DoStep", "fmi2GetReal", "fmi2SetReal", "fmi2SetRealInputDerivatives")
        functions = [cast(getattr(dll, name), c_void_p) for name in names]
        references = (c_uint * width)(*(self._reference[name] for name in experiment.record))
        points, table = np.array(times), np.empty((steps, width))
        addresses = [None if x is None else x.ctypes.data for x in (points, table, experiment.inputs)]
        tau, component = self._reference["tau"], c_void_p(self._slave.component)
        begin = clock()
        done = host(
            *functions, component, steps, addresses[0], width, references, addresses[1], tau, addresses[2]
        )
        seconds = clock() - begin
        rows += table[:done].tolist()
        if done < steps:
            rows.append([nan] * width)
        return seconds

    def _reader(self, names: Sequence[str]) -> Callable[[], list[float]]:
        slave, n = self._slave, len(names)
        references = (c_uint * n)(*(self._reference[name] for name in names))
        values = (c_double * n)()
        get_real, component = slave.dll.fmi2GetReal, slave.component

        def read() -> list[float]:
            if n and get_real(component, references, n, values) > fmi2Warning:
                return [nan] * n
            return list(values)

        return read

    def _torque_setter(self, experiment: Experiment) -> Callable[[int, float], int] | None:
        """Return what sets the input when a communication step begins, by its number and its time [s]: to a status."""
        torque, inputs = experiment.torque, experiment.inputs
        reference, value = (c_uint * 1)(self._reference["tau"]), (c_double * 1)()
        set_real, component = self._slave.dll.fmi2SetReal, self._slave.component
        if inputs is None:
            if torque is None:
                return None

            def set_torque(_: int, now: float) -> int:
                value[0] = torque(now)
                status: int = set_real(component, reference, 1, value)
                return status

            return set_torque
        if not self.interpolates:
            raise ValueError(
                f"{self.path.name} does not interpolate its input: canInterpolateInputs is false"
            )
        n = inputs.shape[1] - 1
        references, orders = (c_uint * n)(*[reference[0]] * n), (c_int * n)(*range(1, n + 1))
        derivatives = (c_double * n)()
        set_derivatives, rows = self._slave.dll.fmi2SetRealInputDerivatives, inputs.tolist()

        def set_polynomial(i: int, _: float) -> int:
            value[0], *derivatives[:] = rows[i]
            statuses: list[int] = [
                set_real(component, reference, 1, value),
                set_derivatives(component, references, n, orders, derivatives),
            ]
            return max(statuses)

        return set_polynomial


def swing(amplitude: float, h: float, method: int = RK4) -> dict[str, float]:
    """Return the start values of an undamped swing from `amplitude` [rad] with substeps of `h` [s]."""
    return {"gamma": 0.0, "phi_start": amplitude, "solver.method": method, "solver.stepSize": h}
