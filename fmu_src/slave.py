"""The FMI shell of the damped pendulum: values in and out, checks, errors, state. No physics."""

from __future__ import annotations

import json
import sys
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import repeat
from math import inf, isfinite, isnan, nan
from operator import attrgetter
from sys import float_info
from typing import Any, NoReturn
from xml.etree.ElementTree import Element

from pythonfmu import Boolean, DefaultExperiment, Fmi2Slave, Integer, Real, String
from pythonfmu.enums import Fmi2Status

from damped_pendulum.fmi2 import (
    TYPE_OF,
    complete,
    describe,
    keep_alive,
    scalar_variable,
)
from damped_pendulum.inline import inlined
from damped_pendulum.interface import (
    AUTHOR,
    COMMUNICATION_STEP,
    DESCRIPTION,
    LICENSE,
    MODEL_NAME,
    START_TIME,
    STOP_TIME,
    VARIABLES,
    VERSION,
    Variable,
    state_format,
)
from damped_pendulum.model import Pendulum
from damped_pendulum.solvers import (
    METHODS,
    Solver,
    SolverMethod,
    stability_limit,
    substeps,
    unique_root_limit,
)

VALUE_REFERENCE = {variable.name: vr for vr, variable in enumerate(VARIABLES)}
TAU = VALUE_REFERENCE["tau"]
NFEV_MAX = 2**31 - 1  # fmi2Integer has 32 bits
STATE_FORMAT = state_format(MODEL_NAME)
MODES = ("instantiated", "initialization", "stepping", "terminated")


class FmuError(Exception):
    """An FMI call that cannot be carried out; the state of the instance is the one before the call."""

    # The wrapper of pythonfmu logs the repr of an exception: here the sentence, by a function of C, which no interrupt
    # can hit. The log queue is no way to tell an error: the wrapper empties it while the exception is pending, and a
    # host in Python cannot run in that state (from Python 3.13 on).
    __repr__ = BaseException.__str__


