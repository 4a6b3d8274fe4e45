"""The integration methods by the names of the interface: order, stability function, and what they do to the energy.

Stability functions follow from the tableaux, which are diagonally implicit at most: the stages of y' = lambda*y are
found one after the other. z = h*lambda. Sources: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I;
Hairer, Wanner, II, IV.6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from scipy import special

from .arrays import Array, State
from .linear import real_roots

Drift = Callable[[Array, Array, float], Array]


@dataclass(frozen=True)
class Tableau:
    """A Runge-Kutta method: rows of A up to the diagonal, and the weights b."""

    A: Sequence[Sequence[float]]
    b: Sequence[float]

    @property
    def weight(self) -> float:
        """The sum of |b|, by which roundings of the stages enter the step."""
        return sum(map(abs, self.b))

    def stability(self, z: complex) -> complex:
        """Return R(z), the factor of a step of y' = lambda*y."""
        slopes: list[complex] = []  # of the stages, in units of lambda*y
        for row in self.A:
            diagonal = row[len(slopes)] if len(row) > len(slopes) else 0.0
            known = 1 + z * _dot(row, slopes)
            slopes.append(known / (1 - z * diagonal))
        return 1 + z * _dot(self.b, slopes)


def _dot(weights: Sequence[float], slopes: Sequence[complex]) -> complex:
    total = 0j
    for weight, slope in zip(weights, slopes, strict=False):
        total += weight * slope
    return total


def taylor_stability(order: int, z: complex) -> complex:
    """Return the Taylor polynomial of exp(z) of the degree `order`."""
    total = term = 1 + 0j
    for n in range(1, order + 1):
        term *= z / n
        total += term
    return total


@dataclass(frozen=True)
class Method:
    """What is known of a method.

    Attributes
    ----------
    order : of the error at a fixed time
    tableau : of a Runge-Kutta method; None is the Taylor series of the solution up to `order`
    real_limit : h*lambda in [-real_limit, 0] is stable; inf: all of the left half plane is
    drift_power, drift : dE/dt = h^drift_power*drift(phi, w, w02) per m*L^2, the leading dissipative term of the
        modified equation of the undamped pendulum along the exact orbit
    """

    order: int
    tableau: Tableau | None = None
    real_limit: float = inf
    drift_power: int = 0
    drift: Drift | None = None

    @property
    def stable(self) -> bool:
        """Whether no step is too long for the damped linear pendulum."""
        return self.real_limit == inf

    def stability(self, z: complex) -> complex:
        """Return R(z), the factor of a step of y' = lambda*y."""
        return taylor_stability(self.order, z) if self.tableau is None else self.tableau.stability(z)

    def energy_drift(self, h: float, orbit: State, w02: float) -> float:
        """Return the mean of dE/dt per m*L^2 [rad2/s3], steps of `h` [s], over equidistant states of a period."""
        if self.drift is None:
            raise ValueError("the dissipative term of this method's modified equation is not given")
        return h**self.drift_power * float(np.mean(self.drift(*orbit, w02)))


def _euler_drift(q: Array, p: Array, w02: float) -> Array:
    return np.asarray(w02 * (p**2 * np.cos(q) + w02 * np.sin(q) ** 2) / 2)


def _implicit_euler_drift(q: Array, p: Array, w02: float) -> Array:
    return -_euler_drift(q, p, w02)


def _midpoint_drift(q: Array, p: Array, w02: float) -> Array:
    return np.asarray(
        w02**2 * (2 * p**2 * np.cos(q) ** 2 + (p**2 + 2 * w02 * np.cos(q)) * np.sin(q) ** 2) / 16
    )


def _rk4_drift(q: Array, p: Array, w02: float) -> Array:
    c = np.cos(q)
    return np.asarray(
        w02**2 * (-(p**4) + p**2 * w02 * c**3 - 5 * p**2 * w02 * c + 4 * w02**2 * (c**4 - c**2)) / 576
    )


EULER = Tableau(A=[[]], b=[1])
MIDPOINT = Tableau(A=[[], [1 / 2]], b=[0, 1])
RK4 = Tableau(A=[[], [1 / 2], [0, 1 / 2], [0, 0, 1]], b=[1 / 6, 1 / 3, 1 / 3, 1 / 6])
IMPLICIT_EULER = Tableau(A=[[1]], b=[1])
TRAPEZOID = Tableau(A=[[], [1 / 2, 1 / 2]], b=[1 / 2, 1 / 2])
GAMMA = 2 - sqrt(2)  # of TR-BDF2: both of its implicit stages have the same diagonal
TRBDF2 = Tableau(
    A=[[], [GAMMA / 2, GAMMA / 2], [1 / (2 * (2 - GAMMA)), 1 / (2 * (2 - GAMMA)), (1 - GAMMA) / (2 - GAMMA)]],
    b=[1 / (2 * (2 - GAMMA)), 1 / (2 * (2 - GAMMA)), (1 - GAMMA) / (2 - GAMMA)],
)
SDIRK4 = Tableau(  # Hairer, Wanner II, table IV.6.5
    A=[
        [1 / 4],
        [1 / 2, 1 / 4],
        [17 / 50, -1 / 25, 1 / 4],
        [371 / 1360, -137 / 2720, 15 / 544, 1 / 4],
        [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
    ],
    b=[25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
)

METHODS = {
    "ExplicitEuler": Method(1, EULER, 2.0, drift_power=1, drift=_euler_drift),
    "ExplicitMidPoint2": Method(2, MIDPOINT, 2.0, drift_power=3, drift=_midpoint_drift),
    "ExplicitRungeKutta4": Method(  # |R(-x)| = 1 is x^3 - 4*x^2 + 12*x - 24 = 0
        4, RK4, 2.7852935634052816, drift_power=5, drift=_rk4_drift
    ),
    "ImplicitEuler": Method(1, IMPLICIT_EULER, drift_power=1, drift=_implicit_euler_drift),
    "ImplicitTrapezoid": Method(2, TRAPEZOID),
    "TRBDF2": Method(2, TRBDF2),
    "SDIRK4": Method(4, SDIRK4),
    "TaylorSeries": Method(16, real_limit=7.3243335628),
}


def rk4_lag(amplitude: float) -> float:
    """Return c of the relative growth c*(h*w0)^4 of RK4's period of undamped swings from `amplitude` [rad].

    c = (1 + 29*m + 6*m^2 + 35*(1 - 2*m)*E(m)/K(m))/4320 with the complete elliptic integrals of m = sin(amplitude/2)^2,
    1/120 for small swings. Found by integer relations (PSLQ) between runs of the method in 60 digits, extrapolated to
    h = 0, for eight rational m.
    """
    m = np.sin(amplitude / 2) ** 2
    ratio = special.ellipe(m) / special.ellipkm1(np.cos(amplitude / 2) ** 2)
    return float((1 + 29 * m + 6 * m * m + 35 * (1 - 2 * m) * ratio) / 4320)


def linear_radius(method: Method, k2: float, w02: float, h: float) -> float:
    """Return max |R(h*lambda)| over the two eigenvalues of the linear pendulum, the spectral radius of a step."""
    if k2 * k2 / 4 > w02:
        return max(abs(method.stability(-h * rate)) for rate in real_roots(k2, w02))
    return abs(method.stability(h * complex(-k2 / 2, sqrt(w02 - k2 * k2 / 4))))
