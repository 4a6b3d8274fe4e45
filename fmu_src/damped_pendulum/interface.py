"""The interface of the FMU as tables: units, types, variables. Names, types and units are those of Modelica."""

from __future__ import annotations

from math import pi

from fmi.rows import SOLVER_METHODS, second_order, types_of, units_of
from fmi.tables import FINITE, NOT_NEGATIVE, POSITIVE, Experiment, Interface, Variable

VARIABLES = second_order(
    parameters=(
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
    ),
    x_start=Variable("phi_start", "Angle", "parameter", "Initial angle", pi / 6, FINITE),
    v_start=Variable("w_start", "AngularVelocity", "parameter", "Initial angular velocity", 0.0, FINITE),
    input=Variable("tau", "Torque", "input", "External torque about the pivot", 0.0, FINITE),
    x=Variable("phi", "Angle", "output", "Angle from the downward vertical, not wrapped"),
    v=Variable("w", "AngularVelocity", "output", "Angular velocity (= der(phi))"),
    a=Variable("a", "AngularAcceleration", "output", "Angular acceleration (= der(w))", nominal=10.0),
    energy=Variable("E", "Energy", "output", "Mechanical energy, 0 at rest in the lowest point"),
    energy_needs=("m", "L", "g"),
)

TYPES = types_of(VARIABLES)

INTERFACE = Interface(
    model_name="DampedPendulum",
    version="0.2.0",
    released="2026-11-26T00:00:00Z",
    description="Nonlinear damped pendulum: torque in, angle out, integrated by a method of your choice",
    author="The damped pendulum FMU contributors",
    license="MIT",
    experiment=Experiment(0.0, 10.0, 0.01),
    units=units_of(TYPES),
    types=TYPES,
    enumerations=(SOLVER_METHODS,),
    variables=VARIABLES,
)
