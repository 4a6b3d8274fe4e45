"""Largest stable steps, growth per period and the traps of the nonlinear pendulum, measured through the FMU."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import atan2, hypot, log, pi, radians, sqrt

import numpy as np
from numpy.typing import NDArray

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W0, W02, Experiment, Fmu, SolverMethod
from ..metrics import largest
from ..references.methods import METHODS, linear_radius
from .scene import Case, Scene

TITLE = "Stability"
FORMULA = "|R(h*lambda)| <= 1, lambda = (-k2 +- sqrt(k2^2 - 4*w02))/2, R(z) = 1 + z + ... + z^p/p!"

EXPLICIT = (SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2, SolverMethod.ExplicitRungeKutta4)
SMALL = 1e-9  # start [rad] for the one-step map: the nonlinearity is a relative SMALL^2/6
DAMPING_RATES = (0.002, 1.0, 6.26, 50.0, 1e3, 1e6)


@dataclass(frozen=True)
class LimitScene(Scene):
    """The largest stable step of a method at the damping rates `DAMPING_RATES`."""

    TITLE = "stability limit of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the limit at every damping rate."""
        method = METHODS[self.method.name]
        rows = []
        for k2 in DAMPING_RATES:
            measured = largest_stable_step(partial(measured_radius, fmu, self.method, k2), k2)
            expected = largest_stable_step(partial(linear_radius, method, k2, W02), k2)
            rows.append((k2, measured, expected))
            yield Check(
                f"largest stable step of {self.method.name} at k2 = {k2:g}/s",
                abs(measured / expected - 1),
                1e-6,
                f"theory {expected:.9g} s; both bisected to 1e-9, roundings of the map matter most at small damping",
            )
        yield Table(
            f"Largest stable step of {self.method.name}",
            ("k2 [1/s]", "measured through the FMU [s]", "from |R| <= 1 [s]"),
            [(f"{k2:g}", f"{measured:.9g}", f"{expected:.9g}") for k2, measured, expected in rows],
        )


@dataclass(frozen=True)
class MapScene(Scene):
    """The stability map of a method in the plane of damping rate and step."""

    TITLE = "stability map of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield how many steps are judged otherwise than by |R|, and the map."""
        method = METHODS[self.method.name]
        damping_rates = np.logspace(-2.5, 4, 40)
        steps = np.logspace(-4, 0.5, 40)
        radius = np.array([[measured_radius(fmu, self.method, k2, h) for k2 in damping_rates] for h in steps])
        expected = np.array([[linear_radius(method, k2, W02, h) for k2 in damping_rates] for h in steps])
        decided = ~(np.abs(expected - 1) <= 1e-12)  # closer to the boundary than that, rounding decides
        right = np.where(expected > 1, radius > 1, radius <= 1)  # NaN is neither
        wrong = decided & ~right
        yield Check(
            f"stability map of {self.method.name}",
            int(np.sum(wrong)),
            0,
            f"steps judged otherwise than by |R|, of {int(np.sum(decided))}",
        )
        fine = np.logspace(-2.5, 4, 200)
        boundary = [largest_stable_step(partial(linear_radius, method, k2, W02), k2) for k2 in fine]
        yield Plot(
            f"Stability of {self.method.name} (grey: unstable, measured through the FMU)",
            "k2 = gamma/m [1/s]",
            "h [s]",
            [Curve("|R(h*lambda)| = 1", fine, boundary)],
            "xy",
            y_range=(1e-4, 10**0.5),
            shade=(damping_rates, steps, radius > 1),
            headline=True,
        )


