"""What FMI 2.0 has and pythonfmu lacks: typed variables, units, enumerations, InitialUnknowns, survivable errors."""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Variability, Integer, Real

from .interface import (
    MODEL_NAME,
    RELEASED,
    SOLVER_METHODS,
    TYPES,
    UNITS,
    VARIABLES,
    Type,
    Variable,
    unit_of,
)

TYPE_OF = {type_.name: type_ for type_ in TYPES}

_CAUSALITY = {
    "parameter": {
        "causality": Fmi2Causality.parameter,
        "variability": Fmi2Variability.fixed,
        "initial": Fmi2Initial.exact,
    },
    "input": {"causality": Fmi2Causality.input, "variability": Fmi2Variability.continuous},
    "output": {
        "causality": Fmi2Causality.output,
        "variability": Fmi2Variability.continuous,
        "initial": Fmi2Initial.calculated,
    },
}


class TypedReal(Real):  # type: ignore[misc]  # pythonfmu is not typed
    """A Real with the type, unit, minimum, nominal and exact start value of its row in the interface table."""

    def __init__(self, variable: Variable) -> None:
        super().__init__(variable.name, description=variable.description, **_CAUSALITY[variable.causality])
        self.variable = variable

    def to_xml(self) -> Element:
        """Return the ScalarVariable element."""
        node: Element = super().to_xml()
        real = node[0]
        type_ = TYPE_OF[self.variable.type]
        real.attrib = _real_attributes(type_) | {"declaredType": type_.name}
        if self.variable.range is not None and self.variable.range.minimum is not None:
            real.set("min", repr(self.variable.range.minimum))
        if self.variable.nominal is not None:
            real.set("nominal", repr(self.variable.nominal))
        if self.start is not None:
            real.set("start", repr(float(self.start)))
        return node


class TypedInteger(Integer):  # type: ignore[misc]  # pythonfmu is not typed
    """An Integer, or the Enumeration that FMI reads and writes as an Integer."""

    def __init__(self, variable: Variable) -> None:
        attributes = _CAUSALITY[variable.causality]
        if variable.causality == "output":
            attributes = attributes | {"variability": Fmi2Variability.discrete}
        super().__init__(variable.name, description=variable.description, **attributes)
        self.variable = variable

    def to_xml(self) -> Element:
        """Return the ScalarVariable element."""
        node: Element = super().to_xml()
        if self.variable.type == "SolverMethod":
            node[0].tag = "Enumeration"
            node[0].set("declaredType", "SolverMethod")
        return node


def scalar_variable(variable: Variable) -> TypedReal | TypedInteger:
    """Return the pythonfmu variable of a row of the interface table."""
    return TypedReal(variable) if variable.type in TYPE_OF else TypedInteger(variable)


def _real_attributes(type_: Type) -> dict[str, str]:
    attributes = {"quantity": type_.name, "unit": type_.unit}
    if type_.display_unit is not None:
        attributes["displayUnit"] = type_.display_unit
    return attributes


def _unit_definitions() -> Element:
    root = Element("UnitDefinitions")
    for unit in UNITS:
        node = SubElement(root, "Unit", name=unit.name)
        SubElement(node, "BaseUnit", {base: str(power) for base, power in unit.base.items()})
        for name, factor in unit.display.items():
            SubElement(node, "DisplayUnit", name=name, factor=repr(factor))
    return root


def _type_definitions() -> Element:
    root = Element("TypeDefinitions")
    # Some importers read the items of the first SimpleType only.
    enumeration = SubElement(
        SubElement(root, "SimpleType", name="SolverMethod", description="Integration method"),
        "Enumeration",
    )
    for method, description in SOLVER_METHODS.items():
        SubElement(enumeration, "Item", name=method.name, value=str(method.value), description=description)
    for type_ in TYPES:
        SubElement(SubElement(root, "SimpleType", name=type_.name), "Real", _real_attributes(type_))
    return root


