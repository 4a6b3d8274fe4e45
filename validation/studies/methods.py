"""The integration methods one by one: the discrete motion, the order, the energy, and what each is made for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import hypot, pi, radians, sqrt

import numpy as np
from scipy.special import ellipk

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import OUTPUTS, W0, W02, Experiment, Fmu, SolverMethod, swing
from ..metrics import NEXT, SAFETY, SIGMAS, UNIT, Array, largest, observed_order, state_error, walk
from ..references import discrete
from ..references.methods import METHODS
from ..styles import STYLES
from .scene import Case, Scene

TITLE = "Methods"
FORMULA = (
    "tableaux and the Taylor series of phi; radius of convergence K(k')/w0; dE/dt by the modified equation"
)

RUNGE_KUTTA = tuple(method for method in SolverMethod if METHODS[method.name].tableau is not None)


# The discrete motion

# A drive [1/s2] and its derivatives by time when a communication step begins, a row each.
CUBICS = np.array(((0.3, -0.5, 0.8, -0.7), (-0.2, 0.6, -0.4, 0.9), (0.1, 0.2, 0.3, 0.4)))


@dataclass(frozen=True)
class SubstepScene(Scene):
    """Substeps of a damped and driven swing against the method as it is written: not small ones, but the right ones.

    And the outputs that follow from the state, with every parameter another than 1.
    """

    TITLE = "substeps of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the difference after each of ten substeps, none of which is a small step, and that of the outputs.

        And, where the FMU interpolates its input, after substeps under a torque that is a cubic in each step.
        """
        phi0, rate0, k2, h, n = 1.2, 0.7, 0.5, 0.1, 10
        drives = [0.3 * (-1) ** i + 0.1 * i for i in range(n)]  # another in each communication step
        m, L = 2.0, 0.25  # powers of two: they cost no rounding
        J, gamma, g = m * L * L, k2 * m, W02 * L
        start = {
            "m": m,
            "L": L,
            "gamma": gamma,
            "g": g,
            "phi_start": phi0,
            "w_start": rate0,
            "solver.method": self.method,
            "solver.stepSize": h,
        }
        experiment = Experiment(n * h, h, start, record=("phi", "w", "a", "E"))
        times = experiment.times()
        torque = dict(zip(times, drives, strict=False))
        run = fmu.run(replace(experiment, torque=lambda t: torque[t] * J))
        exact = discrete.motion(self.method.name, times, phi0, rate0, k2, W02, h, drives)
        yield Check(
            f"{n} substeps of {self.method.name} with drag and torque, h*w0 = {h * W0:.2g}",
            state_error(run["phi"], run["w"], exact),
            n * 7 * UNIT * magnification(self.method),
            "four roundings of a substep of the FMU, three here, magnified by the coefficients with which stages enter "
            "the last one",
            "rad",
        )
        phi, w = run["phi"], run["w"]
        torques = np.array(
            (np.append(0.0, np.array(drives) * J), -gamma * L * L * w, -m * g * L * np.sin(phi))
        )
        energies = np.array((J / 2 * w**2, 2 * m * g * L * np.sin(phi / 2) ** 2))
        yield Check(
            f"a and E after substeps of {self.method.name}",
            largest(
                np.max(np.abs(output - terms.sum(axis=0)) / np.abs(terms).sum(axis=0))
                for output, terms in ((J * run["a"], torques), (run["E"], energies))
            ),
            7 * UNIT,
            "J*a = tau - gamma*L^2*w - m*g*L*sin(phi), tau set after the start, E = J*w^2/2 + 2*m*g*L*sin(phi/2)^2, "
            "relative to their terms; four roundings of the FMU, three here",
        )
        if not fmu.interpolates:
            return
        H = 3 * h
        experiment = Experiment(3 * H, H, start, record=("phi", "w", "a"), inputs=J * CUBICS)
        run = fmu.run(experiment)
        exact = discrete.motion(
            self.method.name, experiment.times(), phi0, rate0, k2, W02, h, CUBICS.tolist()
        )
        yield Check(
            f"substeps of {self.method.name} under a torque that is a cubic in each step of three",
            state_error(run["phi"], run["w"], exact),
            9 * 13 * UNIT * magnification(self.method),
            "at the end of each step; as before, and three roundings of the torque here and there; it is taken at the "
            "nodes of the tableau, or as a series",
            "rad",
        )
        ends = CUBICS @ (1, H, H**2 / 2, H**3 / 6)
        terms = np.array((ends, -k2 * run["w"][1:], -W02 * np.sin(run["phi"][1:])))
        yield Check(
            f"a after steps of {self.method.name} under a torque that is a cubic in each",
            largest(np.abs(run["a"][1:] - terms.sum(axis=0)) / np.abs(terms).sum(axis=0)),
            13 * UNIT,
            "at the end of each step, of the torque there, too; relative to its terms; roundings as before",
        )


