"""A slave for models of second order, der(x) = v, der(v) = a(x, v) + drive; drive is a multiple of the one input."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite, nan
from operator import attrgetter
from typing import Any, ClassVar, NamedTuple, Protocol

from methods.integration import Integration
from methods.motion import Motion
from methods.solvers import SolverMethod

from .shell import INTEGER_MAX, CoSimulation, is_count, is_float


class Names(NamedTuple):
    """What a model calls its variables and, for messages, itself and its input."""

    x: str
    v: str
    a: str
    energy: str
    input: str
    system: str  # in messages, "for this ..."
    quantity: str  # of the input, in messages: "check the ..."
    damping_time: str  # the inverse of the damping rate, in terms of the parameters


class Model(Protocol):
    """What is asked of a model: a NamedTuple of its parameters."""

    def motion(self, u: float) -> Motion:
        """Return der(v) under an input `u` that is held."""

    def out_of_range(self) -> list[str]:
        """Return what cannot be computed with although each parameter by itself is allowed."""

    def energy(self, x: float, v: float) -> float:
        """Return the mechanical energy [J]."""


class SecondOrder(CoSimulation):
    """A slave of second order; a model adds its interface, its class and its names.

    The start values of x and v are the parameters of the same names with "_start".
    """

    model: ClassVar[Any]
    names: ClassVar[Names]

    def __init_subclass__(cls) -> None:
        """Make the tables of the shell from the names."""
        names = cls.names
        cls.entries = {names.x: is_float, names.v: is_float, "nfev": is_count}
        cls.calculated = {
            names.x: attrgetter("x"),
            names.v: attrgetter("v"),
            names.a: partial(cls._computed, name=names.a, compute=cls._acceleration),
            names.energy: partial(cls._computed, name=names.energy, compute=cls._energy),
            "solver.nfev": cls._evaluations,
        }
        super().__init_subclass__()

    def begin(self) -> None:
        """Take the state from the start values; they may be wrong before initialization ends."""
        names = self.names
        self.x, self.v, self.nfev = self[f"{names.x}_start"], self[f"{names.v}_start"], 0
        self.parameters: Model = self.model(*map(self.__getitem__, self.model._fields))

    @classmethod
    def problems(cls, values: Mapping[str, Any]) -> list[str]:
        """Return what the model cannot compute with although each parameter by itself is allowed."""
        problems: list[str] = cls.model(*(values[name] for name in cls.model._fields)).out_of_range()
        return problems

    def start(self) -> str | None:
        """Prepare the method; return a warning of an unstable step size."""
        self.integration = Integration(
            SolverMethod(self["solver.method"]),
            self["solver.stepSize"],
            self.parameters.motion(0.0),
            self.names.system,
            self.names.quantity,
        )
        return self.integration.warning()

    def hold(self) -> None:
        """Take over the input for the steps to come."""
        self.integration.hold(self.parameters.motion(self[self.names.input]))

    def advance(self, time: float, duration: float) -> None:
        """Advance the state from `time` over `duration` [s], or raise OverflowError with the reason."""
        x, v, nfev = self.integration.advance(self.x, self.v, time, duration)
        self.x, self.v, self.nfev = x, v, self.nfev + nfev

    def save(self) -> dict[str, Any]:
        """Return what belongs to the state besides the values of the variables."""
        return {self.names.x: self.x, self.names.v: self.v, "nfev": self._evaluations()}

    def restore(self, entries: Mapping[str, Any]) -> None:
        """Take over what `save` returned."""
        self.x, self.v, self.nfev = entries[self.names.x], entries[self.names.v], entries["nfev"]

    def _evaluations(self) -> int:
        return min(self.nfev, INTEGER_MAX)

    def _acceleration(self) -> float:
        return self.parameters.motion(self[self.names.input]).acceleration()(self.x, self.v)

    def _energy(self) -> float:
        return self.parameters.energy(self.x, self.v)

    def _computed(self, name: str, compute: Callable[[Any], float]) -> float:
        """Return the value of an output, or fail where it is not finite."""
        try:
            value = compute(self)
        except (ValueError, ZeroDivisionError):  # math.sin(inf); a mass of zero, not checked yet
            value = nan
        if not isfinite(value):
            known = {self.names.x: self.x, self.names.v: self.v, self.names.input: self[self.names.input]}
            variables = {variable.name: variable for variable in self.interface.variables}
            texts = (f"{key} = {known[key]!r} {self.interface.unit_of(variables[key])}" for key in known)
            self.fail(f"{name} is out of the range of a double at {', '.join(texts)}")
        return value + 0.0  # -0.0 becomes 0.0
