"""modelDescription.xml from the tables of an interface: what FMI 2.0 has and pythonfmu does not write."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Variability, Integer, Real

from .tables import Interface, Type, Variable

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
    "local": {
        "causality": Fmi2Causality.local,
        "variability": Fmi2Variability.discrete,
        "initial": Fmi2Initial.calculated,
    },
}


class TypedReal(Real):  # type: ignore[misc]  # pythonfmu is not typed
    """A Real with the type, unit, minimum, nominal and exact start value of its row in the table."""

    def __init__(self, variable: Variable, type_: Type) -> None:
        super().__init__(variable.name, description=variable.description, **_CAUSALITY[variable.causality])
        self.variable, self.type = variable, type_

    def to_xml(self) -> Element:
        """Return the ScalarVariable element."""
        node: Element = super().to_xml()
        real = node[0]
        real.attrib = _real_attributes(self.type) | {"declaredType": self.type.name}
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
        super().__init__(variable.name, description=variable.description, **_CAUSALITY[variable.causality])
        self.variable = variable

    def to_xml(self) -> Element:
        """Return the ScalarVariable element."""
        node: Element = super().to_xml()
        if self.variable.type != "Integer":
            node[0].tag = "Enumeration"
            node[0].set("declaredType", self.variable.type)
        return node


def scalar_variable(interface: Interface, variable: Variable) -> TypedReal | TypedInteger:
    """Return the pythonfmu variable of a row of the table."""
    type_ = next((type_ for type_ in interface.types if type_.name == variable.type), None)
    return TypedInteger(variable) if type_ is None else TypedReal(variable, type_)


def _real_attributes(type_: Type) -> dict[str, str]:
    attributes = {"quantity": type_.name, "unit": type_.unit}
    if type_.display_unit is not None:
        attributes["displayUnit"] = type_.display_unit
    return attributes


def _unit_definitions(interface: Interface) -> Element:
    root = Element("UnitDefinitions")
    for unit in interface.units:
        node = SubElement(root, "Unit", name=unit.name)
        SubElement(node, "BaseUnit", {base: str(power) for base, power in unit.base.items()})
        for name, factor in unit.display.items():
            SubElement(node, "DisplayUnit", name=name, factor=repr(factor))
    return root


def _type_definitions(interface: Interface) -> Element:
    root = Element("TypeDefinitions")
    # Some importers read the items of the first SimpleType only.
    for enumeration in interface.enumerations:
        simple = SubElement(root, "SimpleType", name=enumeration.name, description=enumeration.description)
        items = SubElement(simple, "Enumeration")
        for item in enumeration.items:
            SubElement(items, "Item", name=item.name, value=str(item.value), description=item.description)
    for type_ in interface.types:
        SubElement(SubElement(root, "SimpleType", name=type_.name), "Real", _real_attributes(type_))
    return root


def _model_structure(interface: Interface, states: bool) -> Element:
    index = {name: reference + 1 for name, reference in interface.references().items()}
    inputs = {variable.name for variable in interface.variables if variable.causality == "input"}
    root = Element("ModelStructure")

    def add(section: Element, variable: Variable, names: Iterable[str]) -> None:
        dependencies = " ".join(str(i) for i in sorted(index[name] for name in names))
        SubElement(section, "Unknown", index=str(index[variable.name]), dependencies=dependencies)

    outputs = [variable for variable in interface.variables if variable.causality == "output"]
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


def complete(root: Element, interface: Interface, states: bool = False) -> Element:
    """Add to pythonfmu's modelDescription the sections that it does not write, in the order of the schema.

    With `states`, the continuous states and their derivatives are declared, too; FMI 2.0 asks for them where
    directional derivatives are provided.
    """
    root.set("generationDateAndTime", interface.released)
    after_co_simulation = [child.tag for child in root].index("CoSimulation") + 1
    root.insert(after_co_simulation, _unit_definitions(interface))
    root.insert(after_co_simulation + 1, _type_definitions(interface))
    structure = root.find("ModelStructure")
    if structure is not None:
        root.remove(structure)
    root.append(_model_structure(interface, states))
    if states:
        index = {name: str(reference + 1) for name, reference in interface.references().items()}
        for variable, node in zip(interface.variables, root.iter("ScalarVariable"), strict=True):
            if variable.derivative_of:
                node[0].set("derivative", index[variable.derivative_of])
    return root
