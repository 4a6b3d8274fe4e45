"""The interface of the hardening spring as tables."""

from __future__ import annotations

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

INTERFACE = Interface(
    model_name="HardeningSpring",
    version="1.0.0",
    released="2026-11-25T00:00:00Z",
    description="A mass on a hardening spring: force in, position out",
    author="The damped pendulum FMU contributors",
    license="MIT",
    experiment=Experiment(0.0, 10.0, 0.01),
    units=(
        Unit("kg", {"kg": 1}),
        Unit("m", {"m": 1}),
        Unit("s", {"s": 1}),
        Unit("m/s", {"m": 1, "s": -1}),
        Unit("m/s2", {"m": 1, "s": -2}),
        Unit("N", {"kg": 1, "m": 1, "s": -2}),
        Unit("N/m", {"kg": 1, "s": -2}),
        Unit("N/m3", {"kg": 1, "m": -2, "s": -2}),
        Unit("N.s/m", {"kg": 1, "s": -1}),
        Unit("J", {"kg": 1, "m": 2, "s": -2}),
    ),
    types=(
        Type("Mass", "kg"),
        Type("Position", "m"),
        Type("Velocity", "m/s"),
        Type("Acceleration", "m/s2"),
        Type("Force", "N"),
        Type("TranslationalSpringConstant", "N/m"),
        Type("CubicSpringConstant", "N/m3"),
        Type("TranslationalDampingConstant", "N.s/m"),
        Type("Energy", "J"),
        Type("Time", "s"),
    ),
    enumerations=(
        Enumeration(
            "SolverMethod",
            "Integration method",
            tuple(Item(m.name, m.value, METHODS[m].description) for m in SolverMethod),
        ),
    ),
    variables=(
        Variable("m", "Mass", "parameter", "Mass", 1.0, POSITIVE),
        Variable("c", "TranslationalDampingConstant", "parameter", "Drag coefficient", 0.002, NOT_NEGATIVE),
        Variable("k", "TranslationalSpringConstant", "parameter", "Stiffness at rest", 10.0, NOT_NEGATIVE),
        Variable("k3", "CubicSpringConstant", "parameter", "Hardening of the spring", 5.0, NOT_NEGATIVE),
        Variable("x_start", "Position", "parameter", "Initial position", 0.5, FINITE),
        Variable("v_start", "Velocity", "parameter", "Initial velocity", 0.0, FINITE),
        Variable(
            "solver.method",
            "SolverMethod",
            "parameter",
            "Internal integration method",
            SolverMethod.ExplicitRungeKutta4,
            Range("1..4", 1, 4),
        ),
        Variable(
            "solver.stepSize", "Time", "parameter", "Upper bound of the internal step size", 1e-3, POSITIVE
        ),
        Variable("F", "Force", "input", "External force", 0.0, FINITE),
        Variable("x", "Position", "output", "Position", depends_on=("x",), starts_from=("x_start",)),
        Variable(
            "v",
            "Velocity",
            "output",
            "Velocity (= der(x))",
            derivative_of="x",
            depends_on=("v",),
            starts_from=("v_start",),
        ),
        Variable(
            "a",
            "Acceleration",
            "output",
            "Acceleration (= der(v))",
            derivative_of="v",
            depends_on=("F", "x", "v"),
            starts_from=("m", "c", "k", "k3", "x_start", "v_start", "F"),
        ),
        Variable(
            "E",
            "Energy",
            "output",
            "Mechanical energy",
            depends_on=("x", "v"),
            starts_from=("m", "k", "k3", "x_start", "v_start"),
        ),
        Variable("solver.nfev", "Integer", "output", "Evaluations of the acceleration"),
    ),
)
