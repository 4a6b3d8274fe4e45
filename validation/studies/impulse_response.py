"""Impulse response of small swings against the linear closed form: as an initial rate and as a torque pulse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt

import numpy as np

from .. import references
from ..checks import Check, Curve, Plot, Result, formula
from ..fmu import SUBSTEP, T0, W0, W02, Experiment, Fmu, Run
from ..metrics import SAFETY, SMALL, Array, free_rounding, largest, walk
from .scene import Scene

TITLE = "Linear impulse response"
FORMULA = "h(t) = exp(-k2*t/2)*sin(a*t)/a, a^2 = w02 - k2^2/4, Grillo with nabla = 4*w02 - k2^2"

STEP = 0.05  # communication step [s]


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
        exact = references.impulse_response(run.t, self.k2, w02)
        peak = float(np.max(np.abs(exact[0])))
        rk4, neglected = references.rk4_error(run.t, exact, self.k2, w02, SUBSTEP)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            largest(np.abs(response - exact[0] - rk4[0])) / peak,
            SAFETY * largest(np.abs(neglected[0])) / peak + free_rounding(self.stop, SUBSTEP),
            f"relative to the peak; RK4's error {largest(np.abs(rk4[0])) / peak:.2e}, {SAFETY} x its next term "
            "t*h^6*A^7/336, and round-off",
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
        exact = references.pulse_response(run.t, self.width, self.k2, W02)
        peak = float(np.max(np.abs(exact[0])))
        # A step of the drive is a free evolution about the deflection 1/(width*w02); the pulse is one less a later one.
        rk4, neglected = np.zeros_like(run.t), np.zeros_like(run.t)
        for begin, sign in ((0.0, 1), (self.width, -1)):
            t = np.maximum(run.t - begin, 0.0)
            swing = references.free_evolution(t, -sign / (self.width * W02), 0.0, self.k2, W02)
            errors, next_terms = references.rk4_error(t, swing, self.k2, W02, SUBSTEP)
            rk4, neglected = rk4 + errors[0], neglected + np.abs(next_terms[0])
        yield Check(
            f"{self.name}: error beyond that of RK4",
            largest(np.abs(run["phi"] / (SMALL * W0) - exact[0] - rk4)) / peak,
            SAFETY * largest(neglected) / peak + free_rounding(self.stop, SUBSTEP),
            f"relative to the peak; RK4's error {largest(np.abs(rk4)) / peak:.2e}, {SAFETY} x its next term "
            "t*h^6*A^7/336, and round-off",
        )


@dataclass(frozen=True)
class NonlinearScene(Scene):
    """An impulse that is not small: the linear amplitude A [rad] and the number of periods."""

    TITLE = "departure from linear motion at A = {0.amplitude:g}, {0.periods} periods"

    amplitude: float
    periods: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        A, stop = self.amplitude, self.periods * T0
        run = fmu.run(Experiment(stop, T0 / 40, {"gamma": 0.0, "phi_start": 0.0, "w_start": A * W0}))
        linear = A * W0 * references.impulse_response(run.t, 0.0, W02)[0]
        exact = references.motion(run.t, 0.0, A * W0, W02)
        departure = largest(np.abs(exact[0] - linear))
        rk4 = stop * largest(references.rk4_error_rate(exact, 0.0, W02, SUBSTEP)[0])
        yield Check(
            f"{self.name}: of the FMU",
            abs(largest(np.abs(run["phi"] - linear)) - departure),
            SAFETY * rk4 + A * walk(stop / SUBSTEP),
            f"{departure:.6e} rad, from the elliptic functions; {SAFETY} x t*h^4*A^5/120 = {rk4:.1e} rad, and "
            "round-off",
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