class DampedPendulum(Fmi2Slave):  # type: ignore[misc]  # pythonfmu is not typed
    """The damped pendulum as an FMI 2.0 co-simulation slave."""

    author = AUTHOR
    description = DESCRIPTION
    license = LICENSE
    version = VERSION
    default_experiment = DefaultExperiment(START_TIME, STOP_TIME, COMMUNICATION_STEP)

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        keep_alive(self, self.log_queue)
        # An interrupt cannot hit a function of C; the wrapper does not expect one here.
        self._get_log_queue = repeat(self.log_queue).__next__
        self._phi: float
        self._w: float
        self._nfev: int
        self._pendulum: Pendulum
        self._tau_of_motion: float | None  # the torque that `_motion` was made for
        self._solve: Solver
        self._max_step: float
        self._values: list[Any] = [variable.start for variable in VARIABLES]
        self._mode = "instantiated"
        self._start_time, self._stop_time = 0.0, inf
        self._begin()

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return modelDescription.xml as an element tree."""
        self.register_variables()
        return complete(super().to_xml(model_options or {}))

    def register_variables(self) -> None:
        """Register the variables, which pythonfmu needs for modelDescription.xml alone."""
        readers = READERS[Real] | READERS[Integer]
        for vr, variable in enumerate(VARIABLES):
            registered = scalar_variable(variable)
            registered.getter = partial(readers[vr], self)
            self.register_variable(registered, nested=False)

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Note the stop time [s]; a fixed-step method has no use for the tolerance."""
        self._require("instantiated", "fmi2SetupExperiment")
        if not (isfinite(start_time) and (stop_time is None or start_time <= stop_time)):
            self._fail(
                f"startTime = {start_time!r} s must be finite and not beyond stopTime = {stop_time!r} s"
            )
        self._start_time = float(start_time)
        self._stop_time = inf if stop_time is None else float(stop_time)

    def enter_initialization_mode(self) -> None:
        """Enter initialization; the parameters may still be set."""
        self._require("instantiated", "fmi2EnterInitializationMode")
        self._mode = "initialization"

    def exit_initialization_mode(self) -> None:
        """Check the parameters, all problems in one message, and warn of an unstable step size."""
        self._require("initialization", "fmi2ExitInitializationMode")
        problems = _problems(self._values)
        if problems:
            self._fail("cannot initialize: " + "; ".join(problems))
        self._mode = "stepping"
        self._choose_solver()
        if self._max_step > self._limit:
            warning = f"solver.stepSize = {self._max_step!r} s is unstable: {self._advice(self._max_step)}"
            self.log(_for_log(warning), Fmi2Status.warning, "logStatusWarning")

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Integrate from `current_time` over `step_size` [s] with the torque held.

        Returns
        -------
        True; a step that cannot be carried out raises, because importers take False for the end of the run
        """
        end = current_time + step_size
        if self._mode != "stepping" or not (
            0.0 < step_size < inf and -inf < end < inf and end <= self._stop_time
        ):
            self._check_step(current_time, step_size)
        tau = self._values[TAU]
        if tau != self._tau_of_motion:
            if not isfinite(tau):
                self._fail(f"no step from t = {current_time!r} s: {describe(VARIABLES[TAU], tau)}")
            motion = self._pendulum.motion(tau)
            solve = inlined(METHODS[self._method].solver, motion)
            self._motion, self._solve, self._tau_of_motion = motion, solve, tau
        try:
            n = substeps(current_time, step_size, self._max_step)
            phi, w, nfev = self._solve(self._motion, self._phi, self._w, step_size / n, n)
        except OverflowError as error:
            self._fail(str(error))
        except ValueError:  # math.sin(inf)
            self._report_divergence(current_time, step_size / n)
        except (KeyboardInterrupt, MemoryError) as error:
            self._fail(f"no step from t = {current_time!r} s: {type(error).__name__}")
        if not (isfinite(phi) and isfinite(w)):
            self._report_divergence(current_time, step_size / n)
        # The sign of a zero depends on the terms that are left out: -0.0 becomes 0.0.
        self._phi, self._w, self._nfev = phi + 0.0, w + 0.0, self._nfev + nfev
        return True

    def terminate(self) -> None:
        """End the run; the outputs can still be read."""
        self._mode = "terminated"

    def get_real(self, vrs: Sequence[int]) -> list[float]:
        """Return the values of Real variables, outputs computed now."""
        return self._get(Real, vrs)

    def get_integer(self, vrs: Sequence[int]) -> list[int]:
        """Return the values of Integer and Enumeration variables."""
        return self._get(Integer, vrs)

    def get_boolean(self, vrs: Sequence[int]) -> list[bool]:
        """Refuse every reference: there are no Boolean variables."""
        return self._get(Boolean, vrs)

    def get_string(self, vrs: Sequence[int]) -> list[str]:
        """Refuse every reference: there are no String variables."""
        return self._get(String, vrs)

    def set_real(self, vrs: Sequence[int], values: Sequence[float]) -> None:
        """Set Real parameters (until initialization ends) and the torque (until the run ends)."""
        self._set(Real, vrs, values)

    def set_integer(self, vrs: Sequence[int], values: Sequence[int]) -> None:
        """Set the integration method (until initialization ends)."""
        self._set(Integer, vrs, values)

    def set_boolean(self, vrs: Sequence[int], values: Sequence[bool]) -> None:
        """Refuse every reference: there are no Boolean variables."""
        self._set(Boolean, vrs, values)

    def set_string(self, vrs: Sequence[int], values: Sequence[str]) -> None:
        """Refuse every reference: there are no String variables."""
        self._set(String, vrs, values)

    def _get_fmu_state(self) -> dict[str, Any]:
        """Return all that the future of the instance depends on."""
        return {
            "format": STATE_FORMAT,
            "values": list(self._values),
            "phi": self._phi,
            "w": self._w,
            "nfev": self._evaluations(),
            "mode": self._mode,
            "start_time": self._start_time,
            "stop_time": self._stop_time,
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Restore what `_get_fmu_state` returned, in this or another instance or process, or refuse all of it."""
        reason = _why_refused(state)
        if reason is not None:
            self._fail(f"cannot restore the state: {reason}")
        self._values = list(state["values"])
        self._begin()
        self._phi, self._w, self._nfev = state["phi"], state["w"], state["nfev"]
        self._mode, self._start_time, self._stop_time = state["mode"], state["start_time"], state["stop_time"]
        if self._mode == "stepping":
            self._choose_solver()

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        """Return the state as a checksum and JSON, in which doubles keep every bit."""
        body = json.dumps(state).encode()
        return f"{zlib.crc32(body):08x}".encode() + body

    @staticmethod
    def _fmu_state_from_bytes(data: bytes) -> dict[str, Any]:
        """Return the state of `_fmu_state_to_bytes`, or the reason why it is refused when it is set.

        The refusal waits until then because a static method does not know the instance that it would name.
        """
        body = data[8:]
        if not body or data[:8] != f"{zlib.crc32(body):08x}".encode():
            return {"refused": "the bytes are damaged (wrong checksum)"}
        try:
            state = json.loads(body)
        except (ValueError, RecursionError):
            state = None
        return state if isinstance(state, dict) else {"refused": "the bytes are no state"}

    def _get(self, kind: type, vrs: Sequence[int]) -> list[Any]:
        readers = READERS[kind]
        try:
            return [readers[vr](self) for vr in vrs]
        except KeyError as error:
            self._fail(_wrong_reference(error.args[0], kind))

    def _set(self, kind: type, vrs: Sequence[int], values: Sequence[Any]) -> None:
        for vr in vrs:
            if vr not in READERS[kind]:
                self._fail(_wrong_reference(vr, kind))
            if vr != TAU or self._mode == "terminated":
                self._refuse_unless_settable(VARIABLES[vr])
        changed = list(self._values)
        for vr, value in zip(vrs, values, strict=True):
            changed[vr] = value
        self._values = changed
        if self._mode in ("instantiated", "initialization"):
            self._begin()

    def _refuse_unless_settable(self, variable: Variable) -> None:
        if variable.causality == "output":
            self._fail(f"{variable.name} is an output: it cannot be set")
        if self._mode == "terminated":
            self._fail(f"{variable.name} cannot be set: the run has ended")
        if self._mode == "stepping":
            self._fail(
                f"{variable.name} is a fixed parameter: it can be set until initialization ends, not after"
            )

    def _value(self, name: str) -> Any:
        return self._values[VALUE_REFERENCE[name]]

    def _begin(self) -> None:
        """Take the state from the start values, so that the outputs are right before the first step, too."""
        self._phi, self._w = self._value("phi_start"), self._value("w_start")
        self._pendulum = _pendulum(self._values)
        self._tau_of_motion, self._nfev = None, 0

    def _choose_solver(self) -> None:
        motion = self._pendulum.motion()
        self._method = SolverMethod(self._value("solver.method"))
        self._limit = stability_limit(self._method, motion.damping_rate, motion.w02)
        self._max_step = min(
            self._value("solver.stepSize"),
            unique_root_limit(self._method, motion.damping_rate, motion.w02),
        )

    def _evaluations(self) -> int:
        return min(self._nfev, NFEV_MAX)

    def _acceleration(self) -> float:
        def compute() -> float:
            return self._pendulum.motion(self._values[TAU]).acceleration()(self._phi, self._w)

        return self._computed("a", compute)

    def _energy(self) -> float:
        return self._computed("E", lambda: self._pendulum.energy(self._phi, self._w))

    def _computed(self, name: str, compute: Callable[[], float]) -> float:
        try:
            value = compute()
        except (ValueError, ZeroDivisionError):  # math.sin(inf), m = 0 before the parameters are checked
            value = nan
        if not isfinite(value):
            self._fail(
                f"{name} is out of the range of a double at phi = {self._phi!r} rad, w = {self._w!r} rad/s, "
                f"tau = {self._values[TAU]!r} N.m"
            )
        return value + 0.0  # -0.0 becomes 0.0

    def _require(self, mode: str, call: str) -> None:
        if self._mode != mode:
            self._fail(f"{call} is allowed in mode {mode} only, the instance is in mode {self._mode}")

    def _check_step(self, current_time: float, step_size: float) -> None:
        """Refuse a step that cannot be made; one beyond the stop time by the rounding of the host's clock can.

        That clock may add up its steps, and FMPy takes what is within a relative 1e-9 for the stop time.
        """
        if self._mode != "stepping":
            self._fail(f"no step in mode {self._mode}: initialize the instance first")
        if not 0.0 < step_size < inf:
            self._fail(
                f"no step from t = {current_time!r} s: "
                f"communicationStepSize = {step_size!r} s (allowed: > 0 and finite)"
            )
        largest = max(abs(self._start_time), abs(self._stop_time))
        slack = max(4.0 * float_info.epsilon * largest, min(1e-9 * largest, step_size / 10.0))
        end = current_time + step_size
        if not (-inf < end < inf and end <= self._stop_time + slack):
            self._fail(
                f"no step from t = {current_time!r} s over {step_size!r} s: "
                f"it must end at a finite time, not beyond the stop time ({self._stop_time!r} s)"
            )

    def _report_divergence(self, time: float, h: float) -> NoReturn:
        """Fail with the substep that left the range of a double, found by taking them one by one."""
        phi, w, count = self._phi, self._w, 0
        try:
            while isfinite(phi) and isfinite(w):
                count += 1
                phi, w, _ = self._solve(self._motion, phi, w, h, 1)
        except ValueError:  # math.sin(inf)
            pass
        self._fail(
            f"diverged at t = {time + count * h!r} s: substep {count} of {h!r} s with "
            f"{self._method.name} left the range of a double; {self._advice(h)}"
        )

    def _advice(self, h: float) -> str:
        """Say what to do about substeps of `h` [s] that went wrong or will."""
        method = self._method.name
        if self._limit == 0.0:
            return (
                f"{method} has no stable step size for this pendulum (stability limit 0 s): "
                "use ExplicitRungeKutta4 or ImplicitEuler"
            )
        if h <= self._limit:
            return (
                f"{h!r} s is within the stability limit of {method} for this pendulum "
                f"({self._limit:.6g} s): check the torque and the start values"
            )
        stable = 0.9999 * self._limit  # stays below the limit when it is rounded to five digits
        return (
            f"the stability limit of {method} for this pendulum is {self._limit:.6g} s: "
            f"use solver.stepSize = {stable:.5g} s or less, or ImplicitEuler"
        )

    def _fail(self, message: str) -> NoReturn:
        """Raise `message`, which the wrapper logs, and give it to stderr, because a host may show no log."""
        text = f"{self.instance_name}: {message}".replace("%", "percent")
        # A host may have no stderr, a closed one or one that cannot write the instance name.
        with suppress(AttributeError, OSError, ValueError):
            sys.stderr.write(text + "\n")
        raise FmuError(_for_log(text))


