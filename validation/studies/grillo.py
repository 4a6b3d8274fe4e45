"""Grillo's exercise through the FMU: frequency response, free evolution, Gaussian pulse, general solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, cos, exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from .. import references
from ..checks import Check, Curve, Plot, Result, Table, formula
from ..fmu import SUBSTEP, W0, W02, Experiment, Fmu
from ..metrics import SMALL, UNIT, free_rounding, largest, linear_rounding, state_error
from .scene import Scene

TITLE = "Grillo's exercise: frequency response, free evolution, Gaussian pulse, general solution"
FORMULA = "h(w) = 1/(w02 - w^2 + i*k2*w); held input: h(w)*sinc(w*H/2)*exp(-i*w*H/2)"

DOCUMENT_K2 = 0.002  # [1/s]

# The causal response to A*exp(-t^2/2), A = 1/sqrt(2*pi), from minus infinity, k2 = 0.002/s: 30-digit quadrature.
DOCUMENT_PULSE = {
    -3: 2.22534788183623e-4,
    -1: 0.0233415451157726,
    0: 0.0472313218313262,
    1: 0.0233861270933305,
    2: 0.00373592928069484,
    3: 3.01207408000561e-4,
    5: 1.25696954968869e-4,
    10: -2.42396709814816e-4,
    50: -1.09054877879663e-3,
}
CUT_PULSE_AT_1 = 0.070555779097875582  # the same pulse from rest at t = 0, at t = 1 s


@dataclass(frozen=True)
class FrequencyScene(Scene):
    """Sinusoidal torque at several angular frequencies [rad/s].

    The transient lasts as long as 2/k2. With `wait` [s] it is waited for from rest; without, the start is on the exact
    periodic solution, and the motion must stay there.
    """

    TITLE = "{0.title}"

    title: str
    k2: float
    frequencies: Sequence[float]
    wait: float = 0.0

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        measured, rows = [], []
        for w in self.frequencies:
            period = 2 * pi / w
            samples = max(64, ceil(period / 0.02))  # of a period
            H = period / samples
            sampled, own, rounding = measured_response(fmu, self, w, samples)
            held, _ = references.held_frequency_response(w, H, self.k2, W02)
            yield Check(
                f"response at w = {w:.9g} rad/s, {self.name}",
                abs(sampled - own) / abs(held),
                rounding / abs(held),
                "complex amplitude, relative to (exp(i*w*H) - A)^-1*b, the exact one of the held cosine; RK4 by "
                f"R(h*A)^n is {abs(own / held - 1):.1e} off; round-off, of which the Fourier sum leaves little off the "
                "resonance",
            )
            exact = complex(references.frequency_response(w, self.k2, W02))
            measured.append(sampled / references.hold(w, H))
            ratio = measured[-1] / exact
            images = abs(held / references.hold(w, H) / exact - 1)
            rows.append((w, abs(exact), np.degrees(np.angle(exact)), abs(ratio) - 1, np.angle(ratio), images))
        yield Table(
            f"Frequency response through the FMU, {self.name}",
            (
                "w [rad/s]",
                "|h(w)| [s2]",
                "arg h(w) [deg]",
                "amplitude less exact, relative",
                "phase less exact [rad]",
                "images of the held cosine, relative",
            ),
            rows,
            "Divided by the response of the hold, sinc(w*H/2)*exp(-i*w*H/2). What is left beside h(w) are the images "
            "of the held cosine at w + 2*pi*j/H.",
        )
        yield from _bode(self, np.array(measured))


@dataclass(frozen=True)
class FreeScene(Scene):
    """Free evolution from an angle and a rate, in units of SMALL [rad] and SMALL*w0."""

    TITLE = "{0.title}"

    title: str
    k2: float
    stop: float
    phi0: float
    rate0: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        phi0, rate0, H = self.phi0, self.rate0 * W0, 0.05
        start = {"phi_start": SMALL * phi0, "w_start": SMALL * rate0, "gamma": self.k2}
        run = fmu.run(Experiment(self.stop, H, start, record=("phi", "w")))
        exact = references.free_evolution(run.t, phi0, rate0, self.k2, W02)
        peak = float(np.max(np.hypot(exact[0], exact[1] / W0)))
        error = np.hypot(run["phi"] / SMALL - exact[0], (run["w"] / SMALL - exact[1]) / W0)
        steps = round(H / SUBSTEP) * np.arange(len(run.t))
        own = references.rk4_evolution(steps, phi0, rate0, self.k2, W02, SUBSTEP)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            state_error(run["phi"] / SMALL, run["w"] / SMALL, own) / peak,
            free_rounding(self.stop, SUBSTEP),
            f"angle and rate/w0, relative to the peak; error {largest(error) / peak:.2e}, that of RK4 "
            f"{state_error(*own, exact) / peak:.2e} by R(h*A)^n; round-off",
        )
        shown = run.t <= 20
        yield Plot(
            f"{self.name[0].upper()}{self.name[1:]}{', the first 20 s' if self.stop > 20 else ''}",
            "t [s]",
            "phi [1e-9 rad]",
            [
                Curve("FMU, RK4", run.t[shown][::4], run["phi"][shown][::4] / SMALL, "", "."),
                Curve("exact", run.t[shown], exact[0][shown]),
            ],
            note="A small swing from an initial angle and rate. Exact: "
            + (
                "(c1 + c2*t)*exp(-k2*t/2), as the two roots are one"
                if self.k2 == 2 * W0
                else "c1*exp(s1*t) + c2*exp(s2*t), s1, s2 the roots of s^2 + k2*s + w02, which the document misprints"
            )
            + ". Below: the distance of the states, RK4's error and rounding.",
            below=[Curve("FMU less exact", run.t[shown][1:], error[shown][1:] / peak)],
            below_label="|error|/peak",
            below_logarithmic="y",
        )


@dataclass(frozen=True)
class DocumentScene(Scene):
    """The pulse of the document, with its numbers."""

    TITLE = "Gaussian pulse of the document"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the pulse of the document, A*exp(-t^2/2), from 9 s before its peak, and cut at it."""
        H, area = 0.01, 1 / sqrt(2 * pi)

        def pulse(t: float) -> float:
            return SMALL * area * exp(-((t + H / 2) ** 2) / 2)

        for begin, name, stop, expected, what in (
            (
                -9.0,
                "from minus infinity",
                50.0,
                DOCUMENT_PULSE,
                "The plot of the document as it was meant: the angle follows the drive, then rings.",
            ),
            (
                0.0,
                "cut at its peak",
                10.0,
                {1: CUT_PULSE_AT_1},
                "The same pulse upon a pendulum at rest at its peak: it rings twenty times as much.",
            ),
        ):
            run = fmu.run(Experiment(stop, H, {"phi_start": 0.0}, torque=pulse, begin=begin))
            phi = run["phi"] / SMALL
            start = None if begin < 0 else begin
            exact, _ = references.gaussian_response(run.t, area, 0.0, 1.0, DOCUMENT_K2, W02, start)
            drive = area * np.exp(-(run.t**2) / 2)
            held = [pulse(t) / SMALL for t in run.t[:-1]]
            own = references.rk4_response(held, H, DOCUMENT_K2, W02, SUBSTEP)
            rounding = linear_rounding(own, held, H, DOCUMENT_K2)
            rounding += free_rounding(stop - begin, SUBSTEP) * largest(np.hypot(own[0], own[1] / W0))
            ends = [(round((t - begin) / H), value) for t, value in expected.items()]
            yield Check(
                f"document's pulse {name}, at t = {', '.join(map(str, expected))} s: beyond what hold and RK4 cost",
                largest(abs(phi[i] - value - (own[0][i] - exact[i])) for i, value in ends),
                rounding + 20 * UNIT * largest(np.abs(exact)),
                "numbers of 15 digits; held from its middle and by RK4 the answer is "
                f"{largest(np.abs(own[0] - exact)):.2e} rad off at most, by R(h*A)^n less the closed form; round-off",
                "rad",
            )
            shown = run.t <= 10
            yield Plot(
                f"Gaussian pulse of the document, {name}",
                "t [s]",
                "phi [rad]",
                [
                    Curve("FMU, RK4", run.t[shown][::20], phi[shown][::20], "", "."),
                    Curve("exact, causal", run.t[shown], exact[shown]),
                    Curve("drive/w02", run.t[shown], drive[shown] / W02, ":"),
                ],
                note=f"{what} Below: what it costs to hold the input from the middle of steps of 10 ms.",
                below=[Curve("FMU less exact", run.t[shown], phi[shown] - exact[shown])],
                below_label="error [rad]",
            )
        integral, _ = quad(
            lambda x: exp(-x * x) * cos(sqrt(4 * W02 - DOCUMENT_K2**2) / 2 * sqrt(2) * x),
            -8,
            8,
            epsabs=1e-14,
        )
        closed = sqrt(pi) * exp(-(4 * W02 - DOCUMENT_K2**2) / 8)
        yield formula(
            "the document's constant I by quadrature",
            abs(integral - closed),
            1e-14,
            f"sqrt(pi)*exp(-beta^2*c/2) = {closed:.12g}; the tolerance that QUADPACK is given; it bisects until its 21 "
            "points are exact to rounding",
        )