def _model_structure(states: bool) -> Element:
    index = {variable.name: i for i, variable in enumerate(VARIABLES, start=1)}
    inputs = {variable.name for variable in VARIABLES if variable.causality == "input"}
    root = Element("ModelStructure")

    def add(section: Element, variable: Variable, names: Iterable[str]) -> None:
        dependencies = " ".join(str(i) for i in sorted(index[name] for name in names))
        SubElement(section, "Unknown", index=str(index[variable.name]), dependencies=dependencies)

    outputs = [variable for variable in VARIABLES if variable.causality == "output"]
    sections = {"Outputs": outputs}
    if states:
        sections["Derivatives"] = [variable for variable in outputs if variable.derivative_of]
    for name, variables in sections.items():
        section = SubElement(root, name)
        for variable in variables:
            knowns = set(variable.depends_on)
            add(section, variable, knowns if states else knowns & inputs)
    section = SubElement(root, "InitialUnknowns")
    for variable in outputs:
        add(section, variable, variable.starts_from)
    return root


def complete(root: Element, states: bool = False) -> Element:
    """Add to pythonfmu's modelDescription the sections that it does not write, in the order of the schema.

    With `states`, the continuous states and their derivatives are declared, too; FMI 2.0 asks for them where
    directional derivatives are provided.
    """
    root.set("generationDateAndTime", RELEASED)
    after_co_simulation = [child.tag for child in root].index("CoSimulation") + 1
    root.insert(after_co_simulation, _unit_definitions())
    root.insert(after_co_simulation + 1, _type_definitions())
    structure = root.find("ModelStructure")
    if structure is not None:
        root.remove(structure)
    root.append(_model_structure(states))
    if states:
        places = {variable.name: str(i) for i, variable in enumerate(VARIABLES, start=1)}
        for variable, node in zip(VARIABLES, root.iter("ScalarVariable"), strict=True):
            if variable.derivative_of:
                node[0].set("derivative", places[variable.derivative_of])
    return root


def describe(variable: Variable, value: float) -> str:
    """Return `variable` with a value and what is allowed, for messages."""
    allowed = variable.range.text if variable.range is not None else "finite"
    unit = unit_of(variable)
    return f"{variable.name} = {value!r}{' ' + unit if unit else ''} (allowed: {allowed})"


REFERENCES_IN_ADVANCE = 2**29  # below 2^30, from which on Python 3.14 takes an object for immortal


def keep_alive(*objects: object) -> None:
    """Give each object references in advance for those that pythonfmu 0.7 releases too often.

    After every exception its wrapper releases the instance, its class and its log queue once more than it holds
    them, whether the exception is one of ours, Control-C between any two lines, or an argument that the wrapper itself
    cannot convert. Nothing that runs after the fact sees them all. An object so kept is never freed.
    """
    for item in objects:
        if object.__basicsize__ == 16:  # the count is the first word, as in every CPython but special builds
            ctypes.c_ssize_t.from_address(id(item)).value += REFERENCES_IN_ADVANCE
        else:
            for _ in range(1000):
                ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))


def release_wrappers() -> None:
    """Let the wrappers that are loaded release their global state.

    pythonfmu 0.7 does so in a destructor of its library. When the library is unloaded that is early enough; at the end
    of the process, on Linux, that destructor runs after those of C++ have freed the state, which now and then aborts
    the process. Released before, there is nothing left to free twice.
    """
    maps = Path("/proc/self/maps").read_text("utf-8", "surrogateescape")
    paths = {line.removesuffix(" (deleted)").split(maxsplit=5)[-1] for line in maps.splitlines()}
    for path in paths:
        if path.endswith(f"/{MODEL_NAME}.so"):
            with suppress(OSError):  # loaded under another name, and its file is gone
                ctypes.CDLL(path, mode=os.RTLD_NOLOAD | os.RTLD_NOW).finalizePythonInterpreter()


if sys.platform.startswith("linux"):
    atexit.register(release_wrappers)