keep_alive(DampedPendulum)


def _value_of(vr: int) -> Callable[[DampedPendulum], Any]:
    return lambda slave: slave._values[vr]


_OUTPUTS: dict[str, Callable[[DampedPendulum], Any]] = {
    "phi": attrgetter("_phi"),
    "w": attrgetter("_w"),
    "a": DampedPendulum._acceleration,
    "E": DampedPendulum._energy,
    "solver.nfev": DampedPendulum._evaluations,
}
READERS: dict[type, dict[int, Callable[[DampedPendulum], Any]]] = {Boolean: {}, String: {}} | {
    kind: {
        vr: _OUTPUTS.get(variable.name, _value_of(vr))
        for vr, variable in enumerate(VARIABLES)
        if (variable.type in TYPE_OF) == (kind is Real)
    }
    for kind in (Real, Integer)
}


def _for_log(text: str) -> str:
    """Return `text` for FMI's logger, which takes `%` for a format and `#` for a value reference (2.1.5)."""
    return text.replace("%", "percent").replace("#", "##")


def _pendulum(values: Sequence[Any]) -> Pendulum:
    return Pendulum(*(values[VALUE_REFERENCE[name]] for name in Pendulum._fields))


def _problems(values: Sequence[Any]) -> list[str]:
    """Return what is wrong with the parameters."""
    return [
        describe(variable, value)
        for variable, value in zip(VARIABLES, values, strict=True)
        if variable.causality == "parameter" and not variable.allows(value)
    ] or _pendulum(values).out_of_range()


