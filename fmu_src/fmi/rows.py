"""What the tables of models of second order have in common: quantities, units, the solver, what outputs depend on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi
from typing import TypeVar

from methods.solvers import METHODS, SolverMethod

from .tables import POSITIVE, Enumeration, Item, Range, Type, Unit, Variable

Row = TypeVar("Row", Type, Unit)

# Names, units and exponents are those of Modelica.Units.SI.
UNITS = (
    Unit("kg", {"kg": 1}),
    Unit("m", {"m": 1}),
    Unit("s", {"s": 1}),
    Unit("m/s", {"m": 1, "s": -1}),
    Unit("rad", {"rad": 1}, {"deg": 180.0 / pi}),
    Unit("rad/s", {"rad": 1, "s": -1}),
    Unit("rad/s2", {"rad": 1, "s": -2}),
    Unit("m/s2", {"m": 1, "s": -2}),
    Unit("N", {"kg": 1, "m": 1, "s": -2}),
    Unit("N.m", {"kg": 1, "m": 2, "s": -2}),
    Unit("N/m", {"kg": 1, "s": -2}),
    Unit("N.s/m", {"kg": 1, "s": -1}),
    Unit("J", {"kg": 1, "m": 2, "s": -2}),
)

TYPES = (
    Type("Mass", "kg"),
    Type("Length", "m"),
    Type("Position", "m"),
    Type("TranslationalSpringConstant", "N/m"),
    Type("TranslationalDampingConstant", "N.s/m"),
    Type("Velocity", "m/s"),
    Type("Acceleration", "m/s2"),
    Type("Angle", "rad", display_unit="deg"),
    Type("AngularVelocity", "rad/s"),
    Type("AngularAcceleration", "rad/s2"),
    Type("Force", "N"),
    Type("Torque", "N.m"),
    Type("Energy", "J"),
    Type("Time", "s"),
)

SOLVER_METHODS = Enumeration(
    "SolverMethod",
    "Integration method",
    tuple(Item(method.name, method.value, METHODS[method].description) for method in SolverMethod),
)

METHOD = Variable(
    "solver.method",
    "SolverMethod",
    "parameter",
    "Internal integration method",
    SolverMethod.ExplicitRungeKutta4,
    Range(f"1..{len(SolverMethod)}", min(SolverMethod), max(SolverMethod)),
)

STEP_SIZE = Variable(
    "solver.stepSize",
    "Time",
    "parameter",
    "Upper bound of the internal step size",
    1e-3,
    POSITIVE,
    nominal=1e-3,
)

EVALUATIONS = Variable(
    "solver.nfev",
    "Integer",
    "local",
    "Evaluations of the acceleration since initialization (stays at 2147483647 once there)",
)


def second_order(
    *,
    parameters: tuple[Variable, ...],
    x_start: Variable,
    v_start: Variable,
    input: Variable,
    x: Variable,
    v: Variable,
    a: Variable,
    energy: Variable,
    energy_needs: tuple[str, ...],
) -> tuple[Variable, ...]:
    """Return the rows of a model of second order, with those of its solver and with what its outputs depend on.

    Parameters
    ----------
    parameters : those of der(v) = a(x, v) + drive
    x_start, v_start : the parameters that x and v start from, named like these with "_start"
    input : the one input; drive is a multiple of it
    x, v, a, energy : the outputs; a is the time derivative of v, and v that of x
    energy_needs : the names of the parameters of which the energy is made
    """
    starts = (x_start.name, v_start.name)
    all_starts = (*(parameter.name for parameter in parameters), *starts, input.name)
    return (
        *parameters,
        x_start,
        v_start,
        METHOD,
        STEP_SIZE,
        input,
        x._replace(depends_on=(x.name,), starts_from=(x_start.name,)),
        v._replace(derivative_of=x.name, depends_on=(v.name,), starts_from=(v_start.name,)),
        a._replace(derivative_of=v.name, depends_on=(input.name, x.name, v.name), starts_from=all_starts),
        energy._replace(depends_on=(x.name, v.name), starts_from=(*energy_needs, *starts)),
        EVALUATIONS,
    )


def types_of(variables: Iterable[Variable], *own: Type) -> tuple[Type, ...]:
    """Return the types that `variables` have: of those above, and of a model's `own`.

    Raises
    ------
    ValueError : a variable has another type
    """
    reals = (row for row in variables if row.type not in (SOLVER_METHODS.name, EVALUATIONS.type))
    return _used("type", {variable.type: variable.name for variable in reals}, (*TYPES, *own))


def units_of(types: Iterable[Type], *own: Unit) -> tuple[Unit, ...]:
    """Return the units that `types` have: of those above, and of a model's `own`.

    Raises
    ------
    ValueError : a type has another unit
    """
    return _used("unit", {type_.unit: type_.name for type_ in types}, (*UNITS, *own))


def _used(kind: str, users: Mapping[str, str], known: tuple[Row, ...]) -> tuple[Row, ...]:
    """Return the rows of `known` whose name is a key of `users`, which are what has them."""
    for name in sorted(users.keys() - {row.name for row in known}):
        raise ValueError(f"{users[name]} has the {kind} {name}, which is none of fmi/rows.py or of the model")
    return tuple(row for row in known if row.name in users)
