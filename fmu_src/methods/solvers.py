"""The table of the methods, their stability limits, and the substeps of a communication step.

A solver integrates one communication step, loop included:

    solver(motion, x, v, h, n) -> x, v, nfev

advances the position `x` and its rate `v` [unit of x/s] by `n` substeps of `h` [s] and returns them with
the number of evaluations of the acceleration. The order of the operations is part of the definition:
another implementation with the same order returns the same bits.

Reference: Hairer, Wanner, "Solving Ordinary Differential Equations II", section IV.2 (stability functions).
"""

from __future__ import annotations

from enum import IntEnum
from math import ceil, factorial, inf, sqrt
from sys import float_info
from typing import NamedTuple

from .explicit import explicit_euler, explicit_midpoint2, explicit_runge_kutta4
from .implicit import IMPLICIT_EULER, IMPLICIT_TRAPEZOID, SDIRK4, TR_BDF2, Tableau, diagonally_implicit
from .motion import Solver
from .taylor import ORDER, taylor_series

MAX_SUBSTEPS = 2**31 - 1


class SolverMethod(IntEnum):
    """The methods; append only.

    The first five have the names of the Modelica Language Specification, section 16.8.2.
    """

    ExplicitEuler = 1
    ExplicitMidPoint2 = 2
    ExplicitRungeKutta4 = 3
    ImplicitEuler = 4
    ImplicitTrapezoid = 5
    TRBDF2 = 6
    SDIRK4 = 7
    TaylorSeries = 8


class Method(NamedTuple):
    """What is known of a method.

    Attributes
    ----------
    solver : the method, see the module's docstring
    order : order of consistency; the stability function of an explicit method is the polynomial of exp of this degree
    stages : evaluations of the acceleration in a substep, None where they vary
    real_limit : the method is stable for h*lambda in [-real_limit, 0]; inf: in the whole left half plane
    description : what the interface says of it
    tableau : of an implicit method, else empty
    """

    solver: Solver
    order: int
    stages: int | None
    real_limit: float
    description: str
    tableau: Tableau = ()

    @property
    def diagonal(self) -> float:
        """The factor b of the implicit stages is `diagonal` times the substep; 0 where there are none."""
        return self.tableau[-1][-1] if self.tableau else 0.0


def _implicit(tableau: Tableau, order: int, description: str) -> Method:
    return Method(diagonally_implicit(tableau), order, None, inf, description, tableau)


METHODS = {
    SolverMethod.ExplicitEuler: Method(explicit_euler, 1, 1, 2.0, "Explicit Euler method (order 1)"),
    SolverMethod.ExplicitMidPoint2: Method(
        explicit_midpoint2, 2, 2, 2.0, "Explicit midpoint method (order 2)"
    ),
    SolverMethod.ExplicitRungeKutta4: Method(
        explicit_runge_kutta4,
        4,
        4,
        2.7852935634052816235,  # root of x^3 - 4x^2 + 12x - 24
        "Explicit Runge-Kutta method (order 4)",
    ),
    SolverMethod.ImplicitEuler: _implicit(IMPLICIT_EULER, 1, "Implicit Euler method (order 1)"),
    SolverMethod.ImplicitTrapezoid: _implicit(IMPLICIT_TRAPEZOID, 2, "Implicit trapezoidal method (order 2)"),
    SolverMethod.TRBDF2: _implicit(
        TR_BDF2, 2, "Trapezoid, then the second-order formula of Gear (order 2, L-stable)"
    ),
    SolverMethod.SDIRK4: _implicit(SDIRK4, 4, "Diagonally implicit Runge-Kutta method (order 4, L-stable)"),
    SolverMethod.TaylorSeries: Method(
        taylor_series,
        ORDER,
        ORDER,
        7.3243335627875953221,  # the smallest x > 0 at which the polynomial of exp of degree 16 is 1 at -x
        "Taylor series method (order 16)",
    ),
}


