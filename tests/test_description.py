"""modelDescription.xml of both FMUs, written out: what the tables of the sources say does not count here."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest

from tests.driver import Fmu

pytestmark = pytest.mark.parametrize("carrier", ["pythonfmu", "native"], indirect=True, scope="session")


@pytest.fixture(scope="session")
def root(fmu: Fmu) -> Element:
    return ElementTree.fromstring((fmu.folder / "modelDescription.xml").read_text("utf-8"))


PARAMETER = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
INPUT = {"causality": "input", "variability": "continuous"}  # FMI 2.0, table on page 49: initial = exact
OUTPUT = {"causality": "output", "variability": "continuous", "initial": "calculated"}
# There are importers that read every output as a Real: what is none is a local variable.
LOCAL = {"causality": "local", "variability": "discrete", "initial": "calculated"}


def real(declared: str, unit: str, **numbers: float) -> tuple[str, dict[str, Any]]:
    """Return a Real whose type has the name of its quantity; angles are shown in degrees."""
    shown = {"displayUnit": "deg"} if unit == "rad" else {}
    return "Real", {"declaredType": declared, "quantity": declared, "unit": unit} | shown | numbers


# The value reference is the place, from 0; the index in ModelStructure is the place, from 1.
VARIABLES: list[tuple[str, dict[str, str], tuple[str, dict[str, Any]]]] = [
    ("m", PARAMETER, real("Mass", "kg", min=0.0, start=1.0)),
    ("L", PARAMETER, real("Length", "m", min=0.0, start=1.0)),
    (
        "gamma",
        PARAMETER,
        real("TranslationalDampingConstant", "N.s/m", min=0.0, nominal=0.001, start=0.002),
    ),
    ("g", PARAMETER, real("Acceleration", "m/s2", nominal=10.0, start=9.80665)),
    ("phi_start", PARAMETER, real("Angle", "rad", start=0.5235987755982988)),  # 30 deg
    ("w_start", PARAMETER, real("AngularVelocity", "rad/s", start=0.0)),
    ("solver.method", PARAMETER, ("Enumeration", {"declaredType": "SolverMethod", "start": 3.0})),
    ("solver.stepSize", PARAMETER, real("Time", "s", min=0.0, nominal=0.001, start=0.001)),
    ("tau", INPUT, real("Torque", "N.m", start=0.0)),
    ("phi", OUTPUT, real("Angle", "rad")),
    ("w", OUTPUT, real("AngularVelocity", "rad/s")),
    ("a", OUTPUT, real("AngularAcceleration", "rad/s2", nominal=10.0)),
    ("E", OUTPUT, real("Energy", "J")),
    ("solver.nfev", LOCAL, ("Integer", {})),
]
NAMES = [name for name, *_ in VARIABLES]
NUMBERS = {"min", "max", "nominal", "start"}
DERIVATIVE_OF = {"w": "phi", "a": "w"}


def test_every_variable_is_described_as_agreed(fmu: Fmu, root: Element) -> None:
    found = []
    for reference, node in enumerate(root.iter("ScalarVariable")):
        attributes = dict(node.attrib)
        assert attributes.pop("valueReference") == str(reference)
        assert attributes.pop("description")
        (element,) = node
        described = {
            name: float(value) if name in NUMBERS else value for name, value in element.attrib.items()
        }
        if "derivative" in described:
            described["derivative"] = NAMES[int(described["derivative"]) - 1]
        found.append((attributes.pop("name"), attributes, (element.tag, described)))
    expected = []
    for name, attributes, (tag, described) in VARIABLES:
        # FMI 2.0 lets the states be known where there are derivatives of them to ask for.
        known = fmu.native and name in DERIVATIVE_OF
        derivative = {"derivative": DERIVATIVE_OF[name]} if known else {}
        expected.append((name, attributes, (tag, described | derivative)))
    assert found == expected


# What each output depends on: at a communication point the input and the states, at the beginning what is set.
DEPENDENCIES = {"phi": "phi", "w": "w", "a": "tau phi w", "E": "phi w"}
INITIAL_DEPENDENCIES = {
    "phi": "phi_start",
    "w": "w_start",
    "a": "m L gamma g phi_start w_start tau",
    "E": "m L g phi_start w_start",
}
STRUCTURES = {
    "pythonfmu": {
        "Outputs": DEPENDENCIES | {"phi": "", "w": "", "a": "tau", "E": ""},  # no states are known
        "InitialUnknowns": INITIAL_DEPENDENCIES,
    },
    "native": {
        "Outputs": DEPENDENCIES,
        "Derivatives": {"w": "w", "a": "tau phi w"},
        "InitialUnknowns": INITIAL_DEPENDENCIES,
    },
}


def test_the_structure_is_the_agreed_one(carrier: str, root: Element) -> None:
    (structure,) = root.iter("ModelStructure")
    found: dict[str, dict[str, str]] = {}
    for section in structure:
        unknowns = found[section.tag] = {}
        for unknown in section:
            assert unknown.tag == "Unknown"
            assert set(unknown.attrib) == {"index", "dependencies"}  # each dependency is of the general kind
            places = map(int, unknown.attrib["dependencies"].split())
            unknowns[NAMES[int(unknown.attrib["index"]) - 1]] = " ".join(NAMES[i - 1] for i in places)
    assert found == STRUCTURES[carrier]
    # Sections and unknowns come in the order of the standard, too.
    assert list(found) == list(STRUCTURES[carrier])
    assert [list(section) for section in found.values()] == [list(s) for s in STRUCTURES[carrier].values()]


UNITS = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "m/s2": {"m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
    "J": {"kg": 1, "m": 2, "s": -2},
}


def test_every_unit_is_that_of_the_si(root: Element) -> None:
    found, shown = {}, {}
    for unit in root.iter("Unit"):
        base, *displayed = unit
        assert base.tag == "BaseUnit"
        found[unit.attrib["name"]] = {name: int(power) for name, power in base.attrib.items()}
        for display in displayed:
            shown[unit.attrib["name"], display.attrib["name"]] = float(display.attrib["factor"])
            assert set(display.attrib) == {"name", "factor"}  # no offset
    assert found == UNITS
    assert shown == {("rad", "deg"): 57.29577951308232}  # 180/pi to the last bit


TYPES = {
    "Mass": "kg",
    "Length": "m",
    "TranslationalDampingConstant": "N.s/m",
    "Acceleration": "m/s2",
    "Angle": "rad",
    "AngularVelocity": "rad/s",
    "AngularAcceleration": "rad/s2",
    "Torque": "N.m",
    "Energy": "J",
    "Time": "s",
}
METHODS = [
    "ExplicitEuler",
    "ExplicitMidPoint2",
    "ExplicitRungeKutta4",
    "ImplicitEuler",
    "ImplicitTrapezoid",
    "TRBDF2",
    "SDIRK4",
    "TaylorSeries",
]


def test_every_type_has_quantity_and_unit(root: Element) -> None:
    enumeration, *reals = root.iter("SimpleType")
    assert enumeration.attrib["name"] == "SolverMethod"
    (items,) = enumeration
    assert (items.tag, items.attrib) == ("Enumeration", {})
    assert [(item.attrib["name"], item.attrib["value"]) for item in items] == [
        (name, str(value)) for value, name in enumerate(METHODS, start=1)
    ]
    found = {}
    for simple in reals:
        (element,) = simple
        assert element.tag == "Real"
        found[simple.attrib["name"]] = element.attrib
    assert found == {
        name: {"quantity": name, "unit": unit} | ({"displayUnit": "deg"} if unit == "rad" else {})
        for name, unit in TYPES.items()
    }


def test_the_default_experiment_is_the_agreed_one(root: Element) -> None:
    (experiment,) = root.iter("DefaultExperiment")
    found = {name: float(value) for name, value in experiment.attrib.items()}
    assert found == {"startTime": 0.0, "stopTime": 10.0, "stepSize": 0.01}
