"""The interface of the hardening spring as tables."""

from fmi.rows import SOLVER_METHODS, second_order, types_of, units_of
from fmi.tables import FINITE, NOT_NEGATIVE, POSITIVE, Experiment, Interface, Type, Unit, Variable

VARIABLES = second_order(
    parameters=(
        Variable("m", "Mass", "parameter", "Mass", 1.0, POSITIVE),
        Variable("c", "TranslationalDampingConstant", "parameter", "Drag coefficient", 0.002, NOT_NEGATIVE),
        Variable("k", "TranslationalSpringConstant", "parameter", "Stiffness at rest", 10.0, NOT_NEGATIVE),
        Variable("k3", "CubicSpringConstant", "parameter", "Hardening of the spring", 5.0, NOT_NEGATIVE),
    ),
    x_start=Variable("x_start", "Position", "parameter", "Initial position", 0.5, FINITE),
    v_start=Variable("v_start", "Velocity", "parameter", "Initial velocity", 0.0, FINITE),
    input=Variable("F", "Force", "input", "External force", 0.0, FINITE),
    x=Variable("x", "Position", "output", "Position"),
    v=Variable("v", "Velocity", "output", "Velocity (= der(x))"),
    a=Variable("a", "Acceleration", "output", "Acceleration (= der(v))"),
    energy=Variable("E", "Energy", "output", "Mechanical energy, 0 at rest in the middle"),
    energy_needs=("m", "k", "k3"),
)

TYPES = types_of(VARIABLES, Type("CubicSpringConstant", "N/m3"))

INTERFACE = Interface(
    model_name="HardeningSpring",
    version="1.0.0",
    released="2026-11-25T00:00:00Z",
    description="A mass on a hardening spring: force in, position out",
    author="The damped pendulum FMU contributors",
    license="MIT",
    experiment=Experiment(0.0, 10.0, 0.01),
    units=units_of(TYPES, Unit("N/m3", {"kg": 1, "m": -2, "s": -2})),
    types=TYPES,
    enumerations=(SOLVER_METHODS,),
    variables=VARIABLES,
)