def stability_limit(method: SolverMethod, damping_rate: float, w02: float) -> float:
    """Return the substep [s] up to which all are stable for small swings about the stable equilibrium.

    It is the largest h with |R(h'*lambda)| <= 1 for all h' <= h, gaps narrower than 1/16 of 1/w0 aside, and both
    eigenvalues lambda = (-k2 +- sqrt(k2^2 - 4*w02))/2, k2 = `damping_rate` [1/s] >= 0. Where w02 < 0 [1/s2] the model
    runs away from where it rests: the limit is that of swings as fast as this. The result is 0 where no step is stable
    and inf where every step is. Large swings can ask for less.
    """
    known = METHODS[method]
    if known.real_limit == inf or (damping_rate == 0.0 and w02 == 0.0):
        return inf
    w0 = sqrt(abs(w02))
    if damping_rate >= 2.0 * w0:
        return known.real_limit / (damping_rate * (0.5 + sqrt(0.25 - (w0 / damping_rate) ** 2)))
    coefficients = _growth(known.order, damping_rate / w0)
    if next(c for c in coefficients if c != 0.0) > 0.0:
        return 0.0
    # Beyond an unstable gap a method may be stable once more: the bracket grows from zero by steps of a sixteenth.
    stable, unstable = 0.0, 0.0625
    while _polynomial(coefficients, unstable) <= 0.0:
        stable, unstable = unstable, unstable + 0.0625
    while True:
        middle = 0.5 * (stable + unstable)
        if not stable < middle < unstable:
            return stable / w0
        if _polynomial(coefficients, middle) <= 0.0:
            stable = middle
        else:
            unstable = middle


def _growth(order: int, z: float) -> list[float]:
    """Return the coefficients of (|R(h*lambda)|^2 - 1)/h in rising powers of h, R the polynomial of exp.

    h is in units of 1/w0 and the damping rate z < 2 in units of w0: |lambda| = 1, and the cosine of its argument is
    -z/2. Up to the degree of R they are those of exp(-z*h).
    """
    cosines = [1.0, -0.5 * z]  # of the multiples of the argument of lambda
    while len(cosines) <= order:
        cosines.append(-z * cosines[-1] - cosines[-2])
    power = 1.0
    coefficients = []
    for m in range(1, order + 1):
        power *= -z
        coefficients.append(power / factorial(m))
    for m in range(order + 1, 2 * order + 1):
        coefficient = 0.0
        for i in range(m - order, order + 1):
            coefficient += cosines[abs(2 * i - m)] / (factorial(i) * factorial(m - i))
        coefficients.append(coefficient)
    return coefficients


def _polynomial(coefficients: list[float], h: float) -> float:
    value = 0.0
    for coefficient in reversed(coefficients):
        value = value * h + coefficient
    return value


def substeps(time: float, duration: float, max_step: float, longest: float = inf) -> int:
    """Return the number of equal substeps, none longer than `max_step` [s], of a communication step.

    The communication step lasts `duration` [s] from `time` [s]. Importers form it as a difference of times,
    so it carries the rounding noise of those; that noise, up to a tenth of `max_step`, adds no substep, unless one
    would be longer than `longest` [s] >= `max_step`.

    Raises
    ------
    OverflowError : more than `MAX_SUBSTEPS` would be needed, or that noise exceeds `max_step`
    """
    noise = 4.0 * float_info.epsilon * (abs(time) + duration)
    n = (duration - min(noise, max_step / 10.0)) / max_step
    if n <= MAX_SUBSTEPS:
        n = max(1, ceil(n))
        n = n if duration / n <= longest else n + 1
    if n > MAX_SUBSTEPS:
        raise OverflowError(
            f"no step from t = {time!r} s: a communication step of {duration!r} s would need {n:.3g} substeps of "
            f"{max_step!r} s, at most {MAX_SUBSTEPS} are allowed"
        )
    if noise > max_step:
        raise OverflowError(
            f"no step from t = {time!r} s over {duration!r} s: its times are rounded to {noise!r} s, "
            f"which is more than the longest substep ({max_step!r} s)"
        )
    return int(n)