def _is_float(value: object) -> bool:
    return type(value) is float


def _is_of_type(variable: Variable, value: object) -> bool:
    """Return whether an instance can hold `value`, allowed or not, for `variable`."""
    if variable.causality == "output":
        return value is None
    if variable.type in TYPE_OF:
        return _is_float(value)
    return isinstance(value, int) and type(value) is not bool and -(2**31) <= value < 2**31


# Entries of a state, and what each can be by itself.
STATE: dict[str, Callable[[Any], bool]] = {
    "format": lambda value: value == STATE_FORMAT,
    "values": lambda value: (
        isinstance(value, list) and len(value) == len(VARIABLES) and all(map(_is_of_type, VARIABLES, value))
    ),
    "phi": _is_float,
    "w": _is_float,
    "nfev": lambda value: type(value) is int and 0 <= value <= NFEV_MAX,
    "mode": lambda value: value in MODES,
    "start_time": lambda value: _is_float(value) and isfinite(value),
    "stop_time": lambda value: _is_float(value) and not isnan(value),
}


def _why_refused(state: dict[str, Any]) -> str | None:
    """Return why no instance can be in `state`, None if one can: a state may come from anywhere."""
    if "refused" in state:
        return str(state["refused"])
    if state.get("format") != STATE_FORMAT:
        return f"it is of {str(state.get('format'))[:60]!r}, this is {STATE_FORMAT!r}"
    wrong = [name for name, can_be in STATE.items() if name not in state or not can_be(state[name])]
    wrong += [str(name)[:60] for name in state if name not in STATE]
    if not wrong and state["start_time"] > state["stop_time"]:
        wrong = ["stop_time"]
    if not wrong and state["mode"] in ("instantiated", "initialization"):
        start = [state["values"][VALUE_REFERENCE[name]] for name in ("phi_start", "w_start")]
        if repr([state["phi"], state["w"], state["nfev"]]) != repr([*start, 0]):
            wrong = ["phi, w or nfev before the first step"]
    if not wrong and state["mode"] == "stepping":
        wrong = _problems(state["values"]) or [name for name in ("phi", "w") if not isfinite(state[name])]
    return f"no instance can be in it ({'; '.join(wrong)})" if wrong else None


def _wrong_reference(vr: int, kind: type) -> str:
    if 0 <= vr < len(VARIABLES):
        return f"{VARIABLES[vr].name} (value reference {vr}) is not of type {kind.__name__}"
    vr %= 2**32  # pythonfmu hands it over as a signed number
    return f"value reference {vr} is unknown (allowed: 0..{len(VARIABLES) - 1})"
