"""What can be set in the FMU, and how a value is written: by unit, display unit or name of the model description."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

from .errors import WrongUseError


@dataclass(frozen=True)
class Variable:
    """A variable that can be set.

    Attributes
    ----------
    unit : of its values, "" for a pure number
    units : factor and offset of the units it can be given in: number = factor*value + offset
    items : the numbers of an enumeration by name, empty for a Real
    start : the value it has if none is set, in `unit`
    """

    name: str
    unit: str
    units: Mapping[str, tuple[float, float]]
    items: Mapping[str, int]
    start: float

    def value(self, number: float, unit: str = "") -> float:
        """Return `number`, which is given in `unit`, in the unit of the variable.

        Raises
        ------
        WrongUseError : not finite, another unit, or no whole number for an enumeration
        """
        if not isfinite(number):
            raise WrongUseError(f"{self.name} = {number}: must be finite")
        if self.items and number != int(number):
            raise WrongUseError(f"{self.name} = {number:g}: must be a whole number or {self._names()}")
        if not unit:
            return number
        if unit not in self.units:
            allowed = ", ".join(self.units) or "none"
            raise WrongUseError(f"{self.name}: the FMU does not know the unit {unit!r} (allowed: {allowed})")
        factor, offset = self.units[unit]
        return (number - offset) / factor

    def read(self, text: str, unit: str = "") -> float:
        """Return the value that `text` says: a number, or the name of an item.

        Raises
        ------
        WrongUseError : neither of both, or what `value` raises
        """
        if text in self.items:
            return self.value(self.items[text], unit)
        try:
            number = float(text)
        except ValueError:
            known = f"a number or {self._names()}" if self.items else "a number"
            raise WrongUseError(f"{self.name} = {text!r}: must be {known}") from None
        return self.value(number, unit)

    def shown(self, value: float) -> float | str:
        """Return a value as it stands in a row: the name of an item, where it has one."""
        if not self.items:
            return value
        return next((name for name, number in self.items.items() if number == value), str(int(value)))

    def _names(self) -> str:
        return "one of " + ", ".join(self.items)


@dataclass(frozen=True)
class Interface:
    """The variables of an FMU that can be set, by name, and its default experiment.

    Attributes
    ----------
    guid : of the FMU
    stop, step : end and communication step of the default experiment [s]
    others : the variables that cannot be set, and what they are
    """

    guid: str
    stop: float
    step: float
    variables: Mapping[str, Variable]
    others: Mapping[str, str]

    def variable(self, name: str) -> Variable:
        """Return the variable `name`.

        Raises
        ------
        WrongUseError : there is none, or it cannot be set
        """
        if name in self.others:
            kind = self.others[name]
            article = "an" if kind[0] in "aeiou" else "a"
            raise WrongUseError(f"{name} is {article} {kind} and cannot be set (allowed: {self._names()})")
        if name not in self.variables:
            raise WrongUseError(f"the FMU has no variable {name!r} (allowed: {self._names()})")
        return self.variables[name]

    def _names(self) -> str:
        return ", ".join(self.variables)


def interface(description: Any) -> Interface:
    """Return what a model description, as FMPy reads it, says of the variables that can be set."""
    display = {
        unit.name: {one.name: (one.factor, one.offset) for one in unit.displayUnits}
        for unit in description.unitDefinitions
    }
    variables, others = {}, {}
    for variable in description.modelVariables:
        if variable.causality not in ("parameter", "input"):
            others[variable.name] = variable.causality
            continue
        declared = variable.declaredType
        unit = variable.unit or (declared and declared.unit) or ""
        variables[variable.name] = Variable(
            name=variable.name,
            unit=unit,
            units={unit: (1.0, 0.0)} | display.get(unit, {}) if unit else {},
            items={item.name: int(item.value) for item in declared.items} if declared else {},
            start=float(variable.start),
        )
    default = description.defaultExperiment
    return Interface(description.guid, float(default.stopTime), float(default.stepSize), variables, others)
