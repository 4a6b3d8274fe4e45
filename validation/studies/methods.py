"""The integration methods one by one: the discrete motion, the order, stability, and what each is made for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, hypot, pi, radians

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipk

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W0, W02, Experiment, Fmu, SolverMethod
from ..metrics import largest, observed_order, state_error
from ..references import discrete
from ..references.methods import METHODS, linear_radius
from .scene import Case, Scene
from .stability import measured_radius

TITLE = "Methods"
FORMULA = (
    "tableaux and the Taylor series of phi, each substep; |R(h*lambda)| <= 1; radius of convergence K(k')/w0"
)

EPS = 2.2e-16
RUNGE_KUTTA = tuple(method for method in SolverMethod if METHODS[method.name].tableau is not None)
ASYMPTOTIC = (  # R(z) where the drag is so strong that a step is far beyond the time of its decay
    (SolverMethod.ImplicitEuler, 0.0),
    (SolverMethod.ImplicitTrapezoid, 1.0),
    (SolverMethod.TRBDF2, 0.0),
    (SolverMethod.SDIRK4, 0.0),
)


# The discrete motion


@dataclass(frozen=True)
class SubstepScene(Scene):
    """Substeps of a damped and driven swing against the method as it is written: not small ones, but the right ones."""

    TITLE = "substeps of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the difference after each of ten substeps, none of which is a small step."""
        phi0, rate0, k2, torque, h, n = 1.2, 0.7, 0.5, 0.3, 0.1, 10
        start = {
            "gamma": k2,
            "phi_start": phi0,
            "w_start": rate0,
            "solver.method": self.method,
            "solver.stepSize": h,
        }
        run = fmu.run(Experiment(n * h, h, start, lambda _: torque, record=("phi", "w")))
        exact = discrete.motion(self.method.name, list(run.t), phi0, rate0, k2, W02, h, torque)
        yield Check(
            f"{n} substeps of {self.method.name} with drag and torque, h*w0 = {h * W0:.2g}",
            state_error(run["phi"], run["w"], exact),
            n * 4 * EPS * magnification(self.method),
            "four roundings of a substep, magnified by the coefficients with which stages enter the last one",
            "rad",
        )


def magnification(method: SolverMethod) -> float:
    """Return by how much roundings of stages can grow in a substep: sum |A_sj|/A_ss over the last row of A."""
    tableau = METHODS[method.name].tableau
    if tableau is None or not METHODS[method.name].stable:
        return 1.0
    *row, diagonal = tableau.A[-1]
    return sum(abs(a) / diagonal for a in (*row, diagonal))


# Orders


@dataclass(frozen=True)
class OrderScene(Scene):
    """The order of a method, seen on an undamped swing from 30 deg against elliptic functions."""

    TITLE = "order of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the order that steps of a 250th and a 500th of 0.9 periods show."""
        amplitude, n = radians(30), 250
        end = 0.9 * references.period(amplitude, W02)
        errors = [swing_error(fmu, self.method, amplitude, end, end / steps) for steps in (n, 2 * n)]
        order = METHODS[self.method.name].order
        yield Check(
            f"order of {self.method.name}",
            abs(observed_order(*errors) - order),
            2 * W0 * end / n,
            f"{order}; the next term of the error is a relative h*w0 = {W0 * end / n:.2g} with a factor near 1",
        )


def swing_error(fmu: Fmu, method: SolverMethod, amplitude: float, end: float, h: float) -> float:
    """Return the distance of (phi, w/w0) [rad] from the undamped swing at `end` [s]."""
    start = {"gamma": 0.0, "phi_start": amplitude, "solver.method": method, "solver.stepSize": h}
    run = fmu.run(Experiment(end, end, start, record=("phi", "w")))
    return state_error(run["phi"], run["w"], references.libration(run.t, amplitude, W02))


# TaylorSeries: radius of convergence


def radius_of_convergence(amplitude: float) -> float:
    """Return the smallest distance [s] of the real times from a pole of the undamped swing, K(k')/w0.

    sin(phi/2) = k*sn(K - w0*t), and sn has its poles at the distance K(k') from the real axis; [DLMF] 22.4.
    """
    return float(ellipk(np.cos(amplitude / 2) ** 2)) / W0