def _evaluations(fmu: Fmu) -> Iterator[Result]:
    """Count the evaluations of ten substeps without gravity, where the equation of an implicit stage needs but one.

    The outputs are read, which costs none.
    """
    h, n = 0.1, 10
    wrong = []
    for method in SolverMethod:
        start = {"g": 0.0, "w_start": 1.0, "solver.method": method, "solver.stepSize": h}
        nfev = fmu.run(Experiment(n * h, n * h, start, record=OUTPUTS)).nfev
        tableau = METHODS[method.name].tableau
        if tableau is None:
            expected = METHODS[method.name].order * n
        elif METHODS[method.name].stable:  # an explicit first stage is the last one of the substep before
            explicit = sum(not row for row in tableau.A)
            expected = (len(tableau.A) - explicit) * n + explicit
        else:
            expected = len(tableau.A) * n
        wrong.append(abs(nfev - expected))
    yield Check(
        f"evaluations of all methods in {n} substeps without gravity",
        largest(wrong),
        0,
        "one a stage, but for the first one of ImplicitTrapezoid and TRBDF2, which the substep before has made; 16 of "
        "TaylorSeries; none for the outputs that are read: a count",
    )


def _longest_substeps(fmu: Fmu) -> Iterator[Result]:
    """Take steps just within and just beyond where a substep is divided, so that its equations have a single root."""
    k2, w02, phi0, rate0 = 3.0, 4.0, 1.2, 0.7
    longest = (k2 + sqrt(k2 * k2 + 4 * w02)) / (2 * w02)
    for method in SolverMethod:
        tableau = METHODS[method.name].tableau
        if tableau is None or not METHODS[method.name].stable:
            continue
        diagonal = tableau.A[-1][-1]
        errors = []
        for share, n in ((1 - 1e-8, 1), (1 + 1e-8, 2)):
            h = share * longest / diagonal
            start = {"L": 0.25, "g": w02 / 4, "gamma": k2, "phi_start": phi0, "w_start": rate0}
            start |= {"solver.method": method, "solver.stepSize": 10 * h}
            run = fmu.run(Experiment(h, h, start, record=("phi", "w")))
            exact = discrete.motion(method.name, [0.0, h], phi0, rate0, k2, w02, h / n)
            errors.append(state_error(run["phi"], run["w"], exact, sqrt(w02)))
        yield Check(
            f"{method.name} divides substeps from {longest / diagonal:.6g} s on",
            largest(errors),
            2 * 7 * UNIT * pi * magnification(method),
            f"{diagonal:.4g}*h = (k2 + sqrt(k2^2 + 4*w02))/(2*w02), k2 = {k2:g}/s, w02 = {w02:g}/s2: one substep of "
            "the discrete motion a relative 1e-8 below, two as much above; roundings as before, of angles below pi",
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
            NEXT * W0 * end / n,
            f"{order}; {NEXT:g} x h*w0 = {W0 * end / n:.2g}, the next term of the error relative to the first",
        )


def swing_error(fmu: Fmu, method: SolverMethod, amplitude: float, end: float, h: float) -> float:
    """Return the distance of (phi, w/w0) [rad] from the undamped swing at `end` [s]."""
    run = fmu.run(Experiment(end, end, swing(amplitude, h, method), record=("phi", "w")))
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
    for angle, marker in zip((30, 90, 150, 179), "osd^", strict=True):
        amplitude = radians(angle)
        radius = radius_of_convergence(amplitude)
        errors = [largest(_step_errors(fmu, amplitude, x * radius)) for x in shares]
        curves.append(Curve(f"{angle} deg, radius {radius:.3g} s", shares, errors, marker=marker))
        bounds = [SAFETY * truncation(x, radius, order) + 16 * UNIT * pi for x in shares]
        yield Check(
            f"Taylor step from all phases of a swing from {angle} deg, h up to 0.6 of the radius of convergence",
            largest(error / bound for error, bound in zip(errors, bounds, strict=True)),
            1.0,
            f"of {SAFETY} x the terms beyond the order 16 by the nearest singularities, and sixteen roundings of the "
            "angle",
        )
    bound = [truncation(x, radius_of_convergence(radians(30)), order) for x in shares]
    yield Plot(
        "Error of one step of TaylorSeries, the largest from 16 phases of a swing",
        "h over the radius of convergence",
        "error of (phi, w/w0) [rad]",
        [*curves, Curve("nearest singularities, 30 deg", shares, bound, line="--")],
        "xy",
        note="Measured in radii of convergence, K(k')/w0 without drag, all swings are alike. A step of a sixth of "
        "it errs by about 1e-13, of a quarter by 1e-10, of a third by 1e-8.",
    )


