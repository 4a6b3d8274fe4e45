"""Period of undamped swings against the elliptic integral, from 1 to 179.999 degrees, and the orders of the methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from math import cos, nan, pi, radians, sin, sqrt, ulp

import numpy as np

from .. import references
from ..checks import Check, Curve, Note, Plot, Result, Table, formula
from ..fmu import SUBSTEP, W02, Experiment, Fmu, G, SolverMethod, swing
from ..metrics import (
    ORDER,
    ROUNDING,
    SIGMAS,
    Array,
    largest,
    observed_order,
    phase_and_drift,
    state_error,
    upward_crossings,
)
from ..references import discrete
from ..references.methods import METHODS, rk4_lag
from ..styles import STYLES
from .scene import Case, Scene

TITLE = "Elliptic period"
FORMULA = "T = 2*pi/(w0*AGM(1, cos(alpha/2))), Crawford (14) and (20)"

AMPLITUDES = (1, 5, 10, 20, 30, 45, 60, 90, 120, 150, 170, 175, 179, 179.9, 179.99, 179.999)
GRAVITIES = (G, 9.81)
PERIODS = 5
STEP = 0.008  # communication step [s]; the interpolation is then exact to 4e-16 s
RK4 = SolverMethod.ExplicitRungeKutta4.name
PHASE_SUBSTEP = 2e-3  # [s] of the finest of the runs that show RK4's h^4 error; it is then far above rounding


@dataclass(frozen=True)
class PeriodScene(Scene):
    """An amplitude [deg] and a gravity acceleration [m/s2].

    What is judged is the part of the error that RK4's leading terms leave unexplained, and that its discrete motion
    does.
    """

    TITLE = "period at {0.amplitude:g} deg, g = {0.g:g}"

    amplitude: float
    g: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the period."""
        amplitude = radians(self.amplitude)
        exact = references.period(amplitude, self.g)
        error = measured_period(fmu, amplitude, self.g, SUBSTEP) - exact
        predicted, rounding = predicted_error(amplitude, self.g), _rounding(amplitude, self.g)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            abs(error - predicted),
            2 * rounding,
            f"error {error:.3e} s, of RK4's discrete motion {predicted:.3e} s; round-off of both",
            "s",
        )
        leading, neglected = leading_error(amplitude, self.g), _neglected(amplitude, self.g)
        yield Check(
            f"{self.name}: against the elliptic integral, beyond RK4's leading terms",
            abs(error - leading),
            rounding + neglected * abs(leading),
            f"{exact:.15g} s by the AGM; h^4 and h^5 terms {leading:.3e} s, next terms {neglected:.1e} of those; "
            "round-off",
            "s",
        )


@dataclass(frozen=True)
class PhaseScene(Scene):
    """The h^4 error of RK4's period at an amplitude [deg], c*(h*w0)^4 of it."""

    TITLE = "h^4 error of RK4's period at {0.amplitude:g} deg"

    amplitude: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the error, told from the h^5 error by three runs."""
        amplitude = radians(self.amplitude)
        phase, _ = phase_and_drift(
            *(measured_period(fmu, amplitude, G, n * PHASE_SUBSTEP) for n in (1, 2, 4))
        )
        z = PHASE_SUBSTEP * sqrt(G)
        c = rk4_lag(amplitude)
        predicted = c * z**4 * references.period(amplitude, G)
        rounding = (32 + 1) / (16 * 15) * 2 * _rounding(amplitude, G)
        yield Check(
            self.name,
            abs(phase / predicted - 1),
            16 * z * z + rounding / predicted,
            f"{c:.12g}*(h*w0)^4 of the period in theory; the next term (4*h*w0)^2, and round-off",
        )


@cache
def measured_period(fmu: Fmu, amplitude: float, g: float, substep: float) -> float:
    """Return the mean period [s] of `PERIODS` swings of the FMU from `amplitude` [rad], NaN if it shows fewer."""
    start = swing(amplitude, substep) | {"g": g}
    run = fmu.run(Experiment(_stop(amplitude, g), STEP, start, record=("phi", "w", "a")))
    return _mean_period(run.t, run["phi"], run["w"], run["a"])


def _stop(amplitude: float, g: float) -> float:
    return STEP * round((PERIODS + 0.8) * references.period(amplitude, g) / STEP)


def _mean_period(t: Array, phi: Array, w: Array, a: Array) -> float:
    crossings = upward_crossings(t, phi, w, a)
    return (crossings[PERIODS] - crossings[0]) / PERIODS if len(crossings) > PERIODS else nan


def predicted_error(amplitude: float, g: float) -> float:
    """Return the error [s] of the mean period of RK4's discrete motion."""
    return _discrete_period(amplitude, g, SUBSTEP) - references.period(amplitude, g)


