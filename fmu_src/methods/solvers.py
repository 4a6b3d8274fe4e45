"""The fixed-step methods, their orders and stability limits, and the substeps of a communication step.

A solver integrates one communication step, loop included:

    solver(motion, phi, w, h, n) -> phi, w, nfev

advances the angle `phi` [rad] and its rate `w` [rad/s] by `n` substeps of `h` [s] and returns them with
the number of evaluations of the acceleration. The order of the operations is part of the definition:
another implementation with the same order returns the same bits.

References: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sections II.1 and II.7;
Hairer, Wanner, "... II", section IV.2 (stability functions).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from itertools import repeat
from math import ceil, inf, isfinite, sqrt
from sys import float_info
from typing import NamedTuple, Protocol

Acceleration = Callable[[float, float], float]
ImplicitStage = Callable[[float, float], tuple[float, float, int]]


class Motion(Protocol):
    """What the methods ask of a model: der(w) = a(phi, w) under an input that is held."""

    @property
    def damping_rate(self) -> float:
        """Minus the partial derivative of a with respect to w at the stable equilibrium [1/s], >= 0."""

    @property
    def w02(self) -> float:
        """Minus the partial derivative of a with respect to phi there, of either sign [1/s2]."""

    def acceleration(self) -> Acceleration:
        """Return a as a function of phi and w."""

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of `terms`."""

    @staticmethod
    def terms() -> Mapping[str, str]:
        """Return coefficient -> term of a as an expression of phi, w and the coefficient; their sum is a."""

    @staticmethod
    def functions() -> Mapping[str, Callable[[float], float]]:
        """Return the functions that the terms call, by name."""

    def implicit_stage(self, b: float) -> ImplicitStage:
        """Return x, v and the evaluations, from phi and w, of v = w + b*a(x, v), x = phi + b*v."""

    def longest_implicit_stage(self) -> float:
        """Return the factor b [s] below which that equation has a single solution."""


Solver = Callable[[Motion, float, float, float, int], tuple[float, float, int]]

MAX_SUBSTEPS = 2**31 - 1