def truncation(x: float, radius: float, order: int) -> float:
    """Return a bound of the state error [rad] of a Taylor step x*`radius` [s], by the two nearest singularities.

    There phi is 2i*log of the distance, and the term k of its series is at most 4/k*x^k, that of w/w0 at most
    4/(w0*radius)*x^k.
    """
    return hypot(4 / (order + 1), 4 / (W0 * radius)) * x ** (order + 1) / (1 - x)


def _radius(fmu: Fmu) -> Iterator[Result]:
    """Take single Taylor steps from all phases of swings: their error follows from h over the radius."""
    order = METHODS["TaylorSeries"].order
    shares = np.array([0.17, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6])
    curves = []
    for angle in (30, 90, 150, 179):
        amplitude = radians(angle)
        radius = radius_of_convergence(amplitude)
        errors = [largest(_step_errors(fmu, amplitude, x * radius)) for x in shares]
        curves.append(Curve(f"{angle} deg, radius {radius:.3g} s", shares, errors, marker="o"))
        bounds = [1.5 * truncation(x, radius, order) + 16 * EPS * pi for x in shares]
        yield Check(
            f"Taylor step from all phases of a swing from {angle} deg, h up to 0.6 of the radius of convergence",
            largest(error / bound for error, bound in zip(errors, bounds, strict=True)),
            1.0,
            "of 1.5 x the terms beyond the order 16 by the nearest singularities, and rounding of the angle",
        )
    bound = [truncation(x, radius_of_convergence(radians(30)), order) for x in shares]
    yield Plot(
        "Error of one step of TaylorSeries, the largest from 16 phases of a swing",
        "h over the radius of convergence",
        "error of (phi, w/w0) [rad]",
        [*curves, Curve("nearest singularities, 30 deg", shares, bound, line="--")],
        "xy",
        note="Radius K(k')/w0 without drag. A step of a sixth errs by about 1e-13, a quarter 1e-10, a third 1e-8.",
    )


def _step_errors(fmu: Fmu, amplitude: float, h: float) -> Iterator[float]:
    T = references.period(amplitude, W02)
    for t in np.arange(16) * T / 16:
        phi, w = (float(x) for x in references.libration(np.array(t), amplitude, W02))
        start = {"gamma": 0.0, "phi_start": phi, "w_start": w, "solver.stepSize": h}
        run = fmu.run(
            Experiment(h, h, start | {"solver.method": SolverMethod.TaylorSeries}, record=("phi", "w"))
        )
        exact = references.libration(np.array([t + h]), amplitude, W02)
        yield state_error(run["phi"][-1:], run["w"][-1:], exact)


# Stability


@dataclass(frozen=True)
class StabilityScene(Scene):
    """One step of small motions against |R(h*lambda)|, R from the tableau, within and beyond the limits."""

    TITLE = "stability function of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the largest difference over a grid of damping rates and steps."""
        known = METHODS[self.method.name]
        # Longer substeps of the implicit methods are divided: a stage must have a single root.
        reach = 0.9 / known.tableau.A[-1][-1] if known.tableau is not None and known.stable else 5.0
        differences = []
        for k2 in (0.002, 1.0, 6.0, 50.0, 1e3):
            for share in (0.02, 0.1, 0.3, 0.6, 1.0):
                h = share * reach / max(W0, k2)
                expected = linear_radius(known, k2, W02, h)
                differences.append(
                    abs(measured_radius(fmu, self.method, k2, h) - expected) / max(1.0, expected)
                )
        yield Check(
            f"spectral radius of a step of {self.method.name}, {len(differences)} steps and damping rates",
            largest(differences),
            1e-13,
            "|R(h*lambda)|; rounding of a step from 1e-9 rad, magnified where the eigenvalues lie close together",
        )