@cache
def _discrete_period(amplitude: float, g: float, h: float) -> float:
    t = Experiment(_stop(amplitude, g), STEP).times()
    phi, w = discrete.motion(RK4, t, amplitude, 0.0, 0.0, g, h)
    return _mean_period(np.array(t), phi, w, -g * np.sin(phi))


def leading_error(amplitude: float, g: float) -> float:
    """Return the h^4 and h^5 errors [s] of RK4's mean period, from its discrete motions with h, 2h and 4h."""
    return sum(phase_and_drift(*(_discrete_period(amplitude, g, n * SUBSTEP) for n in (1, 2, 4))))


def _neglected(amplitude: float, g: float) -> float:
    """Return the next terms relative to the h^4 and h^5 errors: (4*h*w0)^2, and what the drift itself changes.

    At 4h the drift takes this part of the distance of the energy from that of the separatrix.
    """
    h = 4 * SUBSTEP
    T = references.period(amplitude, g)
    orbit = references.libration(np.arange(400) * T / 400, amplitude, g)
    lost = abs(METHODS[RK4].energy_drift(h, orbit, g)) * (PERIODS + 0.8) * T
    return h * h * g + lost / (2 * g * cos(amplitude / 2) ** 2)


def _rounding(amplitude: float, g: float) -> float:
    """Return the round-off [s] of the mean period.

    Each substep rounds the state: the phase walks randomly, and so does the energy at each of the two fast passages of
    a swing, about 2/w0 long. A period remembers all passages before it: those of the j-th swing enter the mean with the
    weight (PERIODS + 1 - j)/PERIODS. The nearer the separatrix, the more sensitive is the period to the energy. Times
    round, too.
    """
    w0 = sqrt(g)
    passage = 2 / (SUBSTEP * w0)  # substeps
    remembered = sum(((PERIODS + 1 - j) / PERIODS) ** 2 for j in range(1, PERIODS + 1))
    phase = sqrt(PERIODS * references.period(amplitude, g) / SUBSTEP) / (w0 * PERIODS)
    energy = 4 * sin(amplitude / 2) ** 2 * sqrt(2 * remembered * passage)  # of 1 - cos, in roundings
    moved = references.period_slope(amplitude, g) * energy / sin(amplitude)
    clock = ulp(_stop(amplitude, g)) / PERIODS
    return clock + SIGMAS * ROUNDING * (phase + moved)