def explicit_euler(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit (forward) Euler method: order 1, 1 stage.

    Crawford, eq. (25). Not the semi-implicit (symplectic) Euler method: both states advance with the
    values at the beginning of the substep.
    """
    acceleration = motion.acceleration()
    for _ in repeat(None, n):
        a = acceleration(phi, w)
        phi += h * w
        w += h * a
    return phi, w, n


def explicit_midpoint2(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit midpoint method (modified Euler, "RK2"): order 2, 2 stages.

    Crawford, eqs. (29)-(31). Not Heun's method, which has the same stability function.
    """
    acceleration = motion.acceleration()
    half = h / 2
    for _ in repeat(None, n):
        a1 = acceleration(phi, w)
        w2 = w + half * a1
        a2 = acceleration(phi + half * w, w2)
        phi += h * w2
        w += h * a2
    return phi, w, 2 * n


def explicit_runge_kutta4(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Classical Runge-Kutta method ("RK4"): order 4, 4 stages.

    Crawford, eq. (32), with the stages of der(phi) = w inserted into those of der(w), which saves a third of the
    arithmetic.
    """
    acceleration = motion.acceleration()
    half = h / 2
    sixth = h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in repeat(None, n):
        middle = phi + half * w
        end = phi + h * w
        a1 = acceleration(phi, w)
        a2 = acceleration(middle, w + half * a1)
        a3 = acceleration(middle + half_half * a1, w + half * a2)
        a4 = acceleration(end + half_h * a2, w + h * a3)
        a23 = a2 + a3
        a123 = a1 + a23
        phi = end + sixth_h * a123
        w += sixth * (a123 + a23 + a4)
    return phi, w, 4 * n


def implicit_euler(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Implicit (backward) Euler method on the nonlinear equation: order 1.

    The whole step is one implicit stage, which the model solves.
    """
    stage = motion.implicit_stage(h)
    nfev = 0
    for _ in repeat(None, n):
        phi, w, evaluations = stage(phi, w)
        nfev += evaluations
    return phi, w, nfev


def newton_stage(
    acceleration: Acceleration,
    partial_derivatives: Callable[[float, float], tuple[float, float]],
    b: float,
    phi: float,
    w: float,
) -> tuple[float, float, int]:
    """Solve v = w + b*a(x, v), x = phi + b*v by Newton's method, for models that know no better way.

    `partial_derivatives` returns those of a with respect to x and v. Where the solution is a single one the residual
    rises with v, so its sign says on which side the solution lies, and bisection helps where Newton's method is slow.

    Returns
    -------
    x, v : the solution, not finite where it cannot be found
    evaluations : how often a was evaluated
    """
    v, x = w, phi + b * w
    low, high, last_move = -inf, inf, inf
    evaluations = 0
    while True:
        a = acceleration(x, v)
        a_x, a_v = partial_derivatives(x, v)
        evaluations += 1
        residual = (v - w) - b * a
        correction = residual / (1.0 - b * (a_v + b * a_x))
        if residual > 0.0:
            high = v
        else:
            low = v
        # Newton's method doubles the digits: after a step this small all are right.
        is_last = abs(correction) <= 1e-9 * (abs(v) + abs(w) + abs(b * a))
        is_slow = abs(correction) > 0.5 * last_move or not low < v - correction < high
        bisects = not is_last and is_slow and isfinite(high - low)
        after = 0.5 * (low + high) if bisects else v - correction
        last_move = abs(after - v)
        v, x = after, phi + b * after
        if is_last or not isfinite(x) or after in (low, high):
            return x, v, evaluations


class SolverMethod(IntEnum):
    """The methods under the names of the Modelica Language Specification, section 16.8.2; append only."""

    ExplicitEuler = 1
    ExplicitMidPoint2 = 2
    ExplicitRungeKutta4 = 3
    ImplicitEuler = 4


class Method(NamedTuple):
    """What is known of a method.

    Attributes
    ----------
    solver : the method, see the module's docstring
    order : order of consistency
    stages : evaluations of the acceleration in a substep, None where they vary
    real_limit : the method is stable for h*lambda in [-real_limit, 0]
    growth : with h in units of 1/w0 and the damping rate z in units of w0, the coefficients of
        (|R(h*lambda)|^2 - 1)/h for a complex pair lambda, in rising powers of h; R is the stability function
    description : one line for users
    """

    solver: Solver
    order: int
    stages: int | None
    real_limit: float
    growth: Callable[[float], Sequence[float]] | None
    description: str


METHODS = {
    SolverMethod.ExplicitEuler: Method(
        explicit_euler, 1, 1, 2.0, lambda z: (-z, 1.0), "Explicit Euler method (order 1)"
    ),
    SolverMethod.ExplicitMidPoint2: Method(
        explicit_midpoint2,
        2,
        2,
        2.0,
        lambda z: (-z, z * z / 2, -z / 2, 1 / 4),
        "Explicit midpoint method (order 2)",
    ),
    SolverMethod.ExplicitRungeKutta4: Method(
        explicit_runge_kutta4,
        4,
        4,
        2.7852935634052816235,  # root of x^3 - 4x^2 + 12x - 24
        lambda z: (
            -z,
            z**2 / 2,
            -(z**3) / 6,
            z**4 / 24,
            (z - z**3) / 24,
            z**2 / 48 - 1 / 72,
            -z / 144,
            1 / 576,
        ),
        "Explicit Runge-Kutta method (order 4)",
    ),
    SolverMethod.ImplicitEuler: Method(implicit_euler, 1, None, inf, None, "Implicit Euler method (order 1)"),
}


def stability_limit(method: SolverMethod, damping_rate: float, w02: float) -> float:
    """Return the largest substep [s] that is stable for small swings about the stable equilibrium.

    It is the largest h with |R(h*lambda)| <= 1 for both eigenvalues lambda = (-k2 +- sqrt(k2^2 - 4*w02))/2,
    k2 = `damping_rate` [1/s] >= 0. With w02 < 0 [1/s2] the stable equilibrium is the upright position. The
    result is 0 where no step is stable and inf where every step is. Large swings can ask for less.
    """
    known = METHODS[method]
    if known.growth is None or (damping_rate == 0.0 and w02 == 0.0):
        return inf
    w0 = sqrt(abs(w02))
    if damping_rate >= 2.0 * w0:
        return known.real_limit / (damping_rate * (0.5 + sqrt(0.25 - (w0 / damping_rate) ** 2)))
    coefficients = known.growth(damping_rate / w0)
    leading = next(c for c in coefficients if c != 0.0)
    if leading > 0.0:
        return 0.0
    stable, unstable = 0.0, 4.0  # |R| > 1 for every method and damping at |h*lambda| = 4
    while True:
        middle = 0.5 * (stable + unstable)
        if not stable < middle < unstable:
            return stable / w0
        value = 0.0
        for coefficient in reversed(coefficients):
            value = value * middle + coefficient
        if value <= 0.0:
            stable = middle
        else:
            unstable = middle


def substeps(time: float, duration: float, max_step: float) -> int:
    """Return the number of equal substeps, none longer than `max_step` [s], of a communication step.

    The communication step lasts `duration` [s] from `time` [s]. Importers form it as a difference of times,
    so it carries the rounding noise of those; that noise, up to a tenth of `max_step`, adds no substep.

    Raises
    ------
    OverflowError : more than `MAX_SUBSTEPS` would be needed, or that noise exceeds `max_step`
    """
    noise = 4.0 * float_info.epsilon * (abs(time) + duration)
    n = (duration - min(noise, max_step / 10.0)) / max_step
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
    return ceil(n) if n > 1.0 else 1