def _limits_of_taylor(fmu: Fmu) -> Iterator[Result]:
    """Show that single steps of the linear pendulum stop to contract at the ends of the stable intervals."""
    # The smallest y > 0 with |R(iy)| = 1 and x > 0 with R(-x) = 1, R the polynomial of exp of degree 16, by mpmath.
    imaginary, real = 3.324813118538514420, 7.324333562787595322
    for name, k2, limit, margin in (
        ("undamped", 0.0, imaginary / W0, 1e-3),
        ("gamma/m = 1e6/s", 1e6, real / 1e6, 1e-8),
    ):
        inside, beyond = (
            measured_radius(fmu, SolverMethod.TaylorSeries, k2, limit * (1 + s * margin)) - 1 for s in (-1, 1)
        )
        yield Check(
            f"largest stable step of TaylorSeries, {name}",
            float(inside <= 4 * EPS) + float(beyond > 4 * EPS),
            2,
            f"{limit:.9g} s; a relative {margin:g} below it a step does not grow, above it it does",
            at_least=True,
        )


def _at_infinity(fmu: Fmu) -> Iterator[Result]:
    """Show what is left of a fast decay after one step far longer than it."""
    k2, h = 1e9, 1.0
    for method, expected in ASYMPTOTIC:
        start = {"gamma": k2, "phi_start": 0.0, "w_start": 1.0, "g": 0.0}
        start |= {"solver.method": method, "solver.stepSize": h}
        rate = float(fmu.run(Experiment(h, h, start, record=("w",)))["w"][-1])
        yield Check(
            f"{method.name} after a step of 1e9 decay times",
            abs(abs(rate) - expected),
            20 / (k2 * h),
            f"|R(-inf)| = {expected:g}, reached to within |R(z)| - |R(-inf)| = O(1/|z|), z = -1e9",
        )


def unit_curve(name: str, window: float) -> NDArray[np.complex128]:
    """Return z with |R(z)| = 1 from z = 0 on, R(z) = exp(i*theta), as far as it lies in |z| < `window`."""
    R = METHODS[name].stability
    step = 0.02
    points = []
    for direction in (1, -1):
        z, theta = 0j, 0.0
        while abs(z) < window and theta < 2 * pi * METHODS[name].order:
            theta += step
            for _ in range(20):
                slope = (R(z + 1e-6) - R(z - 1e-6)) / 2e-6
                correction = (R(z) - np.exp(1j * direction * theta)) / slope
                z -= correction
                if abs(correction) < 1e-12:
                    break
            points.append(z)
            if theta > pi and abs(z) < step:  # around
                break
        points = points[::-1]
    return np.array(points)


def _regions(_: Fmu) -> Iterator[Result]:
    """Draw where |R(z)| = 1."""
    curves = []
    for method in SolverMethod:
        z = unit_curve(method.name, 12.0)
        curves.append(Curve(method.name, z.real, z.imag))
    yield Plot(
        "|R(z)| = 1 in the plane of z = h*lambda",
        "Re(h*lambda)",
        "Im(h*lambda)",
        curves,
        note="The explicit methods are stable inside their curves, the implicit ones outside, on all of the left side.",
    )


# Energy


def _energy_of_the_trapezoid(fmu: Fmu) -> Iterator[Result]:
    """Follow the energy of an undamped swing from 90 deg for a thousand periods: it comes back."""
    amplitude, periods, n = radians(90), 1000, 100
    T = references.period(amplitude, W02)
    h = T / n
    start = {
        "gamma": 0.0,
        "phi_start": amplitude,
        "solver.method": SolverMethod.ImplicitTrapezoid,
        "solver.stepSize": h,
    }
    run = fmu.run(Experiment(periods * T, T / 20, start, record=("E",)))
    deviation = np.abs(run["E"] - run["E"][0])
    # The modified equation conserves E + h^2/12*D, D = w02*w^2*cos(phi) + w02^2*sin(phi)^2 per m*L^2.
    orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
    D = W02 * orbit[1] ** 2 * np.cos(orbit[0]) + W02**2 * np.sin(orbit[0]) ** 2
    predicted = h * h / 12 * float(np.max(np.abs(D - D[0])))
    z2 = (h * W0) ** 2
    for name, part in (("first", deviation[: 20 * 10]), ("last", deviation[-20 * 10 :])):
        yield Check(
            f"energy of ImplicitTrapezoid from 90 deg, largest deviation in the {name} ten of {periods} periods",
            abs(largest(part) / predicted - 1),
            2 * z2 + 0.05,
            f"{predicted / run['E'][0]:.3e} of E: E + h^2/12*D is conserved; the next term is (h*w0)^2, and 20 points "
            "a period miss the largest by up to 5 percent",
        )


