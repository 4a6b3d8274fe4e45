"""What the rows of an interface are: units, types, ranges, variables. An interface is made of such tables alone."""

from __future__ import annotations

from collections.abc import Mapping
from math import ulp
from sys import float_info
from types import MappingProxyType
from typing import NamedTuple
from zlib import crc32


class Unit(NamedTuple):
    """A unit: its exponents of the SI base units and, in `display`, unit -> factor (display = factor*value)."""

    name: str
    base: Mapping[str, int]
    display: Mapping[str, float] = MappingProxyType({})


class Type(NamedTuple):
    """A type of Real variables, best a quantity of the Modelica Standard Library (Modelica.Units.SI)."""

    name: str
    unit: str
    display_unit: str | None = None


class Item(NamedTuple):
    """A value of an enumeration."""

    name: str
    value: int
    description: str


class Enumeration(NamedTuple):
    """A type of variables that FMI reads and writes as Integers."""

    name: str
    description: str
    items: tuple[Item, ...]


class Range(NamedTuple):
    """Allowed values, `lowest` to `highest`: `text` for the user, `minimum` for the XML where there is one."""

    text: str
    lowest: float
    highest: float = float_info.max
    minimum: float | None = None

    def allows(self, value: float) -> bool:
        """Return whether `value` is allowed."""
        return self.lowest <= value <= self.highest


FINITE = Range("finite", -float_info.max)
POSITIVE = Range("> 0", ulp(0.0), minimum=0.0)
NOT_NEGATIVE = Range(">= 0", 0.0, minimum=0.0)


class Variable(NamedTuple):
    """A variable of the FMU; its value reference is its place in the table.

    Attributes
    ----------
    name : name in the FMU
    type : name of a `Type` or an `Enumeration`, or "Integer"
    causality : "parameter" (fixed, exact), "input" (continuous), "output" or "local" (calculated)
    description : one line, no unit
    start : start value [unit of the type] of a parameter or an input
    range : allowed values of a parameter or an input
    nominal : typical magnitude where 1 would mislead
    derivative_of : of a variable that is the time derivative of another, the name of that one
    depends_on : of an output, the states and inputs it depends on at a communication point
    starts_from : of an output, the parameters and inputs it depends on at initialization
    """

    name: str
    type: str
    causality: str
    description: str
    start: float | None = None
    range: Range | None = None
    nominal: float | None = None
    derivative_of: str | None = None
    depends_on: tuple[str, ...] = ()
    starts_from: tuple[str, ...] = ()

    @property
    def is_calculated(self) -> bool:
        """Whether the FMU calculates the variable, so that it cannot be set."""
        return self.causality in ("output", "local")

    def allows(self, value: float) -> bool:
        """Return whether `value` is allowed for this parameter or input."""
        return self.range is None or self.range.allows(value)


class Experiment(NamedTuple):
    """The default experiment: start, stop and communication step [s]."""

    start: float
    stop: float
    step: float


class Interface(NamedTuple):
    """All that an importer can know of an FMU before it runs.

    modelDescription.xml, the documentation in the FMU and the tables in README are made from it, and the checks of the
    parameters read the ranges from it.

    Attributes
    ----------
    model_name : name of the model and of its class
    version, description, author, license : as in modelDescription.xml
    released : date and time of the version, "YYYY-MM-DDThh:mm:ssZ"
    experiment : the default experiment
    units, types, enumerations, variables : the tables
    """

    model_name: str
    version: str
    released: str
    description: str
    author: str
    license: str
    experiment: Experiment
    units: tuple[Unit, ...]
    types: tuple[Type, ...]
    enumerations: tuple[Enumeration, ...]
    variables: tuple[Variable, ...]

    def references(self) -> dict[str, int]:
        """Return the value reference of each variable by name."""
        return {variable.name: reference for reference, variable in enumerate(self.variables)}

    def is_real(self, variable: Variable) -> bool:
        """Return whether `variable` is read and written as a Real."""
        return any(type_.name == variable.type for type_ in self.types)

    def unit_of(self, variable: Variable) -> str:
        """Return the unit of `variable`, "" where it has none."""
        return next((type_.unit for type_ in self.types if type_.name == variable.type), "")

    def describe(self, variable: Variable, value: float) -> str:
        """Return `variable` with a value and what is allowed, for messages."""
        allowed = variable.range.text if variable.range is not None else "finite"
        unit = self.unit_of(variable)
        return f"{variable.name} = {value!r}{' ' + unit if unit else ''} (allowed: {allowed})"

    def state_format(self, model_name: str) -> str:
        """Return the origin that a saved state names: model, version and a digest of what its values mean."""
        rows = [
            f"{variable.name} {variable.type} {self.unit_of(variable)} {variable.causality} "
            f"{variable.range.text if variable.range else ''}"
            for variable in self.variables
        ]
        rows += [
            f"{item.name} {item.value}" for enumeration in self.enumerations for item in enumeration.items
        ]
        return f"{model_name} {self.version} {crc32(chr(10).join(rows).encode()):08x}"