@dataclass(frozen=True)
class GeneralScene(Scene):
    """The general solution: an initial state and a Gaussian drive together, held from the middle of each step."""

    TITLE = "general solution, k2 = {0.k2:g}/s"

    k2: float
    phi0: float = 1.0
    rate0: float = -0.5
    stop: float = 15.0
    H: float = 0.02

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the sum of free evolution and convolution."""
        start = {"phi_start": SMALL * self.phi0, "w_start": SMALL * self.rate0 * W0, "gamma": self.k2}

        def drive(t: float) -> float:
            return W02 * exp(-((t + self.H / 2 - 5.0) ** 2) / 0.5)

        run = fmu.run(Experiment(self.stop, self.H, start, torque=lambda t: SMALL * drive(t)))
        u = np.array([drive(t) for t in run.t[:-1]])
        free, _ = references.free_evolution(run.t, self.phi0, self.rate0 * W0, self.k2, W02)
        exact = free + references.polynomial_response(u[:, np.newaxis], self.H, self.k2, W02)[0]
        own = references.rk4_response(u, self.H, self.k2, W02, SUBSTEP, (self.phi0, self.rate0 * W0))
        peak = largest(np.hypot(own[0], own[1] / W0))
        yield Check(
            f"{self.name}: free evolution and convolution together, error beyond that of RK4",
            largest(np.abs(run["phi"] / SMALL - own[0])) / peak,
            free_rounding(self.stop, SUBSTEP) + linear_rounding(own, u, self.H, self.k2) / peak,
            f"relative to the peak of (phi, w/w0); that of RK4 {largest(np.abs(own[0] - exact)) / peak:.1e}, R(h*A)^n "
            "against their sum; round-off",
        )
        yield Plot(
            self.name[0].upper() + self.name[1:],
            "t [s]",
            "phi [1e-9 rad]",
            [
                Curve("FMU, RK4", run.t[::5], run["phi"][::5] / SMALL, "", "."),
                Curve("exact: free evolution + response", run.t, exact),
                Curve("free evolution alone", run.t, free, "--"),
                Curve("drive/w02", run.t[:-1], u / W02, ":"),
            ],
            note="An initial state and a pulse of the drive about 5 s: linear, so that the solutions add. Below: the "
            "error of the FMU.",
            below=[Curve("FMU less exact", run.t[1:], np.abs(run["phi"] / SMALL - exact)[1:] / peak)],
            below_label="|error|/peak",
            below_logarithmic="y",
        )


RESONANCE = sqrt(W02 - DOCUMENT_K2**2 / 2)
SCENES = (
    FrequencyScene(
        "k2 = 0.002/s, from the periodic solution",
        DOCUMENT_K2,
        (
            0.1,
            0.3,
            1,
            2,
            2.5,
            3,
            3.1,
            3.13,
            3.131,
            RESONANCE,
            W0,
            3.132,
            3.133,
            3.14,
            3.2,
            3.5,
            4,
            5,
            8,
            15,
            30,
        ),
    ),
    FrequencyScene("k2 = 2/s, from rest", 2.0, (0.3, 1, 2, 2.8, W0, 4, 6, 10, 30), wait=40.0),
    FreeScene("free evolution, k2 = 0.002/s, 100 s", 0.002, 100.0, 1.0, 0.5),
    FreeScene("free evolution, underdamped k2 = 1/s", 1.0, 20.0, 1.0, -2.0),
    FreeScene("free evolution, k2 = 6.26/s, 0.1 % below critical", 6.26, 10.0, 1.0, 1.0),
    FreeScene("free evolution, critically damped", 2 * W0, 10.0, 1.0, -3.0),
    FreeScene("free evolution, overdamped k2 = 10/s", 10.0, 20.0, 1.0, 0.0),
    FreeScene("free evolution, overdamped k2 = 50/s", 50.0, 20.0, -1.0, 2.0),
    DocumentScene(),
    GeneralScene(DOCUMENT_K2),
    GeneralScene(1.0),
    GeneralScene(20.0),
)


# Frequency response


def measured_response(
    fmu: Fmu, scene: FrequencyScene, w: float, samples: int
) -> tuple[complex, complex, float]:
    """Return the complex amplitudes of the FMU's angle and of RK4's for the drive cos(w*t), and their round-off.

    They come from the last two periods of a run: the Fourier sum over whole periods, of `samples` communication steps
    each, picks that frequency alone, and is no more than twice the largest angle.
    """
    period = 2 * pi / w
    H = period / samples
    phi, rate = references.held_frequency_response(w, H, scene.k2, W02)
    start = (0.0, 0.0) if scene.wait else (phi.real, rate.real)
    unit = SMALL / abs(complex(references.frequency_response(w, scene.k2, W02)))
    periods = ceil(scene.wait / period) + 2

    def drive(t: float) -> float:
        return float(np.cos(w * t))

    run = fmu.run(
        Experiment(
            periods * period,
            H,
            {"phi_start": unit * start[0], "w_start": unit * start[1], "gamma": scene.k2},
            torque=lambda t: unit * drive(t),
        )
    )
    u = [drive(t) for t in run.t[:-1]]
    own = references.rk4_response(u, H, scene.k2, W02, SUBSTEP, start)
    last = slice(len(run.t) - 1 - 2 * samples, len(run.t) - 1)
    factor = 2 * np.exp(-1j * w * run.t[last])
    largest_angle = largest(np.hypot(own[0], own[1] / W0))
    rounding = free_rounding(run.t[-1], SUBSTEP) * largest_angle + linear_rounding(own, u, H, scene.k2)
    return (
        complex(np.mean(run["phi"][last] / unit * factor)),
        complex(np.mean(own[0][last] * factor)),
        2 * rounding,
    )


def _bode(scene: FrequencyScene, measured: NDArray[np.complex128]) -> Iterator[Plot]:
    fine = np.unique(np.concatenate((np.geomspace(0.1, 30, 300), W0 + np.linspace(-0.05, 0.05, 101))))
    exact = references.frequency_response(fine, scene.k2, W02)
    w = np.array(scene.frequencies)
    yield Plot(
        f"Frequency response, {scene.name}",
        "w [rad/s]",
        "|h(w)| [dB re 1 s2]",
        [
            Curve("FMU, RK4", w, 20 * np.log10(np.abs(measured)), "", "o"),
            Curve("exact", fine, 20 * np.log10(np.abs(exact))),
        ],
        logarithmic="x",
        note=f"{'The Bode plot of the document as it was meant' if scene.k2 == DOCUMENT_K2 else 'With strong drag'}. "
        "Below: the phase, which falls through -90 deg at w0.",
        below=[
            Curve("FMU, RK4", w, np.degrees(np.angle(measured)), "", "o"),
            Curve("exact", fine, np.degrees(np.angle(exact))),
        ],
        below_label="arg h(w) [deg]",
    )
    if scene.k2 > W0 / 10:
        return
    detuning = np.linspace(-4, 4, 201)
    near = references.frequency_response(W0 + detuning * scene.k2, scene.k2, W02)
    shown = np.abs(w - W0) <= 4 * scene.k2
    yield Plot(
        f"Resonance, {scene.name}",
        "(w - w0)/k2",
        "|h(w)| [s2]",
        [
            Curve("FMU, RK4", (w[shown] - W0) / scene.k2, np.abs(measured[shown]), "", "o"),
            Curve("exact", detuning, np.abs(near)),
        ],
        note="The resonance is k2 wide; on the axis of the plot before it is a line.",
    )
