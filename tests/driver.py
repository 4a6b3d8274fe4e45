"""A thin driver over FMPy's low-level API: calls return their status, and what is logged is kept."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import Array, byref, c_char, c_double, c_int, c_size_t, c_uint, create_string_buffer
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from fmpy import calloc, extract, free, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2FMUstate,
)
from fmpy.model_description import ModelDescription

from tests.plants import PLANTS, Plant

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)


def is_error(status: int) -> bool:
    """Return whether `status` is an error; pythonfmu knows Fatal only."""
    return status in (ERROR, FATAL)


class Log(NamedTuple):
    """A call of the logger."""

    status: int
    category: str
    text: str


def plant_of(description: ModelDescription) -> Plant:
    """Return the model of an FMU."""
    return PLANTS[description.modelName.removesuffix("Native")]


class Fmu:
    """An extracted FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path, self.folder = path, folder
        extract(str(path), str(folder))
        self.description = read_model_description(str(folder))
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.type = {
            v.name: "Real" if v.type == "Real" else "Integer" for v in self.description.modelVariables
        }
        # What the description declares is all in which the conduct of the carriers differs, and where they tell what.
        about = self.description.coSimulation
        self.name = about.modelIdentifier
        self.native = not about.needsExecutionTool
        self.plant = plant_of(self.description)
        # pythonfmu logs an exception as Fatal and without a category.
        self.error = (ERROR, "logStatusError") if self.native else (FATAL, "")
        self.optional_functions = {
            "fmi2GetDirectionalDerivative": about.providesDirectionalDerivative,
            "fmi2SetRealInputDerivatives": about.canInterpolateInputs,
            "fmi2GetRealOutputDerivatives": about.maxOutputDerivativeOrder > 0,
        }

    def places(self, logging: bool) -> tuple[bool, bool]:
        """Return whether errors and warnings are told in the log and on stderr.

        Without logging pythonfmu drops its messages, so its FMU tells them on stderr.
        """
        return (True, False) if self.native else (logging, not logging)

    @contextmanager
    def instance(self, name: str | None = None, *, logging: bool = True) -> Iterator[Instance]:
        """Yield an instance that is freed in the end; without a name it has that of the system."""
        instance = Instance(self, name, logging)
        try:
            yield instance
        finally:
            instance.free()

    @contextmanager
    def running(self, start: Mapping[str, float] | None = None, time: float = 0.0) -> Iterator[Instance]:
        """Yield an instance that is initialized with the start values of `start`."""
        with self.instance() as instance:
            assert instance.initialize(start, time=time) <= WARNING, instance.errors
            yield instance