@dataclass(frozen=True)
class GrowthScene(Scene):
    """Growth and frequency shift per period without damping: (factor, exponent) of the leading terms in z = h*w0."""

    TITLE = "growth per period of {0.method.name}"

    method: SolverMethod
    growth: tuple[float, int]
    shift: tuple[float, int]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        for z in (0.05, 0.1, 0.2):
            matrix = one_step_map(fmu, self.method, 0.0, z / W0)
            angle = atan2(sqrt(-matrix[0, 1] * matrix[1, 0]), (matrix[0, 0] + matrix[1, 1]) / 2)
            for what, measured, (factor, power) in (
                ("ln of the amplitude factor", 2 * pi / angle * log(spectral_radius(matrix)), self.growth),
                ("relative frequency shift", angle / z - 1, self.shift),
            ):
                predicted = factor * z**power
                # Rounding of the map shows in log and angle, a period has 2*pi/z of them.
                bound = 2 * z * z + 4e-16 * 2 * pi / z / abs(predicted)
                yield Check(
                    f"{what} per period, {self.method.name}, h*w0 = {z:g}",
                    abs(measured / predicted - 1),
                    bound,
                    f"{predicted:.4e} in theory; the next term is a relative z^2 with a factor below 2, and rounding",
                )


@dataclass(frozen=True)
class DriftScene(Scene):
    """Energy drift per period of large undamped swings; `h` [s] is rounded so that it divides the period."""

    TITLE = "energy drift of {0.method.name}"

    method: SolverMethod
    h: float
    next_term: Callable[[float], float]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        method = METHODS[self.method.name]
        for angle in (30, 90, 150):
            amplitude = radians(angle)
            T = references.period(amplitude, W02)
            n = round(T / self.h)
            h = T / n
            start = {
                "gamma": 0.0,
                "phi_start": amplitude,
                "solver.method": self.method,
                "solver.stepSize": h,
            }
            energy = fmu.run(Experiment(T, T, start, record=("E",)))["E"]
            # The trapezoidal rule over a whole period converges exponentially.
            orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
            predicted = T * method.energy_drift(h, orbit, W02)
            yield Check(
                f"energy drift per period of {self.method.name} at {angle} deg",
                abs((energy[-1] - energy[0]) / predicted - 1),
                self.next_term(h * W0),
                f"{predicted / energy[0]:.4e} of E in theory; the next term bounds it, h*w0 = {h * W0:.3g}",
            )


# The one-step map


def one_step_map(fmu: Fmu, method: SolverMethod, k2: float, h: float) -> NDArray[np.float64]:
    """Return the matrix of one step of small motions in (phi, w/w0), measured from two starts."""
    columns = []
    for phi, w in ((SMALL, 0.0), (0.0, SMALL * W0)):
        start = {"gamma": k2, "phi_start": phi, "w_start": w, "solver.method": method, "solver.stepSize": h}
        run = fmu.run(Experiment(h, h, start, record=("phi", "w")))
        columns.append((run["phi"][-1] / SMALL, run["w"][-1] / (SMALL * W0)))
    return np.array(columns).T


def spectral_radius(matrix: NDArray[np.float64]) -> float:
    """Return the larger modulus of the eigenvalues of a 2x2 matrix; of a complex pair it is sqrt(det)."""
    half_trace = (matrix[0, 0] + matrix[1, 1]) / 2
    # (a - d)^2/4 + b*c instead of trace^2/4 - det: near a double eigenvalue the latter cancels.
    discriminant = ((matrix[0, 0] - matrix[1, 1]) / 2) ** 2 + matrix[0, 1] * matrix[1, 0]
    if discriminant < 0:
        return hypot(half_trace, sqrt(-discriminant))
    return float(abs(half_trace) + sqrt(discriminant))


def measured_radius(fmu: Fmu, method: SolverMethod, k2: float, h: float) -> float:
    """Return the spectral radius of one step of small motions."""
    return spectral_radius(one_step_map(fmu, method, k2, h))


def largest_stable_step(radius: Callable[[float], float], k2: float) -> float:
    """Return the step [s] at which `radius` passes 1, by bisection."""
    fastest = max(W0, k2)
    stable, unstable = 1e-6 / fastest, 4 / fastest
    while unstable - stable > 1e-9 * stable:
        middle = (stable + unstable) / 2
        if radius(middle) <= 1:
            stable = middle
        else:
            unstable = middle
    return stable


