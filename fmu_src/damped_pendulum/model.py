"""Equation of motion and energy of the damped pendulum.

In the notation of Modelica, with the angle `phi` [rad] counted from the downward vertical:

    J*der(w) = tau - gamma*L^2*w - m*g*L*sin(phi)
    der(phi) = w
    J = m*L^2

Divided by J this is Grillo, "Exercise: the pendulum", with k^2 = gamma/m and omega_0^2 = g/L.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, sin
from typing import NamedTuple

Acceleration = Callable[[float, float], float]


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
        """Return drive, drag and gravity, the factors of the terms of der(w)."""
        return self.drive, -self.damping_rate, -self.w02

    def acting_terms(self) -> str:
        """Return der(w) as an expression of phi, w and the coefficients that leaves out the terms that are zero.

        Its value equals that of the full form.
        """
        terms = ("drive", "drag * w", "gravity * sin(phi)")
        acting = [term for term, factor in zip(terms, self.coefficients(), strict=True) if factor]
        return " + ".join(acting) or "0.0"


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
        return self.m * self.L * self.L

    def motion(self, tau: float = 0.0) -> Motion:
        """Return the terms of der(w) under the torque `tau` [N.m]."""
        return Motion(self.gamma / self.m, self.g / self.L, tau / self.J)

    def out_of_range(self) -> list[str]:
        """Return what cannot be computed with although each parameter by itself is allowed."""
        J = self.J
        if not 0.0 < J < float("inf"):
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
        half = sin(phi / 2.0)
        return 0.5 * self.J * w * w + 2.0 * self.m * self.g * self.L * (half * half)
