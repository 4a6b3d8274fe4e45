"""A co-simulation slave without a model: modes, checks, messages, errors, state. A model inherits it.

The model names its interface, reads its outputs, and makes its steps; see the methods that raise NotImplementedError.
"""

from __future__ import annotations

import atexit
import json
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import repeat
from math import inf, isfinite, isnan
from sys import float_info
from typing import Any, ClassVar, NoReturn, Self
from xml.etree.ElementTree import Element

from pythonfmu import Boolean, DefaultExperiment, Fmi2Slave, Integer, Real, String
from pythonfmu.enums import Fmi2Status

from .description import complete, scalar_variable
from .tables import Interface, Variable
from .wrapper import hands_on_the_log, keep_alive, release_wrappers

MODES = ("instantiated", "initialization", "stepping", "terminated")
INTEGER_MAX = 2**31 - 1  # fmi2Integer has 32 bits

Reader = Callable[[Any], Any]


class FmuError(Exception):
    """An FMI call that cannot be carried out; the state of the instance is the one before the call."""

    # The wrapper of pythonfmu logs the repr of an exception: here the sentence, by a function of C, which no interrupt
    # can hit. The log queue is no way to tell an error: the wrapper empties it while the exception is pending, and a
    # host in Python cannot run in that state (from Python 3.13 on).
    __repr__ = BaseException.__str__


