"""Equation of motion and energy of the damped pendulum.

In the notation of Modelica, with the angle `phi` [rad] counted from the downward vertical:

    J*der(w) = tau - gamma*L^2*w - m*g*L*sin(phi)
    der(phi) = w
    J = m*L^2

Divided by J this is Grillo, "Exercise: the pendulum", with k^2 = gamma/m and omega_0^2 = g/L.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import copysign, cos, frexp, inf, isfinite, ldexp, sin, sqrt
from sys import float_info
from typing import Any, NamedTuple

from methods.motion import Acceleration, ImplicitStage, TaylorStep


class Motion(NamedTuple):
    """The terms of der(w) = drive - damping_rate*w - w02*sin(phi) under a constant torque.

    Attributes
    ----------
    damping_rate : gamma/m [1/s]
    w02 : g/L, the squared angular frequency of small swings [rad2/s2]
    drive : tau/J [rad/s2]
    """

    damping_rate: float
    w02: float
    drive: float

    def acceleration(self) -> Acceleration:
        """Return der(w) [rad/s2] as a function of phi [rad] and w [rad/s]."""
        drive, drag, gravity = self.coefficients()
        return lambda phi, w: drive + drag * w + gravity * sin(phi)

    def coefficients(self) -> tuple[float, float, float]:
        """Return drive, drag and gravity, the coefficients of `terms`."""
        return self.drive, -self.damping_rate, -self.w02

    @staticmethod
    def terms() -> dict[str, str]:
        """Return coefficient -> term of der(w) as an expression of x = phi, v = w and the coefficient."""
        return {"drive": "drive", "drag": "drag * v", "gravity": "gravity * sin(x)"}

    @staticmethod
    def functions() -> dict[str, Callable[[float], float]]:
        """Return the functions that the terms call, by name."""
        return {"sin": sin}

    def implicit_stage(self, b: float) -> ImplicitStage:
        """Return the solution x, v and its evaluations of v = w + b*a(x, v), x = phi + b*v as a function of phi and w.

        Eliminating the rate v leaves one equation for the angle x,

            x + s*sin(x) = c,   s = b^2*w02/(1 + b*k2),   c = phi + b*(w + b*drive)/(1 + b*k2),

        with k2 the damping rate. It has a single root for |s| < 1, see `longest_implicit_stage`, which Newton's method
        finds to the last bit. For |s| <= 1/2 each step leaves less than a quarter of the error, which is |s| at most at
        the start. `x - c` is exact near the root, so the residual is good to a rounding error of s*sin(x), not of x.
        """
        denominator = 1.0 + b * self.damping_rate
        kick = b * self.w02 / denominator
        s = b * kick
        size = abs(s)
        push = b * self.drive

        def free(phi: float, w: float) -> tuple[float, float, int]:
            v = (w + push) / denominator
            return phi + b * v, v, 1

        def unbounded(phi: float, w: float) -> tuple[float, float, int]:
            v = (w + push) / denominator
            x = c = phi + b * v
            evaluations = 0
            while True:
                slope = 1.0 + s * cos(x)
                correction = ((x - c) + s * sin(x)) / slope
                new = x - correction
                evaluations += 1
                # The error left is below |s|*correction^2/(2*slope): a quarter of a unit in the last place. "Not
                # larger", so that NaN ends it, too.
                if not size * correction * correction > _QUARTER_ULP * slope * abs(new) or new == x:
                    return new, v - kick * sin(new), evaluations
                x = new

        def bounded(phi: float, w: float) -> tuple[float, float, int]:
            v = (w + push) / denominator
            x, evaluations = _solve_between_bounds(s, phi + b * v)
            return x, v - kick * sin(x), evaluations

        if s == 0.0:
            return free
        return bounded if size > 0.5 else unbounded

    def longest_implicit_stage(self) -> float:
        """Return the factor b [s] below which the equation of an implicit stage has a single root.

        |s| = b^2*|w02|/(1 + b*damping_rate) must stay below 1.
        """
        if self.w02 == 0.0:
            return inf
        w0 = sqrt(abs(self.w02))
        half = self.damping_rate / (2.0 * w0)
        return (half + sqrt(half * half + 1.0)) / w0 * (1.0 - 1e-9)

    def taylor_step(self, h: float, order: int) -> TaylorStep:
        """Return phi and w after `h` [s], by their Taylor series up to `order`, as a function of phi and w.

        With the terms of phi, w and those of s = sin(phi), c = cos(phi), each with its power of h,

            phi[k+1] = h/(k+1)*w[k],   w[k+1] = h/(k+1)*(drive[k] - k2*w[k] - w02*s[k]),
            s[k+1] = h/(k+1)*sum_j w[j]*c[k-j],   c[k+1] = -h/(k+1)*sum_j w[j]*s[k-j]

        from der(s) = w*c and der(c) = -w*s.
        """
        drive, drag, gravity = self.coefficients()
        bind = _taylor_program(order, drag != 0.0, gravity != 0.0)
        ratios = [h / k for k in range(1, order + 1)]
        step: TaylorStep = bind(drive, drag, gravity, *ratios, *(-ratio for ratio in ratios))
        return step


class Pendulum(NamedTuple):
    """A point mass on a massless rod in a viscous medium.

    Attributes
    ----------
    m : mass of the bob [kg], > 0
    L : length of the rod [m], > 0
    gamma : drag coefficient of the bob, drag = gamma*L*w [N.s/m], >= 0
    g : gravity acceleration [m/s2]
    """

    m: float
    L: float
    gamma: float
    g: float

    @property
    def J(self) -> float:
        """Moment of inertia about the pivot [kg.m2]."""
        return scaled(*self._inertia())

    def _inertia(self) -> tuple[float, int]:
        """Return J as a mantissa and a power of two, which may lie outside the range of a double."""
        m, m_power = frexp(self.m)
        L, L_power = frexp(self.L)
        return m * L * L, m_power + 2 * L_power

    def motion(self, tau: float = 0.0) -> Motion:
        """Return the terms of der(w) under the torque `tau` [N.m]."""
        moment = self.m * self.L
        J = moment * self.L
        if float_info.min <= moment and float_info.min <= J < inf:
            drive = tau / J
        else:
            inertia, inertia_power = self._inertia()
            torque, power = frexp(tau)
            drive = scaled(torque / inertia, power - inertia_power)
        return Motion(self.gamma / self.m, self.g / self.L, drive + 0.0)  # -0.0 becomes 0.0

    def out_of_range(self) -> list[str]:
        """Return what cannot be computed with although each parameter by itself is allowed."""
        J = self.J
        if not 0.0 < J < inf:
            return [f"J = m*L^2 = {J!r} kg.m2 is out of the range of a double"]
        motion = self.motion()
        return [
            f"{name} = {value!r} {unit} is out of the range of a double"
            for name, value, unit in (
                ("gamma/m", motion.damping_rate, "1/s"),
                ("g/L", motion.w02, "1/s2"),
            )
            if not isfinite(value)
        ]

    def energy(self, phi: float, w: float) -> float:
        """Return the mechanical energy [J], 0 at rest in the lowest point.

        m*g*L*(1 - cos(phi)) is written as 2*m*g*L*sin(phi/2)^2, which keeps its digits at small angles.
        """
        m, m_power = frexp(self.m)
        L, L_power = frexp(self.L)
        g, g_power = frexp(self.g)
        rate, w_power = frexp(w)
        half, half_power = frexp(sin(phi / 2.0))
        kinetic = 0.5 * (m * L * L) * rate * rate
        potential = 2.0 * m * g * L * (half * half)
        kinetic_power = m_power + 2 * (L_power + w_power)
        potential_power = m_power + g_power + L_power + 2 * half_power
        if potential == 0.0:
            return scaled(kinetic, kinetic_power)
        if kinetic == 0.0:
            return scaled(potential, potential_power)
        power = max(kinetic_power, potential_power)
        return scaled(
            ldexp(kinetic, kinetic_power - power) + ldexp(potential, potential_power - power), power
        )


def scaled(value: float, power: int) -> float:
    """Return value*2^power, infinite beyond the range of a double.

    Products of mantissas alone neither overflow nor lose digits; their powers of two are joined here, at the end. The
    bits are those of the plain product where that does neither.
    """
    try:
        return ldexp(value, power)
    except OverflowError:
        return copysign(inf, value)


@cache
def _taylor_program(order: int, has_drag: bool, has_gravity: bool) -> Callable[..., TaylorStep]:
    """Return the recursions of `Motion.taylor_step` with their sums written out: loops would double the time.

    What is returned takes drive, drag and gravity, and h/k and -h/k for k = 1, ..., `order`.
    """
    lines = ["s0, c0 = sin(phi0), cos(phi0)"] if has_gravity else []
    for k in range(order):
        terms = ["drive"] * (k == 0) + [f"drag * w{k}"] * has_drag + [f"gravity * s{k}"] * has_gravity
        lines += [f"phi{k + 1} = h{k + 1} * w{k}", f"w{k + 1} = h{k + 1} * ({' + '.join(terms) or '0.0'})"]
        if has_gravity and k + 1 < order:
            # The newest terms come last: in C the others are added while these are computed.
            pairs = [(j, k - j) for j in [*range(1, k), *sorted({0, k}, reverse=True)]]
            lines += [
                f"s{k + 1} = h{k + 1} * ({' + '.join(f'w{i} * c{j}' for i, j in pairs)})",
                f"c{k + 1} = minus_h{k + 1} * ({' + '.join(f'w{i} * s{j}' for i, j in pairs)})",
            ]
    sums = [" + ".join(f"{name}{k}" for k in range(order, -1, -1)) for name in ("phi", "w")]
    ratios = [f"{name}{k}" for name in ("h", "minus_h") for k in range(1, order + 1)]
    program = [
        f"def bind({', '.join(['drive', 'drag', 'gravity', *ratios])}):",
        "    def step(phi0, w0):",
        *(f"        {line}" for line in lines),
        f"        return {', '.join(sums)}",
        "    return step",
    ]
    names: dict[str, Any] = {"sin": sin, "cos": cos}
    exec("\n".join(program), names)
    bind: Callable[..., TaylorStep] = names["bind"]
    return bind


_QUARTER_ULP = float_info.epsilon / 4.0  # of 1


def _solve_between_bounds(s: float, c: float) -> tuple[float, int]:
    """Solve x + s*sin(x) = c for |s| < 1 with the root kept between bounds: bisection where Newton's step leaves them.

    Apart, because the bounds cost a fifth of an implicit substep, and most need none.

    Returns
    -------
    x : the root, in the unit of `c`
    evaluations : how often sin and cos were evaluated
    """
    size = abs(s)
    low, high = c - 2.0 * size, c + 2.0 * size
    x = c
    evaluations = 0
    while True:
        residual = (x - c) + s * sin(x)
        evaluations += 1
        if residual > 0.0:
            high = x
        else:
            low = x
        slope = 1.0 + s * cos(x)
        correction = residual / slope
        new = x - correction
        if size * correction * correction <= _QUARTER_ULP * slope * abs(new) or new == x:
            return new, evaluations
        if not low < new < high:
            new = 0.5 * (low + high)
            if not low < new < high:
                return x, evaluations
        x = new