class Instance:
    """An instance of an FMU."""

    def __init__(self, fmu: Fmu, name: str | None = None, logging: bool = True) -> None:
        self.fmu = fmu
        self.log: list[Log] = []
        self.slave = FMU2Slave(
            guid=fmu.description.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            instanceName=name or fmu.plant.system,
        )
        log = self.log

        def logger(_: object, __: bytes, status: int, category: bytes | None, text: bytes) -> None:
            # pythonfmu puts a line of its own before the text of an exception.
            sentence = text.decode().removeprefix("Fatal py exception encountered: ")
            sentence = sentence.partition("PyObject_CallMethod\n")[2] or sentence
            log.append(Log(status, "" if category is None else category.decode(), sentence))

        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(logger)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.slave.instantiate(callbacks=callbacks, loggingOn=logging)

    def free(self) -> None:
        self.slave.freeInstance()

    @property
    def errors(self) -> list[str]:
        """The texts logged as errors."""
        return [entry.text for entry in self.log if is_error(entry.status)]

    @property
    def warnings(self) -> list[Log]:
        return [entry for entry in self.log if entry.status == WARNING]

    def call(self, function: str, *arguments: Any) -> int:
        """Call `function` without its component and return the status."""
        try:
            return int(getattr(self.slave, function)(self.slave.component, *arguments))
        except FMICallException as error:
            return int(error.status)

    def initialize(
        self, start: Mapping[str, float] | None = None, *, time: float = 0.0, stop: float | None = None
    ) -> int:
        """Set start values and initialize; return the worst status."""
        statuses = [self.set(name, value) for name, value in (start or {}).items()]
        statuses.append(self.set_up(time, stop))
        statuses.append(self.call("fmi2EnterInitializationMode"))
        statuses.append(self.call("fmi2ExitInitializationMode"))
        return max(statuses)

    def set_up(self, time: float, stop: float | None = None) -> int:
        return self.call("fmi2SetupExperiment", 0, 0.0, time, stop is not None, stop or 0.0)

    def start(
        self, values: Mapping[str, float] | None = None, *, time: float = 0.0, stop: float | None = None
    ) -> None:
        """Initialize a reset instance with start values, none of which is set with an error."""
        assert self.reset() == OK
        assert self.initialize(values, time=time, stop=stop) <= WARNING, self.errors

    def refusal(self, status: int) -> str:
        """Return the text of the one error since the last, which was that of a call with this status."""
        (entry,) = [entry for entry in self.log if is_error(entry.status)]
        assert (entry.status, entry.category) == self.fmu.error
        assert status == entry.status
        self.log.clear()
        return entry.text

    def unwritten(self, n: int, function: str, *arguments: Any) -> str:
        """Return the text of the error of a call that may touch none of `n` Reals, which are its last argument."""
        values = reals([7.0] * n)
        text = self.refusal(self.call(function, *arguments, values))
        assert list(values) == [7.0] * n
        return text

    def reset(self) -> int:
        return self.call("fmi2Reset")

    def step(self, time: float, duration: float) -> int:
        return self.call("fmi2DoStep", time, duration, 1)

    def run(self, times: Sequence[float]) -> None:
        """Step from each of `times` to the next."""
        for time, end in pairwise(times):
            assert self.step(time, end - time) == OK, self.errors

    def set(self, name: str, value: float) -> int:
        return self.set_references(self.fmu.type[name], [self.fmu.reference[name]], [value])

    def set_references(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> int:
        """Call fmi2SetReal, fmi2SetInteger, fmi2SetBoolean."""
        element = c_double if kind == "Real" else c_int
        n = len(references)
        return self.call(f"fmi2Set{kind}", (c_uint * n)(*references), n, (element * n)(*values))

    def get(self, *names: str) -> tuple[float, ...]:
        """Return values, which must be readable."""
        values = []
        for name in names:
            status, value = self.get_references(self.fmu.type[name], [self.fmu.reference[name]])
            assert status == OK, self.errors
            values += value
        return tuple(values)

    def get_references(self, kind: str, references: Sequence[int]) -> tuple[int, list[float]]:
        """Call fmi2GetReal, fmi2GetInteger, fmi2GetBoolean; return the status and the values."""
        n = len(references)
        values = ((c_double if kind == "Real" else c_int) * n)()
        return self.call(f"fmi2Get{kind}", (c_uint * n)(*references), n, values), list(values)

    def unreadable(self, name: str) -> str:
        """Return the text of the error with which the value of `name` is refused."""
        status, _ = self.get_references(self.fmu.type[name], [self.fmu.reference[name]])
        return self.refusal(status)

    def references(self, *names: str) -> Array[c_uint]:
        """Return the value references of variables as an argument."""
        return (c_uint * len(names))(*(self.fmu.reference[name] for name in names))

    def input_derivatives(self, values: Mapping[int, float]) -> int:
        """Set derivatives of the input, by their order."""
        n = len(values)
        orders = integers(values)
        return self.call(
            "fmi2SetRealInputDerivatives",
            self.references(*[self.fmu.plant.input] * n),
            n,
            orders,
            reals(values.values()),
        )

    def output_derivative(self, name: str) -> float:
        value = reals([0.0])
        status = self.call("fmi2GetRealOutputDerivatives", self.references(name), 1, integers([1]), value)
        assert status == OK, self.errors
        return value[0]

    def directional_derivative(
        self, unknowns: Sequence[str], knowns: Sequence[str], direction: Sequence[float]
    ) -> list[float]:
        values = reals([0.0] * len(unknowns))
        assert self.call(*self.directional(unknowns, knowns, direction), values) == OK, self.errors
        return list(values)

    def directional(
        self, unknowns: Sequence[str], knowns: Sequence[str], direction: Sequence[float]
    ) -> tuple[Any, ...]:
        """Return a call of fmi2GetDirectionalDerivative up to its last argument, the values."""
        return (
            "fmi2GetDirectionalDerivative",
            self.references(*unknowns),
            len(unknowns),
            self.references(*knowns),
            len(knowns),
            reals(direction),
        )

    def partial(self, unknown: str, known: str) -> float:
        return self.directional_derivative([unknown], [known], [1.0])[0]

    def save(self) -> fmi2FMUstate:
        state = fmi2FMUstate()
        assert self.call("fmi2GetFMUstate", byref(state)) == OK, self.errors
        return state

    def restore(self, state: fmi2FMUstate) -> int:
        return self.call("fmi2SetFMUstate", state)

    def free_state(self, state: fmi2FMUstate) -> None:
        assert self.call("fmi2FreeFMUstate", byref(state)) == OK

    def serialize(self, state: fmi2FMUstate) -> bytes:
        size = c_size_t()
        assert self.call("fmi2SerializedFMUstateSize", state, byref(size)) == OK
        data = create_string_buffer(size.value)
        assert self.call("fmi2SerializeFMUstate", state, data, size.value) == OK
        return data.raw

    def deserialize(self, data: bytes) -> tuple[int, fmi2FMUstate]:
        state = fmi2FMUstate()
        buffer = (c_char * len(data)).from_buffer_copy(data)
        return self.call("fmi2DeSerializeFMUstate", buffer, len(data), byref(state)), state

    def restore_bytes(self, data: bytes) -> int:
        """Deserialize and restore; return the worse status."""
        status, state = self.deserialize(data)
        if is_error(status):
            return status
        status = self.restore(state)
        self.free_state(state)
        return status


def reals(values: Iterable[float]) -> Array[c_double]:
    """Return values as an argument."""
    held = list(values)
    return (c_double * len(held))(*held)


def integers(values: Iterable[int]) -> Array[c_int]:
    """Return values as an argument."""
    held = list(values)
    return (c_int * len(held))(*held)


def collect() -> None:
    """Let Python find what was released too often."""
    for _ in range(3):
        gc.collect()
