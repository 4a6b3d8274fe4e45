"""Impulse response of small swings against the linear closed form: as an initial rate and as a torque pulse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from .. import references
from ..checks import Check, Curve, Plot, Result, formula
from ..fmu import SUBSTEP, T0, W0, W02, Experiment, Fmu, Run, SolverMethod
from ..metrics import SAFETY, SMALL, UNIT, Array, free_rounding, largest, walk
from ..references import discrete
from .scene import Scene

TITLE = "Linear impulse response"
FORMULA = "h(t) = exp(-k2*t/2)*sin(a*t)/a, a^2 = w02 - k2^2/4, Grillo with nabla = 4*w02 - k2^2"

STEP = 0.05  # communication step [s]
RK4 = SolverMethod.ExplicitRungeKutta4.name


@dataclass(frozen=True)
class ImpulseScene(Scene):
    """An impulse J as initial rate J/(m*L^2), on a pendulum with the damping rate k2 [1/s]."""

    TITLE = "{0.title}"

    title: str
    k2: float
    stop: float
    m: float = 1.0
    L: float = 1.0

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        w02 = W02 / self.L
        w0 = sqrt(w02)
        start = {"phi_start": 0.0, "w_start": SMALL * w0, "gamma": self.k2 * self.m}
        start |= {"m": self.m} if self.m != 1 else {}
        start |= {"L": self.L} if self.L != 1 else {}
        run = fmu.run(Experiment(self.stop, STEP, start))
        response = run["phi"] / (SMALL * w0)
        motion = references.impulse_response(run.t, self.k2, w02)
        exact = motion[0]
        own, _ = references.rk4_evolution(_substeps(run), 0.0, 1.0, self.k2, w02, SUBSTEP)
        peak, rounding = largest(np.abs(exact)), free_rounding(self.stop, SUBSTEP, w0)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            largest(np.abs(response - own)) / peak,
            rounding,
            f"relative to the peak; that of RK4 {largest(np.abs(own - exact)) / peak:.2e} by R(h*A)^n; round-off",
        )
        (leading, _), (neglected, _) = references.rk4_error(run.t, motion, self.k2, w02, SUBSTEP)
        yield Check(
            f"{self.name}: against the closed form, beyond RK4's leading terms",
            largest(np.abs(response - exact - leading)) / peak,
            SAFETY * largest(np.abs(neglected)) / peak + rounding,
            f"relative to the peak; -t*h^4*A^5/120 + t*h^5*A^6/144 is {largest(np.abs(leading)) / peak:.2e}, "
            f"{SAFETY} x the next term, t*h^6*A^7/336, and round-off",
        )
        if self.k2 == 0.002:
            yield from _misprint(run, response, peak)


@dataclass(frozen=True)
class PulseScene(Scene):
    """A rectangular torque pulse from 0 to `width` [s] through the input."""

    TITLE = "{0.title}"

    title: str
    k2: float
    stop: float
    width: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        torque = SMALL * W0 / self.width
        run = fmu.run(
            Experiment(
                self.stop,
                STEP,
                {"phi_start": 0.0, "gamma": self.k2},
                torque=lambda t: torque if t < self.width - STEP / 2 else 0.0,
            )
        )
        exact, _ = references.pulse_response(run.t, self.width, self.k2, W02)
        peak = largest(np.abs(exact))
        # A step of the drive is a free evolution about its deflection; the pulse is one less a later one.
        deflection = 1 / (self.width * W02)
        own, leading, neglected = np.zeros((3, len(run.t)))
        for begin, sign in ((0, 1), (round(self.width / SUBSTEP), -1)):
            steps = np.maximum(_substeps(run) - begin, 0)
            swing, _ = references.rk4_evolution(steps, -deflection, 0.0, self.k2, W02, SUBSTEP)
            own += sign * (deflection + swing)
            t = SUBSTEP * steps
            motion = references.free_evolution(t, -sign * deflection, 0.0, self.k2, W02)
            (error, _), (next_term, _) = references.rk4_error(t, motion, self.k2, W02, SUBSTEP)
            leading += error
            neglected += np.abs(next_term)
        response = run["phi"] / (SMALL * W0)
        rounding = free_rounding(self.stop, SUBSTEP) + 4 * UNIT * deflection / peak
        yield Check(
            f"{self.name}: error beyond that of RK4",
            largest(np.abs(response - own)) / peak,
            rounding,
            f"relative to the peak; that of RK4 {largest(np.abs(own - exact)) / peak:.2e} by R(h*A)^n about the "
            f"deflection under the torque; round-off, also of that deflection, {deflection / peak:.2g} of the peak",
        )
        yield Check(
            f"{self.name}: against the closed form, beyond RK4's leading terms",
            largest(np.abs(response - exact - leading)) / peak,
            SAFETY * largest(neglected) / peak + rounding,
            f"relative to the peak; -t*h^4*A^5/120 + t*h^5*A^6/144 is {largest(np.abs(leading)) / peak:.2e}, "
            f"{SAFETY} x the next term, t*h^6*A^7/336, and round-off as before",
        )


def _substeps(run: Run) -> NDArray[np.int64]:
    """Return how many substeps each communication point comes after."""
    return round(STEP / SUBSTEP) * np.arange(len(run.t), dtype=np.int64)


@dataclass(frozen=True)
class NonlinearScene(Scene):
    """An impulse that is not small: the linear amplitude A [rad] and the number of periods."""

    TITLE = "departure from linear motion at A = {0.amplitude:g}, {0.periods} periods"

    amplitude: float
    periods: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        A, stop, h = self.amplitude, self.periods * T0, 0.01
        start = {"gamma": 0.0, "phi_start": 0.0, "w_start": A * W0, "solver.stepSize": h}
        run = fmu.run(Experiment(stop, T0 / 40, start))
        linear = A * W0 * references.impulse_response(run.t, 0.0, W02)[0]
        departure = largest(np.abs(references.motion(run.t, 0.0, A * W0, W02)[0] - linear))
        own, _ = discrete.motion(RK4, run.t.tolist(), 0.0, A * W0, 0.0, W02, h)
        of_rk4 = largest(np.abs(own - linear))
        yield Check(
            f"{self.name}: of the FMU",
            abs(largest(np.abs(run["phi"] - linear)) - of_rk4),
            2 * A * walk(stop / h),
            f"{of_rk4:.6e} rad of RK4's discrete motion with h = {h:g} s, {departure:.6e} rad from the elliptic "
            "functions; round-off of both runs",
            "rad",
        )
        predicted = A**3 * W0 * stop / 16
        slip = predicted / A
        yield formula(
            f"{self.name}: A^3*w0*T/16",
            abs(departure / predicted - 1),
            SAFETY * (A**2 / 7 + slip**2 / 6 + 1 / (W0 * stop) ** 2),
            f"{predicted:.3e} rad; next terms A^2*(1/12 + 1/24 + 1/192), slip^2/6, (w0*T)^-2, x {SAFETY}",
        )


SCENES = (
    ImpulseScene("impulse, k2 = 0.002/s, 200 s", 0.002, 200.0),
    ImpulseScene("impulse, m = 2 kg, L = 0.5 m", 0.001, 20.0, m=2.0, L=0.5),
    ImpulseScene("impulse, underdamped k2 = 1/s", 1.0, 20.0),
    ImpulseScene("impulse, critically damped", 2 * W0, 10.0),
    ImpulseScene("impulse, overdamped k2 = 50/s", 50.0, 20.0),
    PulseScene("pulse of 0.1 s, k2 = 0.002/s, 200 s", 0.002, 200.0, 0.1),
    PulseScene("pulse of 1 s, k2 = 1/s", 1.0, 20.0, 1.0),
    PulseScene("pulse of 0.1 s, critically damped", 2 * W0, 10.0, 0.1),
    PulseScene("pulse of 0.1 s, overdamped k2 = 50/s", 50.0, 20.0, 0.1),
    *(NonlinearScene(amplitude, periods) for amplitude in (0.05, 0.1, 0.2) for periods in (5, 25)),
)


def _misprint(run: Run, response: Array, peak: float) -> Iterator[Result]:
    """Show what nabla = 4*w02 - k2, as printed, does."""
    k2, t = 0.002, run.t
    exact = references.impulse_response(t, k2, W02)[0]
    nabla = 4 * W02 - k2
    printed = 2 / sqrt(nabla) * np.exp(-k2 / 2 * t) * np.sin(sqrt(nabla) / 2 * t)
    slip = (sqrt(4 * W02 - k2 * k2) - sqrt(nabla)) / 2 * t[-1] * np.exp(-k2 / 2 * t[-1])
    yield formula(
        "the misprint nabla = 4*w02 - k2 shows",
        largest(np.abs(exact - printed)) / peak,
        0.9 * slip,
        f"its phase slips by {slip:.4f} of the envelope in 200 s; 0.9 because no peak need fall on the end",
        at_least=True,
    )
    yield Plot(
        "Impulse response over 200 s, k2 = 0.002/s",
        "t [s]",
        "phi/w(0) [s]",
        [Curve("FMU, RK4", t, response)],
        note="The envelope falls to exp(-0.2) = 0.82 of its height in 200 s. Below: the FMU is off by RK4's error of "
        "less than 1e-9, the document's misprint, whose phase slips, by a hundredth.",
        below=[
            Curve("FMU against the closed form", t[1:], np.abs(response - exact)[1:] / peak),
            Curve("FMU against the misprint", t[1:], np.abs(response - printed)[1:] / peak, "--"),
        ],
        below_label="|error|/peak",
        below_logarithmic="y",
    )