@dataclass(frozen=True)
class OrderScene(Scene):
    """A method, an amplitude [deg] and the coarser of two numbers of substeps per period.

    The errors at both are those of the discrete motion, of which they show the order.
    """

    TITLE = "{0.method.name} over a period from {0.amplitude:g} deg"

    method: SolverMethod
    amplitude: float
    substeps: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the errors and the order."""
        amplitude, order = radians(self.amplitude), METHODS[self.method.name].order
        T = references.period(amplitude, W02)
        distances, errors, expected = [], [], []
        for n in (self.substeps, 2 * self.substeps):
            start = swing(amplitude, T / n, self.method)
            run = fmu.run(Experiment(T, T / 20, start, record=("phi", "w")))
            exact = references.libration(run.t, amplitude, W02)
            discrete_motion = discrete.motion(
                self.method.name, run.t.tolist(), amplitude, 0.0, 0.0, W02, T / n
            )
            distances.append(state_error(run["phi"], run["w"], discrete_motion))
            errors.append(state_error(run["phi"], run["w"], exact))
            expected.append(state_error(*discrete_motion, exact))
        # Both round. What moves the amplitude moves the phase, too.
        runaway = 2 * pi * amplitude * references.period_slope(amplitude, W02) / T
        rounding = 2 * SIGMAS * ROUNDING * amplitude * sqrt(2 * self.substeps) * (1 + runaway)
        yield Check(
            f"{self.name}: distance from its discrete motion",
            largest(distances),
            rounding,
            f"round-off of two runs; errors {errors[0]:.2e} and {errors[1]:.2e} rad with {self.substeps} and "
            f"{2 * self.substeps} substeps",
            "rad",
        )
        yield formula(
            f"{self.name}: order",
            abs(observed_order(*expected) - order),
            ORDER,
            f"observed {observed_order(*expected):.3f} in the discrete motion, theory {order}; {ORDER} by convention",
        )


@dataclass(frozen=True)
class FormulaScene(Scene):
    """The formulas of the period against each other."""

    TITLE = "formulas of the period"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        amplitudes = [radians(amplitude) for amplitude in AMPLITUDES]
        relative = [
            abs(references.period_by_ellipkm1(amplitude, g) / references.period(amplitude, g) - 1)
            for g in GRAVITIES
            for amplitude in amplitudes
        ]
        yield formula(
            "AGM(1, k') against ellipkm1(k'^2)",
            largest(relative),
            4e-16,
            "both are correct to 1.7e-16, and their quotient rounds",
        )
        near = radians(179.9999)
        yield formula(
            "ellipk(sin^2) is wrong near 180 deg",
            abs(references.period_by_ellipk(near, W02) / references.period(near, W02) - 1),
            1e-6,
            "rounding sin^2 by 1e-16 changes 1 - sin^2 = 7.6e-13 by 1.5e-4, and K by 1e-4/(2*K)",
            at_least=True,
        )
        yield Table(
            "Exact periods",
            ("amplitude [deg]", *(f"T at g = {g:g} m/s2 [s]" for g in GRAVITIES), "T/T0"),
            [
                (
                    f"{degrees:g}",
                    *(f"{references.period(amplitude, g):.15g}" for g in GRAVITIES),
                    f"{references.period(amplitude, G) / (2 * np.pi / sqrt(G)):.12g}",
                )
                for degrees, amplitude in zip(AMPLITUDES, amplitudes, strict=True)
            ],
        )


def _curve(fmu: Fmu) -> Iterator[Result]:
    """Draw the period against the amplitude, and what is wrong with it at the default step."""
    amplitudes = [radians(amplitude) for amplitude in AMPLITUDES]
    exact = [references.period(amplitude, G) for amplitude in amplitudes]
    measured = np.array([measured_period(fmu, amplitude, G, SUBSTEP) for amplitude in amplitudes])
    errors = np.abs(measured - exact)
    own = [abs(predicted_error(amplitude, G)) for amplitude in amplitudes]
    moderate = AMPLITUDES.index(170) + 1
    yield Note(
        f"Accuracy: with ExplicitRungeKutta4 and the default step of 1 ms the periods of free swings from 1 to 170 "
        f"deg are right to {largest(errors[:moderate]):.1e} s, and its discrete motion explains what is wrong to "
        f"{largest(np.abs(errors - own)[:moderate]):.0e} s.",
        headline=True,
    )
    small = 2 * pi / sqrt(G)
    fine = np.append(np.linspace(1, 179, 179), AMPLITUDES[-3:])
    yield Plot(
        "Period against amplitude",
        "amplitude [deg]",
        "T/T0",
        [
            Curve("FMU, RK4", AMPLITUDES, measured / small, "", "o"),
            Curve("exact", fine, [references.period(radians(x), G) / small for x in fine]),
        ],
        note="The period grows without limit towards 180 deg. Below: the error of the FMU is that of RK4; it grows "
        "where RK4's small loss of energy moves the swing away from the upright position.",
        below=[
            Curve("FMU less exact", AMPLITUDES, errors, "", "o"),
            Curve("RK4, from its discrete motion", AMPLITUDES, own),
        ],
        below_label="|error| [s]",
        below_logarithmic="y",
    )


def _against_step(fmu: Fmu) -> Iterator[Result]:
    """Draw the error of a period from 30 deg against the step, for every method."""
    amplitude = radians(30)
    T = references.period(amplitude, W02)
    exact = references.libration(np.array([T]), amplitude, W02)
    curves = []
    for method in SolverMethod:
        steps, errors = [], []
        for n in (25, 50, 100, 200, 400, 800, 1600, 3200):
            start = swing(amplitude, T / n, method)
            run = fmu.run(Experiment(T, T, start, record=("phi", "w")))
            steps.append(T / n)
            errors.append(state_error(run["phi"][-1:], run["w"][-1:], exact))
        curves.append(Curve(method.name, steps, errors, marker=STYLES[method.name].marker))
    triangles = [  # h [s] and error of the lower left corner, width
        (order, h * np.array([1, width, width, 1, nan]), low * np.array([1, 1, width**order, 1, nan]))
        for order, h, low, width in ((1, 3e-3, 0.15, 4), (2, 3e-3, 2e-7, 2), (4, 3e-3, 2e-13, 2))
    ]
    x, y = (np.concatenate(columns) for columns in list(zip(*triangles, strict=True))[1:])
    curves.append(Curve("triangles: slopes 1, 2 and 4", x, y))
    yield Plot(
        "Error after a period from 30 deg against the step",
        "h [s]",
        "error of the state [rad]",
        curves,
        "xy",
        y_range=(1e-17, 10.0),
        note="The steeper a line, the higher the order of the method: half the step, half the error of order 1, a "
        "quarter of order 2, a sixteenth of order 4; beyond 1e-15, where TaylorSeries of order 16 is at every step "
        "shown, there is only rounding.",
    )


def _against_time(fmu: Fmu) -> Iterator[Result]:
    """Draw RK4's error against time for small and large swings."""
    curves = []
    for amplitude, line in ((30, "-"), (90, "--"), (170, ":")):
        run = fmu.run(Experiment(100.0, 0.05, swing(radians(amplitude), 0.01), record=("phi", "w")))
        exact = references.libration(run.t, radians(amplitude), W02)
        error = np.hypot(run["phi"] - exact[0], (run["w"] - exact[1]) / sqrt(W02))
        curves.append(Curve(f"from {amplitude} deg", run.t[1:], error[1:], line))
    yield Plot(
        "Error of RK4 with h = 10 ms against time",
        "t [s]",
        "error of the state [rad]",
        curves,
        "xy",
        note="From 30 deg RK4 lags behind, by an error like h^4*t: tenfold time, tenfold error. RK4 also loses "
        "energy, which shortens the period of large swings: that error grows like h^5*t^2, steeper in the picture "
        "from 170 deg; from 90 deg the two cancel for a while.",
    )


# Substeps per period where the next term of the error expansion, a relative h*w0*pi for the Euler methods and less
# for the others, changes the observed order by less than 0.1; rounding is still far below.
SUBSTEPS = {
    SolverMethod.ExplicitEuler: 2000,
    SolverMethod.ImplicitEuler: 2000,
    SolverMethod.ExplicitMidPoint2: 400,
    SolverMethod.ExplicitRungeKutta4: 200,
}

SCENES = (
    FormulaScene(),
    Case("period curve", _curve),
    Case("error against step", _against_step),
    Case("error against time", _against_time),
    *(PeriodScene(amplitude, g) for g in GRAVITIES for amplitude in AMPLITUDES),
    *(PhaseScene(amplitude) for amplitude in (0.1, 30, 90)),
    *(OrderScene(method, amplitude, n) for method, n in SUBSTEPS.items() for amplitude in (30, 90)),
)
