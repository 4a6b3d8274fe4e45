"""Period of undamped swings against the elliptic integral, from 1 to 179.999 degrees, and the orders of the methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan, radians, sqrt, ulp

import numpy as np

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W02, Experiment, Fmu, G, SolverMethod
from ..metrics import largest, observed_order, phase_and_drift, state_error, upward_crossings
from .scene import Scene

TITLE = "Elliptic period"
FORMULA = "T = 2*pi/(w0*AGM(1, cos(alpha/2))), Crawford (14) and (20)"

AMPLITUDES = (1, 5, 10, 20, 30, 45, 60, 90, 120, 150, 170, 175, 179, 179.9, 179.99, 179.999)
GRAVITIES = (G, 9.81)
PERIODS = 5
STEP = 0.008  # communication step [s], 8, 4 and 2 substeps; the interpolation is then exact to 4e-16 s
SUBSTEP = 1e-3  # [s], the default
# (T_RK4/T - 1)/(h*w0)^4 by amplitude [deg], from RK4's modified equation averaged over the orbit, four digits; larger
# swings drift so much that three runs do not tell the phase error alone.
PHASE_ERROR: dict[float, float] = {1: 0.008332, 30: 0.007455, 60: 0.005478}


@dataclass(frozen=True)
class PeriodScene(Scene):
    """An amplitude [deg] and a gravity acceleration [m/s2]."""

    TITLE = "period at {0.amplitude:g} deg, g = {0.g:g}"

    amplitude: float
    g: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        amplitude = radians(self.amplitude)
        exact = references.period(amplitude, self.g)
        fine, coarse, coarser = (measured_period(fmu, amplitude, self.g, n * SUBSTEP) for n in (1, 2, 4))
        phase, drift = phase_and_drift(fine, coarse, coarser)  # the drift of the amplitude changes the period
        truncation = abs(phase) + abs(drift)
        # The roundings of phi walk randomly during the time 1/w0 for which the pendulum remembers its amplitude.
        wander = ulp(amplitude) * sqrt(1 / (SUBSTEP * sqrt(self.g)))
        floor = 5e-14 * exact + references.period_slope(amplitude, self.g) * wander
        yield Check(
            self.name,
            abs(fine - exact),
            1.5 * truncation + floor,
            f"1.5 x (h^4 + h^5 error {truncation:.1e} s) + round-off {floor:.1e} s",
            "s",
        )
        if self.amplitude in PHASE_ERROR:
            z4 = (SUBSTEP * sqrt(self.g)) ** 4
            predicted = PHASE_ERROR[self.amplitude] * z4 * exact
            yield Check(
                f"h^4 error of RK4's {self.name}",
                abs(phase / predicted - 1),
                (32 + 1) / 240 * 2 * floor / predicted + 1e-3 + 16 * sqrt(z4),
                f"{predicted:.3e} s in theory; round-off of three runs, its last digit, and the next term (4*h*w0)^2",
            )


@dataclass(frozen=True)
class OrderScene(Scene):
    """A method, an amplitude [deg] and the coarser of two numbers of substeps per period."""

    TITLE = "order of {0.method.name} at {0.amplitude:g} deg"

    method: SolverMethod
    order: int
    amplitude: float
    substeps: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        amplitude = radians(self.amplitude)
        T = references.period(amplitude, W02)
        errors = []
        for n in (self.substeps, 2 * self.substeps):
            run = fmu.run(
                Experiment(
                    stop=T,
                    step=T / 20,
                    start={
                        "gamma": 0.0,
                        "phi_start": amplitude,
                        "solver.method": self.method,
                        "solver.stepSize": T / n,
                    },
                    record=("phi", "w"),
                )
            )
            errors.append(state_error(run["phi"], run["w"], references.libration(run.t, amplitude, W02)))
        order = observed_order(*errors)
        yield Check(self.name, abs(order - self.order), 0.1, f"observed {order:.3f}, theory {self.order}")


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
        yield Check(
            "AGM(1, k') against ellipkm1(k'^2)",
            largest(relative),
            4e-16,
            "both are correct to 1.7e-16, and their quotient rounds",
        )
        near = radians(179.9999)
        yield Check(
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
        shown = np.append(np.linspace(1, 179, 179), AMPLITUDES[-3:])
        ratio = [references.period(radians(x), G) / (2 * np.pi / sqrt(G)) for x in shown]
        yield Plot(
            "Period against amplitude",
            "amplitude [deg]",
            "T/T0",
            [Curve("exact", shown, ratio)],
        )


# Substeps per period where the next term of the error expansion, a relative h*w0*pi for the Euler methods and less
# for the others, changes the observed order by less than 0.1; rounding is still far below.
ORDERS = (
    (SolverMethod.ExplicitEuler, 1, 2000),
    (SolverMethod.ImplicitEuler, 1, 2000),
    (SolverMethod.ExplicitMidPoint2, 2, 400),
    (SolverMethod.ExplicitRungeKutta4, 4, 200),
)

SCENES = (
    FormulaScene(),
    *(PeriodScene(amplitude, g) for g in GRAVITIES for amplitude in AMPLITUDES),
    *(OrderScene(method, order, amplitude, n) for method, order, n in ORDERS for amplitude in (30, 90)),
)


def measured_period(fmu: Fmu, amplitude: float, g: float, substep: float) -> float:
    """Return the mean period [s] of `PERIODS` swings of the FMU from `amplitude` [rad], NaN if it shows fewer."""
    exact = references.period(amplitude, g)
    run = fmu.run(
        Experiment(
            stop=STEP * round((PERIODS + 0.8) * exact / STEP),
            step=STEP,
            start={"gamma": 0.0, "g": g, "phi_start": amplitude, "solver.stepSize": substep},
            record=("phi", "w", "a"),
        )
    )
    crossings = upward_crossings(run.t, run["phi"], run["w"], run["a"])
    return (crossings[PERIODS] - crossings[0]) / PERIODS if len(crossings) > PERIODS else nan
