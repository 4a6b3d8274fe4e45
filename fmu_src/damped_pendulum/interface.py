"""The interface of the FMU as tables: units, types, variables. Names, types and units are those of Modelica."""

from __future__ import annotations

from math import pi

from fmi.tables import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    Enumeration,
    Experiment,
    Interface,
    Item,
    Range,
    Type,
    Unit,
    Variable,
)
from methods.solvers import METHODS, SolverMethod

A_METHOD = Range(f"1..{len(SolverMethod)}", min(SolverMethod), max(SolverMethod))

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

SOLVER_METHODS = Enumeration(
    "SolverMethod",
    "Integration method",
    tuple(Item(method.name, method.value, METHODS[method].description) for method in SolverMethod),
)

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

INTERFACE = Interface(
    model_name="DampedPendulum",
    version="0.1.0",
    released="2026-11-22T00:00:00Z",
    description="Nonlinear damped pendulum: torque in, angle out, integrated by a method of your choice",
    author="The damped pendulum FMU contributors",
    license="MIT",
    experiment=Experiment(0.0, 10.0, 0.01),
    units=UNITS,
    types=TYPES,
    enumerations=(SOLVER_METHODS,),
    variables=VARIABLES,
)