class CoSimulation(Fmi2Slave):  # type: ignore[misc]  # pythonfmu is not typed
    """A slave for FMI 2.0 co-simulation.

    Attributes
    ----------
    interface : the tables of the interface
    calculated : of every calculated variable, a function of the slave that returns its value
    entries : of everything that a saved state holds besides what the shell keeps, what it can be by itself
    values : values of the variables by value reference, None for calculated ones
    """

    interface: ClassVar[Interface]
    calculated: ClassVar[Mapping[str, Reader]]
    entries: ClassVar[Mapping[str, Callable[[Any], bool]]]

    _format: ClassVar[str]
    _reference: ClassVar[Mapping[str, int]]
    _inputs: ClassVar[Sequence[int]]
    _readers: ClassVar[Mapping[type, Mapping[int, Reader]]]

    def begin(self) -> None:
        """Take the state from the start values; they may be wrong before initialization ends."""
        raise NotImplementedError

    @classmethod
    def problems(cls, values: Mapping[str, Any]) -> list[str]:
        """Return what the model cannot compute with although each parameter by itself is allowed."""
        raise NotImplementedError

    def start(self) -> str | None:
        """Prepare the steps, all parameters being right; return a warning to the user or None."""
        raise NotImplementedError

    def hold(self) -> None:
        """Take over the inputs, which are finite, for the steps to come."""
        raise NotImplementedError

    def advance(self, time: float, duration: float) -> None:
        """Advance the state from `time` over `duration` [s].

        Raises
        ------
        OverflowError : the step cannot be made, with the reason as a sentence; the state is as before
        """
        raise NotImplementedError

    def save(self) -> dict[str, Any]:
        """Return what belongs to the state besides the values of the variables: the `entries`."""
        raise NotImplementedError

    def restore(self, entries: Mapping[str, Any]) -> None:
        """Take over what `save` returned."""
        raise NotImplementedError

    def __init_subclass__(cls) -> None:
        """Derive from the tables what every instance needs, once."""
        if not hasattr(cls, "interface"):
            return  # a class for a kind of models
        interface = cls.interface
        cls.author, cls.description = interface.author, interface.description
        cls.license, cls.version = interface.license, interface.version
        cls.default_experiment = DefaultExperiment(*interface.experiment)
        cls._format = interface.state_format(interface.model_name)
        cls._reference = interface.references()
        cls._inputs = [vr for vr, variable in enumerate(interface.variables) if variable.causality == "input"]
        readers = {
            vr: cls.calculated.get(variable.name, _reader_of_value(vr))
            for vr, variable in enumerate(interface.variables)
        }
        reals = {vr for vr in readers if interface.is_real(interface.variables[vr])}
        cls._readers = {
            Real: {vr: reader for vr, reader in readers.items() if vr in reals},
            Integer: {vr: reader for vr, reader in readers.items() if vr not in reals},
            Boolean: {},
            String: {},
        }
        keep_alive(cls)
        if sys.platform.startswith("linux"):
            atexit.register(release_wrappers, interface.model_name)

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        keep_alive(self, self.log_queue)
        self._logger = kwargs.get("logger")
        # An interrupt cannot hit a function of C; the wrapper does not expect one here.
        self._get_log_queue = repeat(self.log_queue).__next__
        self.values: list[Any] = [variable.start for variable in self.interface.variables]
        self._mode = "instantiated"
        self._start_time, self._stop_time = 0.0, inf
        self._inputs_changed = True
        self.begin()

    def __getitem__(self, name: str) -> Any:
        """Return the value of a parameter or an input."""
        return self.values[self._reference[name]]

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """Return modelDescription.xml as an element tree."""
        self.register_variables()
        return complete(super().to_xml(model_options or {}), self.interface)

    def register_variables(self) -> None:
        """Register the variables, which pythonfmu needs for modelDescription.xml alone."""
        readers = {**self._readers[Real], **self._readers[Integer]}
        for vr, variable in enumerate(self.interface.variables):
            registered = scalar_variable(self.interface, variable)
            registered.getter = partial(readers[vr], self)
            self.register_variable(registered, nested=False)

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Note the times of the experiment [s]; a fixed-step method has no use for the tolerance."""
        self._require("instantiated", "fmi2SetupExperiment")
        if not (isfinite(start_time) and (stop_time is None or start_time <= stop_time)):
            self.fail(
                f"startTime = {start_time!r} s must be finite and not beyond stopTime = {stop_time!r} s"
            )
        stop = inf if stop_time is None else float(stop_time)
        self._start_time, self._stop_time = float(start_time), stop

    def enter_initialization_mode(self) -> None:
        """Enter initialization; the parameters may still be set."""
        self._require("instantiated", "fmi2EnterInitializationMode")
        self._mode = "initialization"

    def exit_initialization_mode(self) -> None:
        """Check the parameters, all problems in one message, and warn the user where the model does."""
        self._require("initialization", "fmi2ExitInitializationMode")
        problems = self._problems(self.values)
        if problems:
            self.fail("cannot initialize: " + "; ".join(problems))
        warning = self.start()
        if warning is not None:
            self.log(self._told(warning), Fmi2Status.warning, "logStatusWarning")
        self._mode = "stepping"  # last, because an interrupt may come before

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the model from `current_time` over `step_size` [s] with its inputs held.

        Returns
        -------
        True; a step that cannot be carried out raises, because importers take False for the end of the run
        """
        end = current_time + step_size
        # A closer look, which costs time, is for what is not right at first sight.
        if self._mode != "stepping" or not (
            0.0 < step_size < inf and -inf < end < inf and end <= self._stop_time
        ):
            self._check_step(current_time, step_size)
        try:
            if self._inputs_changed:
                self._check_inputs(current_time)
                self.hold()
                self._inputs_changed = False
            self.advance(current_time, step_size)
        except OverflowError as error:
            self.fail(str(error))
        except (KeyboardInterrupt, MemoryError) as error:
            self.fail(f"no step from t = {current_time!r} s: {type(error).__name__}")
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
        """Set Real parameters (until initialization ends) and inputs (until the run ends)."""
        self._set(Real, vrs, values)

    def set_integer(self, vrs: Sequence[int], values: Sequence[int]) -> None:
        """Set Integer and Enumeration parameters (until initialization ends)."""
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
            "format": self._format,
            "values": list(self.values),
            **self.save(),
            "mode": self._mode,
            "start_time": self._start_time,
            "stop_time": self._stop_time,
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        """Restore what `_get_fmu_state` returned, in this or another instance or process, or refuse all of it."""
        reason = self._why_refused(state)
        if reason is not None:
            self.fail(f"cannot restore the state: {reason}")
        restored = self._begun(list(state["values"]))
        restored.restore(state)
        restored._inputs_changed = True
        restored._mode = state["mode"]
        restored._start_time, restored._stop_time = state["start_time"], state["stop_time"]
        if restored._mode == "stepping":
            restored.start()
        self._take(restored)

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

    def _problems(self, values: Sequence[Any]) -> list[str]:
        """Return what is wrong with the parameters."""
        return [
            self.interface.describe(variable, value)
            for variable, value in zip(self.interface.variables, values, strict=True)
            if variable.causality == "parameter" and not variable.allows(value)
        ] or self.problems(self._named(values))

    def _named(self, values: Sequence[Any]) -> dict[str, Any]:
        return {name: values[vr] for name, vr in self._reference.items()}

    def _why_refused(self, state: dict[str, Any]) -> str | None:
        """Return why no instance can be in `state`, None if one can: a state may come from anywhere."""
        if "refused" in state:
            return str(state["refused"])
        if state.get("format") != self._format:
            return f"it is of {str(state.get('format'))[:60]!r}, this is {self._format!r}"
        known = {"format": lambda _: True, "values": self._can_be_values, **self.entries, **_TIMES_AND_MODE}
        wrong = [name for name, can_be in known.items() if name not in state or not can_be(state[name])]
        wrong += [str(name)[:60] for name in state if name not in known]
        if not wrong and state["start_time"] > state["stop_time"]:
            wrong = ["stop_time"]
        if not wrong and state["mode"] in ("instantiated", "initialization"):
            wrong = self._differences_from_start(state)
        if not wrong and state["mode"] == "stepping":
            wrong = self._problems(state["values"])
            wrong += [name for name in self.entries if not isfinite(state[name])]
        return f"no instance can be in it ({'; '.join(wrong)})" if wrong else None

    def _differences_from_start(self, state: dict[str, Any]) -> list[str]:
        """Return the entries of a state before the first step that are not those of its start values."""
        begun = self._begun(list(state["values"]))
        return [name for name, entry in begun.save().items() if repr(entry) != repr(state[name])]

    def _can_be_values(self, values: object) -> bool:
        variables = self.interface.variables
        return (
            isinstance(values, list)
            and len(values) == len(variables)
            and all(map(self._can_be_value, variables, values))
        )

    def _can_be_value(self, variable: Variable, value: object) -> bool:
        """Return whether an instance can hold `value`, allowed or not, for `variable`."""
        if variable.is_calculated:
            return value is None
        if self.interface.is_real(variable):
            return is_float(value)
        return isinstance(value, int) and type(value) is not bool and -(2**31) <= value < 2**31

    def _get(self, kind: type, vrs: Sequence[int]) -> list[Any]:
        readers = self._readers[kind]
        try:
            return [readers[vr](self) for vr in vrs]
        except KeyError as error:
            self._refuse_reference(error.args[0], kind)

    def _set(self, kind: type, vrs: Sequence[int], values: Sequence[Any]) -> None:
        for vr in vrs:
            if vr not in self._readers[kind]:
                self._refuse_reference(vr, kind)
            if vr not in self._inputs or self._mode == "terminated":
                self._refuse_unless_settable(self.interface.variables[vr])
        changed = list(self.values)
        for vr, value in zip(vrs, values, strict=True):
            self._inputs_changed |= value != changed[vr]
            changed[vr] = value
        if self._mode in ("instantiated", "initialization"):
            self._take(self._begun(changed))
        else:
            self.values = changed

    def _begun(self, values: list[Any]) -> Self:
        """Return an object with the state that the start values among `values` give."""
        begun = object.__new__(type(self))
        begun.values = values
        begun.begin()
        return begun

    def _take(self, other: CoSimulation) -> None:
        """Take over all that `other` has, at once: an interrupt comes before or after, but not between."""
        self.__dict__.update(other.__dict__)

    def _refuse_reference(self, vr: int, kind: type) -> NoReturn:
        variables = self.interface.variables
        if 0 <= vr < len(variables):
            self.fail(f"{variables[vr].name} (value reference {vr}) is not of type {kind.__name__}")
        vr %= 2**32  # pythonfmu hands it over as a signed number
        self.fail(f"value reference {vr} is unknown (allowed: 0..{len(variables) - 1})")

    def _refuse_unless_settable(self, variable: Variable) -> None:
        if variable.is_calculated:
            self.fail(f"{variable.name} is {_WITH_ARTICLE[variable.causality]}: it cannot be set")
        if self._mode == "terminated":
            self.fail(f"{variable.name} cannot be set: the run has ended, reset the instance first")
        if self._mode == "stepping":
            self.fail(
                f"{variable.name} is a fixed parameter: it can be set until initialization ends, not after"
            )

    def _require(self, mode: str, call: str) -> None:
        if self._mode != mode:
            advice = ": reset the instance first" if MODES.index(self._mode) > MODES.index(mode) else ""
            self.fail(f"{call} is allowed in mode {mode} only, the instance is in mode {self._mode}{advice}")

    def _check_step(self, current_time: float, step_size: float) -> None:
        """Refuse a step that cannot be made; one beyond the stop time by the rounding of the host's clock can.

        That clock may add up its steps, and FMPy takes what is within a relative 1e-9 for the stop time.
        """
        if self._mode != "stepping":
            self.fail(f"no step in mode {self._mode}: {_BEFORE_STEPS[self._mode]}")
        if not 0.0 < step_size < inf:
            self.fail(
                f"no step from t = {current_time!r} s: "
                f"communicationStepSize = {step_size!r} s (allowed: > 0 and finite)"
            )
        largest = max(abs(self._start_time), abs(self._stop_time))
        slack = max(4.0 * float_info.epsilon * largest, min(1e-9 * largest, step_size / 10.0))
        end = current_time + step_size
        if not (-inf < end < inf and end <= self._stop_time + slack):
            self.fail(
                f"no step from t = {current_time!r} s over {step_size!r} s: "
                f"it must end at a finite time, not beyond the stop time ({self._stop_time!r} s)"
            )

    def _check_inputs(self, current_time: float) -> None:
        for vr in self._inputs:
            if not isfinite(self.values[vr]):
                text = self.interface.describe(self.interface.variables[vr], self.values[vr])
                self.fail(f"no step from t = {current_time!r} s: {text}")

    def fail(self, message: str) -> NoReturn:
        """Raise `message`, which the wrapper logs."""
        raise FmuError(self._told(message))

    def _told(self, message: str) -> str:
        """Return `message` as the log gets it, after writing it to stderr where the host gets no log.

        `%` would be a format for FMI's logger, and `#` a value reference (2.1.5).
        """
        text = f"{self.instance_name}: {message}".replace("%", "percent")
        if not hands_on_the_log(self._logger):
            # A host may have no stderr, a closed one, one that cannot write the instance name, or one of its own.
            with suppress(Exception):
                sys.stderr.write(text + "\n")
        return text.replace("#", "##")


def _reader_of_value(vr: int) -> Reader:
    return lambda slave: slave.values[vr]


def is_float(value: object) -> bool:
    """Return whether `value` is a float, the only type that a Real has."""
    return type(value) is float


def is_count(value: object) -> bool:
    """Return whether `value` is a whole number from 0 to the largest fmi2Integer."""
    return type(value) is int and 0 <= value <= INTEGER_MAX


# Mode -> what to do for a step to be possible.
_BEFORE_STEPS = {
    "instantiated": "initialize the instance first",
    "initialization": "call fmi2ExitInitializationMode first",
    "terminated": "reset the instance first",
}

_WITH_ARTICLE = {"output": "an output", "local": "a local variable"}

_TIMES_AND_MODE: Mapping[str, Callable[[Any], bool]] = {
    "mode": lambda value: value in MODES,
    "start_time": lambda value: is_float(value) and isfinite(value),
    "stop_time": lambda value: is_float(value) and not isnan(value),
}