def _step_errors(fmu: Fmu, amplitude: float, h: float) -> Iterator[float]:
    T = references.period(amplitude, W02)
    for t in np.arange(16) * T / 16:
        phi, w = (float(x) for x in references.libration(np.array(t), amplitude, W02))
        start = swing(phi, h, SolverMethod.TaylorSeries) | {"w_start": w}
        run = fmu.run(Experiment(h, h, start, record=("phi", "w")))
        exact = references.libration(np.array([t + h]), amplitude, W02)
        yield state_error(run["phi"][-1:], run["w"][-1:], exact)


# Energy


@dataclass(frozen=True)
class DriftScene(Scene):
    """Energy drift per period of large undamped swings; `h` [s] is rounded so that it divides the period.

    `next_term` is the next term relative to the first as a function of z = h*w0, and `what` says what it is.
    """

    TITLE = "energy drift of {0.method.name}"

    method: SolverMethod
    h: float
    next_term: Callable[[float], float]
    what: str

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        method = METHODS[self.method.name]
        for angle in (30, 90, 150):
            amplitude = radians(angle)
            T = references.period(amplitude, W02)
            n = round(T / self.h)
            h = T / n
            energy = fmu.run(Experiment(T, T, swing(amplitude, h, self.method), record=("E",)))["E"]
            # The trapezoidal rule over a whole period converges exponentially.
            orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
            predicted = T * method.energy_drift(h, orbit, W02)
            yield Check(
                f"energy drift per period of {self.method.name} at {angle} deg",
                abs((energy[-1] - energy[0]) / predicted - 1),
                self.next_term(h * W0),
                f"{predicted / energy[0]:.4e} of E in theory; relative to it {self.what}, z = h*w0 = {h * W0:.3g}",
            )


ORBITS = (  # method, h [s]: steps at which the errors show
    (SolverMethod.ExplicitEuler, 0.01),
    (SolverMethod.ImplicitEuler, 0.01),
    (SolverMethod.ExplicitMidPoint2, 0.1),
    (SolverMethod.ImplicitTrapezoid, 0.1),
    (SolverMethod.TRBDF2, 0.1),
    (SolverMethod.ExplicitRungeKutta4, 0.2),
    (SolverMethod.SDIRK4, 0.2),
    (SolverMethod.TaylorSeries, 0.2),
)


def _orbits(fmu: Fmu) -> Iterator[Result]:
    """Draw what the methods do to an undamped swing from 90 deg."""
    amplitude, stop = radians(90), 20.0
    T = references.period(amplitude, W02)
    exact = references.libration(np.linspace(0, T, 201), amplitude, W02)
    top = np.linspace(-pi, pi, 201)
    separatrix = 2 * W0 * np.cos(top / 2)
    orbits = [
        Curve("exact", np.degrees(exact[0]), exact[1]),
        Curve(
            "separatrix, the orbit through the upright position",
            np.degrees(np.append(top, top[::-1])),
            np.append(separatrix, -separatrix),
            ":",
        ),
    ]
    energies, errors = [], []
    for method, h in ORBITS:
        run = fmu.run(Experiment(stop, h, swing(amplitude, h, method), record=("phi", "w", "E")))
        shown = run.t <= 4 * T
        label, marker = f"{method.name}, h = {1e3 * h:g} ms", STYLES[method.name].marker
        line = "-" if h < 0.05 else ""
        orbits.append(Curve(label, np.degrees(run["phi"][shown]), run["w"][shown], line, marker))
        energies.append(Curve(label, run.t, run["E"] / run["E"][0], marker=marker))
        error = np.maximum.accumulate(np.abs(run["phi"] - references.libration(run.t, amplitude, W02)[0]))
        errors.append(Curve(label, run.t[1:], error[1:], marker=marker))
    yield Plot(
        "Phase portrait of the methods, undamped, from 90 deg",
        "phi [deg]",
        "w [rad/s]",
        orbits,
        note="Four periods. ExplicitEuler spirals out towards the separatrix, ImplicitEuler in; the methods of higher "
        "order, single points, stay close to the exact orbit, with steps ten and twenty times as long.",
    )
    yield Plot(
        "Energy against time by method, undamped, from 90 deg",
        "t [s]",
        "E/E(0)",
        energies,
        note="The exact E/E(0) stays 1. ExplicitEuler gains energy and ImplicitEuler loses it, although their steps "
        "are ten and twenty times shorter than those of the others. Below: the largest error of the angle so far.",
        below=errors,
        below_label="largest |error| [rad]",
        below_logarithmic="y",
    )