# Traps


def settled(fmu: Fmu, start: dict[str, float], time: float) -> dict[str, float]:
    """Return `start` with the state after `time` [s], reached in one communication step."""
    run = fmu.run(Experiment(time, time, start, record=("phi", "w")))
    return start | {"phi_start": float(run["phi"][-1]), "w_start": float(run["w"][-1])}


def _limit_cycle(fmu: Fmu) -> Iterator[Result]:
    """Show that ExplicitEuler beyond its limit neither diverges nor settles: it swings for ever."""
    k2 = 0.02
    for angle in (60, 90, 120):
        t = np.arange(400) / 400
        amplitude = radians(angle)
        q, p = references.libration(t * references.period(amplitude, W02), amplitude, W02)
        ratio = float(W02 * np.mean(p**2) / np.mean((W02 * np.sin(q)) ** 2))
        h = ratio * k2 / W02
        start = {
            "gamma": k2,
            "phi_start": amplitude / 2,
            "solver.method": SolverMethod.ExplicitEuler,
            "solver.stepSize": h,
        }
        # The amplitude settles at a rate of at least a tenth of k2, so this leaves e^-10.
        swing = fmu.run(Experiment(4.0, h, settled(fmu, start, 100 / k2)))["phi"]
        yield Check(
            f"spurious limit cycle of ExplicitEuler at {angle} deg",
            abs(float(np.max(np.abs(swing))) / amplitude - 1),
            h * W0,
            f"h*w02/k2 = {ratio:.5f}; the balance of energy is the leading term in h*w0",
        )


def _permanent_spin(fmu: Fmu) -> Iterator[Result]:
    """Show that ExplicitEuler turns a small swing into a spin for ever, at a rate that looks plausible."""
    for h in (1e-3, 1e-2):
        expected = W02 * sqrt(h / (2 * 0.002))
        start = {"phi_start": 1e-3, "solver.method": SolverMethod.ExplicitEuler, "solver.stepSize": h}
        # The small swing grows at w02*h - k2 over two, the spin then settles at k2.
        turning = settled(fmu, start, 9000.0)
        w = fmu.run(Experiment(50.0, 0.01, turning, record=("w",)))["w"]
        yield Check(
            f"permanent spin of ExplicitEuler at h = {h:g} s",
            abs(float(np.sqrt(np.mean(w**2))) / expected - 1),
            (W02 / expected**2) ** 2,
            f"{expected:.4f} rad/s in theory; gravity modulates the rate by w02/Omega^2, which enters squared",
        )


def _escape(fmu: Fmu) -> Iterator[Result]:
    """Show that RK4 throws a large swing over the top at half of the linear limit."""
    for h, escapes in ((0.43, False), (0.46, True)):
        start = {"gamma": 0.0, "phi_start": radians(170), "solver.stepSize": h}
        phi = fmu.run(Experiment(3000 * h, h, start))["phi"]
        top = float(np.max(np.abs(phi)))
        yield Check(
            f"RK4 from 170 deg at h = {h:g} s {'leaves' if escapes else 'stays in'} the well",
            top,
            pi,
            "escape begins at h = 0.4419 s, bisected in independent arithmetic; the linear limit is 0.9032 s",
            "rad",
            at_least=escapes,
        )


def _stiff_amplitude(fmu: Fmu) -> Iterator[Result]:
    """Show that the linear limit is not safe above 90 deg, where gravity pushes the fast eigenvalue out."""
    k2 = 50.0
    safe = 2.7852935634052816 / ((k2 + sqrt(k2 * k2 + 4 * W02)) / 2)
    for angle, h, diverges in ((30, 0.0559, False), (170, 0.0559, True), (170, 0.999 * safe, False)):
        start = {"gamma": k2, "phi_start": radians(angle), "solver.stepSize": h}
        w = fmu.run(Experiment(400 * h, h, start, record=("w",)))["w"]
        # Below the limit the rate never exceeds that of the overdamped fall, w02/k2.
        yield Check(
            f"RK4 with k2 = 50/s from {angle} deg at h = {h:.5g} s {'is lost' if diverges else 'is stable'}",
            float(np.max(np.abs(w))),
            10 * W02 / k2 if diverges else W02 / k2,
            f"linear limit 0.05593 s, limit at the top {safe:.5g} s; the fall is never faster than w02/k2",
            "rad/s",
            at_least=diverges,
        )


