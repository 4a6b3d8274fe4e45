"""Equation of motion and energy of a mass on a hardening spring with linear drag (Duffing).

    m*der(v) = F - c*v - k*x - k3*x^3,   der(x) = v

`methods.motion.Motion` and `fmi.second_order.Model` say what each method is for.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf, isfinite
from typing import NamedTuple

from methods.implicit import newton_stage
from methods.motion import Acceleration, ImplicitStage, TaylorStep
from methods.taylor import convolution, total


class Motion(NamedTuple):
    """The terms of der(v) under a constant force: c/m [1/s], k/m [1/s2], k3/m [1/(m2.s2)], F/m [m/s2]."""

    damping_rate: float
    w02: float
    hardening: float
    drive: float

    def acceleration(self) -> Acceleration:
        """Return der(v) [m/s2] as a function of x [m] and v [m/s]."""
        drive, drag, spring, cubic = self.coefficients()
        return lambda x, v: drive + drag * v + spring * x + cubic * x * x * x

    def partial_derivatives(self, x: float, v: float) -> tuple[float, float]:
        """Return those of der(v) with respect to x [1/s2] and v [1/s]."""
        return -self.w02 - 3.0 * self.hardening * x * x, -self.damping_rate

    def coefficients(self) -> tuple[float, ...]:
        return self.drive, -self.damping_rate, -self.w02, -self.hardening

    @staticmethod
    def terms() -> dict[str, str]:
        """Return the terms of `acceleration`."""
        cubic = "cubic * x * x * x"
        return {"drive": "drive", "drag": "drag * v", "spring": "spring * x", "cubic": cubic}

    @staticmethod
    def functions() -> dict[str, Callable[[float], float]]:
        return {}

    def implicit_stage(self, b: float) -> ImplicitStage:
        return partial(newton_stage, self.acceleration(), self.partial_derivatives, b)

    def longest_implicit_stage(self) -> float:
        return inf  # the force rises with x

    def taylor_step(self, h: float, order: int) -> TaylorStep:
        """Return x and v after `h` [s] as a function of them; k3*x^3 is a product of series."""
        drive, drag, spring, cubic = self.coefficients()

        def step(x: float, v: float) -> tuple[float, float]:
            positions, rates, first, second = [x], [v], list[float](), list[float]()
            for k in range(order):
                first.append(cubic * positions[k])
                second.append(convolution(first, positions, k))
                third = convolution(second, positions, k)
                a = (drive if k == 0 else 0.0) + drag * rates[k] + spring * positions[k] + third
                positions.append(h / (k + 1) * rates[k])
                rates.append(h / (k + 1) * a)
            return total(positions), total(rates)

        return step


class Spring(NamedTuple):
    """Mass m [kg] > 0, drag c [N.s/m], stiffness k [N/m] and hardening k3 [N/m3], all >= 0."""

    m: float
    c: float
    k: float
    k3: float

    def motion(self, F: float) -> Motion:
        """Return the terms of der(v) under the force `F` [N]."""
        return Motion(self.c / self.m, self.k / self.m, self.k3 / self.m, F / self.m + 0.0)

    def out_of_range(self) -> list[str]:
        """Return which rates leave the range of a double although each parameter by itself is allowed."""
        rates = zip(("c/m", "k/m", "k3/m"), self.motion(0.0), ("1/s", "1/s2", "1/(m2.s2)"), strict=False)
        wrong = (rate for rate in rates if not isfinite(rate[1]))
        return [f"{name} = {value!r} {unit} is out of the range of a double" for name, value, unit in wrong]

    def energy(self, x: float, v: float) -> float:
        """Return the mechanical energy [J], 0 at rest in the middle."""
        square = x * x
        return 0.5 * self.m * (v * v) + (0.5 * self.k * square + 0.25 * self.k3 * square * square)
