"""The interface of the FMU as tables: units, types, variables. Names, types and units are those of Modelica.

The tables are the only source of the interface: modelDescription.xml, the documentation in the FMU and the table
in README are made from them, and the checks of the parameters read the ranges from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import pi, ulp
from sys import float_info
from types import MappingProxyType
from typing import NamedTuple
from zlib import crc32

from .solvers import METHODS, SolverMethod

MODEL_NAME = "DampedPendulum"
VERSION = "0.1.0"
RELEASED = "2026-11-22T00:00:00Z"
DESCRIPTION = "Nonlinear damped pendulum: torque in, angle out, integrated by a method of your choice"
AUTHOR = "The damped pendulum FMU contributors"
LICENSE = "MIT"


class Unit(NamedTuple):
    """A unit: its exponents of the SI base units and, in `display`, unit -> factor (display = factor*value)."""

    name: str
    base: Mapping[str, int]
    display: Mapping[str, float] = MappingProxyType({})


class Type(NamedTuple):
    """A quantity of the Modelica Standard Library (Modelica.Units.SI)."""

    name: str
    unit: str
    display_unit: str | None = None


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
A_METHOD = Range(f"1..{len(SolverMethod)}", min(SolverMethod), max(SolverMethod))


class Variable(NamedTuple):
    """A variable of the FMU; its value reference is its place in `VARIABLES`.

    Attributes
    ----------
    name : name in the FMU
    type : name of a row of `TYPES`, "SolverMethod" or "Integer"
    causality : "parameter" (fixed, exact), "input" (continuous) or "output" (calculated)
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

    def allows(self, value: float) -> bool:
        """Return whether `value` is allowed for this parameter or input."""
        return self.range is None or self.range.allows(value)


UNITS = (
    Unit("kg", {"kg": 1}),
    Unit("m", {"m": 1}),
    Unit("s", {"s": 1}),
    Unit("rad", {"rad": 1}, {"deg": 180.0 / pi}),
    Unit("rad/s", {"rad": 1, "s": -1}),
    Unit("rad/s2", {"rad": 1, "s": -2}),
    Unit("m/s2", {"m": 1, "s": -2}),
    Unit("N.m", {"kg": 1, "m": 2, "s": -2}),
    Unit("N.s/m", {"kg": 1, "s": -1}),
    Unit("J", {"kg": 1, "m": 2, "s": -2}),
)

TYPES = (
    Type("Mass", "kg"),
    Type("Length", "m"),
    Type("TranslationalDampingConstant", "N.s/m"),
    Type("Acceleration", "m/s2"),
    Type("Angle", "rad", display_unit="deg"),
    Type("AngularVelocity", "rad/s"),
    Type("AngularAcceleration", "rad/s2"),
    Type("Torque", "N.m"),
    Type("Energy", "J"),
    Type("Time", "s"),
)

SOLVER_METHODS = {method: METHODS[method].description for method in SolverMethod}

VARIABLES = (
    Variable("m", "Mass", "parameter", "Mass of the bob", 1.0, POSITIVE),
    Variable("L", "Length", "parameter", "Length of the massless rod", 1.0, POSITIVE),
    Variable(
        "gamma",
        "TranslationalDampingConstant",
        "parameter",
        "Drag coefficient of the bob (drag = gamma*L*w)",
        0.002,
        NOT_NEGATIVE,
        nominal=1e-3,
    ),
    Variable("g", "Acceleration", "parameter", "Gravity acceleration", 9.80665, FINITE, nominal=10.0),
    Variable("phi_start", "Angle", "parameter", "Initial angle", pi / 6, FINITE),
    Variable("w_start", "AngularVelocity", "parameter", "Initial angular velocity", 0.0, FINITE),
    Variable(
        "solver.method",
        "SolverMethod",
        "parameter",
        "Internal integration method",
        SolverMethod.ExplicitRungeKutta4,
        A_METHOD,
    ),
    Variable(
        "solver.stepSize",
        "Time",
        "parameter",
        "Upper bound of the internal step size",
        1e-3,
        POSITIVE,
        nominal=1e-3,
    ),
    Variable("tau", "Torque", "input", "External torque about the pivot", 0.0, FINITE),
    Variable(
        "phi",
        "Angle",
        "output",
        "Angle from the downward vertical, not wrapped",
        depends_on=("phi",),
        starts_from=("phi_start",),
    ),
    Variable(
        "w",
        "AngularVelocity",
        "output",
        "Angular velocity (= der(phi))",
        derivative_of="phi",
        depends_on=("w",),
        starts_from=("w_start",),
    ),
    Variable(
        "a",
        "AngularAcceleration",
        "output",
        "Angular acceleration (= der(w))",
        nominal=10.0,
        derivative_of="w",
        depends_on=("tau", "phi", "w"),
        starts_from=("m", "L", "gamma", "g", "phi_start", "w_start", "tau"),
    ),
    Variable(
        "E",
        "Energy",
        "output",
        "Mechanical energy, 0 at rest in the lowest point",
        depends_on=("phi", "w"),
        starts_from=("m", "L", "g", "phi_start", "w_start"),
    ),
    Variable(
        "solver.nfev",
        "Integer",
        "output",
        "Evaluations of the acceleration since initialization (stays at 2147483647 once there)",
    ),
)

DEFAULTS = {variable.name: variable.start for variable in VARIABLES if variable.start is not None}

START_TIME, STOP_TIME, COMMUNICATION_STEP = 0.0, 10.0, 0.01  # DefaultExperiment [s]


def unit_of(variable: Variable) -> str:
    """Return the unit of `variable`, "" where it has none."""
    return next((type_.unit for type_ in TYPES if type_.name == variable.type), "")


def state_format(model: str) -> str:
    """Return the origin that a saved state names: model, version and a digest of what its values mean."""
    rows = (
        f"{variable.name} {variable.type} {unit_of(variable)} {variable.causality} "
        f"{variable.range.text if variable.range else ''}"
        for variable in VARIABLES
    )
    methods = (f"{method.name} {method.value}" for method in SolverMethod)
    return f"{model} {VERSION} {crc32(chr(10).join((*rows, *methods)).encode()):08x}"
