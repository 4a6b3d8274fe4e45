"""A random walk over the calls of FMI."""

from __future__ import annotations

from ctypes import byref, c_char_p, c_double, c_int, c_uint
from math import inf, isfinite, nan
from random import Random
from typing import Any

from methods.solvers import SolverMethod
from tests.driver import DISCARD, ERROR, FATAL, OK, WARNING, Fmu, Instance, collect, is_error


class Walk:
    """A random walk over the calls of FMI, legal and illegal, with legal and illegal arguments.

    Left out is what would make the walk itself the culprit: pointers and states that are not those of the FMU.
    """

    INSTANCES = 4
    NUMBERS = (
        0.0,
        1e-300,
        1e-6,
        0.001,
        0.01,
        1.0,
        1 / 3,
        100.0,
        1e6,
        1e300,
        1.7e308,
        -1.0,
        -1e6,
        nan,
        inf,
        -inf,
    )
    REFERENCES = (*range(-1, 16), 2**31 - 1, 2**31, 2**32 - 1)

    def __init__(self, fmu: Fmu, random: Random) -> None:
        self.fmu, self.random = fmu, random
        self.instances: list[Instance] = []
        self.states: list[Any] = []
        self.calls = self.errors = 0
        self.actions = {
            self.new: 1,
            self.free: 1,
            self.legal_start: 4,
            self.set_up: 2,
            self.order: 3,
            self.legal_steps: 5,
            self.any_step: 5,
            self.set_reals: 6,
            self.access: 6,
            self.strings: 1,
            self.save: 3,
            self.restore: 3,
            self.bytes: 2,
            self.status: 2,
            self.optional: 1,
            self.logging: 1,
        }

    def call(self) -> None:
        """Make one call (or one short legal sequence) and check its status."""
        if not self.instances:
            self.new()
        self.instance = self.random.choice(self.instances)
        (action,) = self.random.choices(list(self.actions), list(self.actions.values()))
        status = action()
        self.calls += 1
        self.errors += is_error(status)
        # Pending is for asynchronous slaves, and Discard would end the run in most importers.
        assert status in (OK, WARNING, ERROR, FATAL), (action.__name__, status)
        if is_error(status):
            assert self.instance.log, action.__name__  # never without a reason
        self.instance.log.clear()

    def end(self) -> None:
        for state in self.states:
            self.instances[0].free_state(state)
        while self.instances:
            self.instances.pop().free()
        collect()

    def new(self) -> int:
        if len(self.instances) < self.INSTANCES:
            self.instances.append(Instance(self.fmu, "50% of %s"))
        return OK

    def free(self) -> int:
        if len(self.instances) > 1:
            self.instances.remove(self.instance)
            self.instance.free()
        return OK

    def legal_start(self) -> int:
        assert self.instance.reset() == OK
        start = {
            self.fmu.plant.x_start: self.random.uniform(-4.0, 4.0),
            self.fmu.plant.drag: 10.0 ** self.random.uniform(-3, 9),
            "solver.method": self.random.choice(list(SolverMethod)),
        }
        return self.instance.initialize(start)

    def legal_steps(self) -> int:
        """Three steps; on OK the outputs are finite."""
        status = max(self.instance.step(0.01 * k, 0.01) for k in range(3))
        if not is_error(status):
            assert all(map(isfinite, self.instance.get(*self.fmu.plant.state)))
        return status

    def number(self) -> float:
        return self.random.choice(self.NUMBERS)

    def set_up(self) -> int:
        flag = self.random.randint(0, 1)
        return self.instance.call(
            "fmi2SetupExperiment", flag, self.number(), self.number(), flag, self.number()
        )

    def order(self) -> int:
        calls = ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset")
        return self.instance.call(self.random.choice(calls))

    def any_step(self) -> int:
        duration = self.number()
        # A step of hours is legal, but would take its time.
        return self.instance.step(self.number(), duration if not 1.0 < duration < 1e300 else 0.1)

    def set_reals(self) -> int:
        names = self.random.sample(sorted(self.fmu.reference), 3)
        references = [self.fmu.reference[name] for name in names]
        return self.instance.set_references("Real", references[:1], [self.number()])

    def access(self) -> int:
        kind = self.random.choice(("Real", "Integer", "Boolean"))
        references = [r % 2**32 for r in self.random.choices(self.REFERENCES, k=self.random.randint(0, 3))]
        if self.random.random() < 0.5:
            return self.instance.get_references(kind, references)[0]
        values = [self.number() if kind == "Real" else self.random.randint(-2, 5) for _ in references]
        return self.instance.set_references(kind, references, values)

    def strings(self) -> int:
        access = self.random.choice(("Get", "Set"))
        reference = (c_uint * 1)(self.random.choice(self.REFERENCES) % 2**32)
        return self.instance.call(f"fmi2{access}String", reference, 1, (c_char_p * 1)(b"%n"))

    def save(self) -> int:
        if len(self.states) > 20:
            self.instance.free_state(self.states.pop(self.random.randrange(20)))
        self.states.append(self.instance.save())
        return OK

    def restore(self) -> int:
        if not self.states:
            return OK
        status = self.instance.restore(self.random.choice(self.states))
        assert status == OK
        return status

    def bytes(self) -> int:
        state = self.instance.save()
        data = bytearray(self.instance.serialize(state))
        self.instance.free_state(state)
        damaged = self.random.random() < 0.5
        if damaged:
            data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        status = self.instance.restore_bytes(bytes(data))
        assert is_error(status) == damaged
        return status

    def status(self) -> int:
        kind = self.random.choice(("", "Real", "Integer", "Boolean"))
        value = c_double() if kind == "Real" else c_int()
        status = self.instance.call(f"fmi2Get{kind}Status", self.random.randint(0, 3), byref(value))
        return OK if status == DISCARD else status  # Discard: "nothing to report", as no step is ever pending

    def optional(self) -> int:
        function, arguments = self.random.choice(
            (
                ("fmi2CancelStep", ()),
                ("fmi2GetDirectionalDerivative", (None, 0, None, 0, None, None)),
                ("fmi2SetRealInputDerivatives", (None, 0, None, None)),
                ("fmi2GetRealOutputDerivatives", (None, 0, None, None)),
            )
        )
        status = self.instance.call(function, *arguments)
        assert is_error(status) or self.fmu.optional_functions.get(function, False)
        return status

    def logging(self) -> int:
        return self.instance.call("fmi2SetDebugLogging", 1, 0, None)