def _energy_of_the_trapezoid(fmu: Fmu) -> Iterator[Result]:
    """Follow the energy of an undamped swing from 90 deg for a thousand periods: it comes back."""
    amplitude, periods, n = radians(90), 1000, 100
    T = references.period(amplitude, W02)
    h = T / n
    start = swing(amplitude, h, SolverMethod.ImplicitTrapezoid)
    samples = n // 2  # of a period: communication steps of two substeps
    ten = np.arange(10 * samples + 1) * T / samples
    run = fmu.run(Experiment(0, 0, start, record=("E",), points=[*ten, *((periods - 10) * T + ten)]))
    deviation = np.abs(run["E"] - run["E"][0])
    # The modified equation conserves E + h^2/12*D, D = w02*w^2*cos(phi) + w02^2*sin(phi)^2 per m*L^2.
    orbit = references.libration(np.arange(4 * n + 1) * T / (4 * n), amplitude, W02)
    D = np.abs(_shadow(*orbit) - _shadow(amplitude, 0.0))
    largest_D = largest(D)  # in the lowest point, which a sample passes at half of their distance at most
    missed = 1 - float(D[n + 4 * n // samples // 2]) / largest_D
    predicted = h * h / 12 * largest_D
    z2 = (h * W0) ** 2
    for name, part in (("first", deviation[: len(ten)]), ("last", deviation[-len(ten) :])):
        yield Check(
            f"energy of ImplicitTrapezoid from 90 deg, largest deviation in the {name} ten of {periods} periods",
            abs(largest(part) / predicted - 1),
            NEXT * z2 + missed,
            f"{predicted / run['E'][0]:.3e} of E: E + h^2/12*D is conserved; {NEXT:g} x (h*w0)^2, the next term, and "
            f"{samples} points a period miss the largest D by up to {missed:.2g} of it",
        )


def _shadow(phi: Array | float, w: Array | float) -> Array:
    """Return D [1/s4] of the energy per m*L^2, E + h^2/12*D, that ImplicitTrapezoid conserves."""
    return np.asarray(W02 * w**2 * np.cos(phi) + W02**2 * np.sin(phi) ** 2)


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
            "2; a relative (h*w0)^2: the h^3 term of the error, a loss of energy, is at right angles to the h^2 one",
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
        counts = (self.steps, 2 * self.steps)
        ends, own = [], []
        for n in counts:
            start = {"gamma": k2, "phi_start": amplitude}
            start |= {"solver.method": self.method, "solver.stepSize": end / n}
            ends.append(float(fmu.run(Experiment(end, end, start))["phi"][-1]))
            own.append(
                float(discrete.motion(self.method.name, [0.0, end], amplitude, 0.0, k2, W02, end / n)[0][-1])
            )
        errors = [abs(phi - float(exact)) for phi in ends]
        order = METHODS[self.method.name].order
        x = W02 / k2 * end / self.steps  # the substep in times of the slow fall
        yield Check(
            f"order of {self.method.name} at gamma/m = 1e6/s, {self.steps} and {2 * self.steps} steps in 1e5 s",
            abs(observed_order(*errors) - order),
            NEXT * x,
            f"{order}: L-stable, so that the fast decay does not show; {NEXT:g} x h*w02/k2 = {x:.2g}, the next term",
        )
        yield Check(
            f"{self.method.name} at gamma/m = 1e6/s, {' and '.join(map(str, counts))} steps in 1e5 s: distance from "
            "its discrete motion",
            largest(abs(phi - there) for phi, there in zip(ends, own, strict=True)),
            amplitude * (walk(counts[-1]) * magnification(self.method) + 7 * UNIT),
            f"errors {errors[0]:.2e} and {errors[1]:.2e} rad; {SIGMAS:g} sigma of rounding, magnified as in a substep",
            "rad",
        )


COMPOUNDED = "half of the 2*pi*z by which a small swing grows in the period, which compounds"

SCENES = (
    *(SubstepScene(method) for method in SolverMethod),
    Case("evaluations", _evaluations),
    Case("longest substeps", _longest_substeps),
    *(OrderScene(method) for method in RUNGE_KUTTA),
    Case("radius of convergence", _radius),
    DriftScene(SolverMethod.ExplicitEuler, 1e-4, lambda z: pi * z, COMPOUNDED),
    DriftScene(SolverMethod.ImplicitEuler, 1e-4, lambda z: pi * z, COMPOUNDED),
    DriftScene(SolverMethod.ExplicitMidPoint2, 5e-3, lambda z: z * z, "z^2, the next term"),
    DriftScene(SolverMethod.ExplicitRungeKutta4, 0.02, lambda z: z * z, "z^2, the next term"),
    Case("orbits and energies", _orbits),
    Case("energy of ImplicitTrapezoid", _energy_of_the_trapezoid),
    Case("Gear's formula", _gear),
    StiffScene(SolverMethod.ImplicitEuler, 1000),
    StiffScene(SolverMethod.TRBDF2, 100),
    StiffScene(SolverMethod.SDIRK4, 20),
)