# What Crawford calls impossible


def _gear(fmu: Fmu) -> Iterator[Result]:
    """Run Gear's second-order formula, within TRBDF2, on the nonlinear equation."""
    amplitude, end = radians(30), 1.0
    steps = (0.02, 0.01, 0.005, 0.0025)
    errors = [swing_error(fmu, SolverMethod.TRBDF2, amplitude, end, h) for h in steps]
    for h, coarse, fine in zip(steps, errors, errors[1:], strict=False):
        yield Check(
            f"order of TRBDF2 on the nonlinear equation, h = {h:g} and {h / 2:g} s",
            abs(observed_order(coarse, fine) - 2),
            (h * W0) ** 2,
            "2; the next term of the error is a relative (h*w0)^2",
        )
    yield Table(
        "Gear's second-order formula on the nonlinear equation, 30 deg, 1 s",
        ("h [s]", "error of (phi, w/w0) [rad]"),
        [(f"{h:g}", f"{error:.3e}") for h, error in zip(steps, errors, strict=True)],
        note="Crawford, section 4, calls the method impossible here: TRBDF2 does it, by Newton's method in each stage.",
    )


# Stiff drag


@dataclass(frozen=True)
class StiffScene(Scene):
    """A fall from 90 deg through drag of 1e6/s, 1e5 s: the order of an L-stable method, and its error."""

    TITLE = "stiff drag with {0.method.name}"

    method: SolverMethod
    steps: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the order and the error of the finer run."""
        k2, end, amplitude = 1e6, 1e5, pi / 2
        exact, _ = references.overdamped_fall(end, amplitude, k2, W02)
        errors = []
        for n in (self.steps, 2 * self.steps):
            start = {"gamma": k2, "phi_start": amplitude}
            start |= {"solver.method": self.method, "solver.stepSize": end / n}
            phi = fmu.run(Experiment(end, end, start))["phi"][-1]
            errors.append(abs(float(phi - exact)))
        order = METHODS[self.method.name].order
        x = W02 / k2 * end / self.steps  # the substep in times of the slow fall
        linear = abs(METHODS[self.method.name].stability(-x / 2) - exp(-x / 2)) * 2 * self.steps
        yield Check(
            f"order of {self.method.name} at gamma/m = 1e6/s, {self.steps} and {2 * self.steps} steps in 1e5 s",
            abs(observed_order(*errors) - order),
            2 * x,
            f"{order}: L-stable, so that the fast decay does not show; the next term is a relative h*w02/k2 = {x:.2g}",
        )
        yield Check(
            f"error of {self.method.name} at gamma/m = 1e6/s with {2 * self.steps} steps in 1e5 s",
            errors[1],
            3 * linear,
            f"3 x the error of the linear fall, n*|R(-x) - exp(-x)| with x = h*w02/k2 = {x / 2:.2g}",
            "rad",
        )


SCENES = (
    *(SubstepScene(method) for method in SolverMethod),
    *(OrderScene(method) for method in RUNGE_KUTTA),
    Case("radius of convergence", _radius),
    *(StabilityScene(method) for method in SolverMethod),
    Case("largest stable steps of TaylorSeries", _limits_of_taylor),
    Case("fast decay", _at_infinity),
    Case("stability regions", _regions),
    Case("energy of ImplicitTrapezoid", _energy_of_the_trapezoid),
    Case("Gear's formula", _gear),
    StiffScene(SolverMethod.ImplicitEuler, 1000),
    StiffScene(SolverMethod.TRBDF2, 100),
    StiffScene(SolverMethod.SDIRK4, 20),
)