def _several_roots(fmu: Fmu) -> Iterator[Result]:
    """Show that long steps of backward Euler have several roots, and that the FMU divides them until there is one."""
    for h, expected in ((1.0, 7), (2.0, 25)):
        s, c = h * h * W02, 2.0 + h * 1.3
        x = np.linspace(c - s - 1, c + s + 1, 2_000_001)
        roots = int(np.sum(np.diff(np.sign(x + s * np.sin(x) - c)) != 0))
        yield Check(
            f"roots of one step of backward Euler at h = {h:g} s beyond the known {expected}",
            abs(roots - expected),
            0,
            f"x + s*sin(x) = c with s = {s:.4g}, c = {c:.4g} has {expected} roots",
        )
    for h in (0.6, 2.0):
        start = {
            "gamma": 0.0,
            "phi_start": 2.0,
            "solver.method": SolverMethod.ImplicitEuler,
            "solver.stepSize": h,
        }
        phi = fmu.run(Experiment(200 * h, h, start))["phi"]
        yield Check(
            f"ImplicitEuler with solver.stepSize = {h:g} s stays in the well",
            float(np.max(np.abs(phi))),
            2.0,
            "with one root it takes energy out at every substep, so it never passes its start",
            "rad",
        )
    for h in (0.65, 1.0):
        start = {
            "gamma": 0.0,
            "phi_start": pi - 1e-3,
            "solver.method": SolverMethod.ImplicitEuler,
            "solver.stepSize": h,
        }
        phi = fmu.run(Experiment(100.0, h, start))["phi"]
        yield Check(
            f"ImplicitEuler falls from the upright position at solver.stepSize = {h:g} s",
            abs(float(phi[-1])),
            0.01,
            "undivided steps above 0.63866 s would stay upright for ever; the swing decays faster than exp(-0.3*t)",
            "rad",
        )


def _implicit_is_stable(fmu: Fmu) -> Iterator[Result]:
    worst = largest(
        measured_radius(fmu, SolverMethod.ImplicitEuler, k2, h)
        for k2 in (0.0, *DAMPING_RATES)
        for h in (1e-3, 1.0, 1e3)
    )
    yield Check("spectral radius of ImplicitEuler", worst, 1.0, "|R| = 1/|1 - h*lambda| < 1 for every step")


SCENES = (
    *(LimitScene(method) for method in EXPLICIT),
    Case("ImplicitEuler has no limit", _implicit_is_stable),
    *(MapScene(method) for method in EXPLICIT),
    GrowthScene(SolverMethod.ExplicitEuler, (pi, 1), (-1 / 3, 2)),
    GrowthScene(SolverMethod.ImplicitEuler, (-pi, 1), (-1 / 3, 2)),
    GrowthScene(SolverMethod.ExplicitMidPoint2, (pi / 4, 3), (1 / 6, 2)),
    GrowthScene(SolverMethod.ExplicitRungeKutta4, (-pi / 72, 5), (-1 / 120, 4)),
    DriftScene(SolverMethod.ExplicitEuler, 1e-4, lambda z: pi * z),
    DriftScene(SolverMethod.ExplicitMidPoint2, 5e-3, lambda z: z * z),
    DriftScene(SolverMethod.ExplicitRungeKutta4, 0.02, lambda z: z * z),
    Case("spurious limit cycle", _limit_cycle),
    Case("permanent spin", _permanent_spin),
    Case("escape from the well", _escape),
    Case("stiff drag at large angles", _stiff_amplitude),
    Case("several roots", _several_roots),
)
