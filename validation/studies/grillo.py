"""Grillo's exercise through the FMU: frequency response, free evolution, Gaussian pulse, cost of holding the input."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W0, W02, Experiment, Fmu, Run
from ..metrics import largest, observed_order
from .impulse_response import SUBSTEP, truncation
from .scene import Scene

TITLE = "Grillo's exercise: frequency response, free evolution, Gaussian pulse"
FORMULA = "h(w) = 1/(w02 - w^2 + i*k2*w); held input: h(w)*sinc(w*H/2)*exp(-i*w*H/2)"

Array = NDArray[np.float64]
SMALL = 1e-9  # amplitude [rad]: the nonlinearity, a relative SMALL^2*w0*T/16, is below rounding
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
        measured, sharp = [], []
        for w in self.frequencies:
            period = 2 * pi / w
            samples = max(64, ceil(period / 0.02))  # of a period
            H = period / samples
            sampled = measured_response(fmu, self, w, samples)
            measured.append(sampled / references.hold(w, H))
            exact = complex(references.frequency_response(w, self.k2, W02))
            ratio = measured[-1] / exact
            held, _ = references.held_frequency_response(w, H, self.k2, W02)
            images = abs(held / references.hold(w, H) / exact - 1)
            floor = 1.5 * _forced_truncation(w, H, self) + rounding(self.wait + 2 * period)
            sharp.append((abs(sampled / held - 1) / floor, w, floor))
            reason = f"1.5 x images of the held sinusoid, closed form, {images:.1e}; h^4 error, round-off {floor:.1e}"
            name = f"w = {w:.9g} rad/s, {self.name}"
            bound = 1.5 * images + floor
            yield Check(f"amplitude at {name}", abs(abs(ratio) - 1), bound, f"relative; {reason}")
            yield Check(f"phase at {name}", abs(float(np.angle(ratio))), bound, reason, "rad")
        worst, w, floor = sharp[int(np.argmax([row[0] for row in sharp]))]  # NaN counts as the largest
        yield Check(
            f"images included, worst at w = {w:.9g} rad/s, {self.name}",
            worst * floor,
            floor,
            "complex amplitude, relative to (exp(i*w*H) - A)^-1*b; 1.5 x h^4 error + round-off",
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
        phi0, rate0 = self.phi0, self.rate0 * W0
        run = fmu.run(
            Experiment(
                self.stop,
                0.05,
                {"phi_start": SMALL * phi0, "w_start": SMALL * rate0, "gamma": self.k2},
                record=("phi", "w"),
            )
        )
        exact = references.free_evolution(run.t, phi0, rate0, self.k2, W02)
        peak = float(np.max(np.hypot(exact[0], exact[1] / W0)))
        error = np.hypot(run["phi"] / SMALL - exact[0], (run["w"] / SMALL - exact[1]) / W0)
        # The rate is the free evolution whose angle is the rate.
        swing = references.free_evolution(run.t, rate0, -self.k2 * rate0 - W02 * phi0, self.k2, W02)
        growth = np.hypot(truncation(exact, self.k2, W02), truncation(swing, self.k2, W02) / W0)
        expected = float(np.max(run.t * growth)) / peak
        yield Check(
            self.name,
            float(np.max(error)) / peak,
            1.5 * expected + rounding(self.stop),
            f"angle and rate/w0, relative to the peak; 1.5 x t*h^4*A^5/120 = {expected:.1e}, and round-off",
        )


@dataclass(frozen=True)
class HoldScene(Scene):
    """A drive u(t) with its rate, from rest at `begin`, held over ever shorter communication steps [s].

    `response` is the exact response to the drive itself.
    """

    TITLE = "{0.title}"

    title: str
    k2: float
    stop: float
    drive: Callable[[float], float]
    drive_rate_at_begin: float
    response: Callable[[Array], references.State]
    begin: float = 0.0
    steps: Sequence[float] = (0.05, 0.025, 0.0125)

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        early: list[float] = []
        middle: list[float] = []
        for H in self.steps:
            for fraction, errors in ((0.0, early), (0.5, middle)):
                run = _drive(fmu, self, H, fraction)
                phi = run["phi"] / SMALL
                errors.append(float(np.max(np.abs(phi - self.response(run.t)[0]))))
        begin, centre = _hold_errors(self, self.steps[-1])
        peak = float(np.max(np.abs(self.response(run.t)[0])))
        yield from _against_held(self, run, peak)
        next_term = self.steps[-2] * _sharpness(self, run.t)
        yield Check(
            f"{self.name}: order in H, sampled when the step begins",
            abs(observed_order(early[-2], early[-1]) - 1),
            next_term,
            "theory 1: the held input lags by H/2; the next term is H*max|phi''|/max|phi'| of it, or less",
        )
        yield Check(
            f"{self.name}: order in H, sampled in the middle of the step",
            abs(observed_order(middle[-2], middle[-1]) - 2),
            next_term,
            "theory 2: the lag is gone; the next term as before",
        )
        yield Check(
            f"{self.name}: lag of the input, H = {self.steps[-1]:g} s",
            abs(early[-1] / begin - 1),
            next_term,
            f"H/2*max|phi' - u(0)*h| = {begin:.3e} s2; the next term as before",
        )
        yield Check(
            f"{self.name}: in the middle, H = {self.steps[-1]:g} s",
            abs(middle[-1] / centre - 1),
            next_term + _drive_floor(self, run, peak) / centre,
            f"H^2/24*max|phi'' - u(0)*h' + u'(0)*h| = {centre:.3e} s2; the next term as before, h^4 error, round-off",
        )
        yield Table(
            f"Largest error relative to the peak, {self.name}",
            ("H [s]", "sampled when the step begins", "sampled in the middle"),
            [(H, a / peak, b / peak) for H, a, b in zip(self.steps, early, middle, strict=True)],
        )
        yield _hold_plot(self, run)


@dataclass(frozen=True)
class DocumentScene(Scene):
    """The pulse of the document, with its numbers."""

    TITLE = "Gaussian pulse of the document"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the pulse of the document, A*exp(-t^2/2), from 9 s before its peak, and cut at it."""
        H, area = 0.01, 1 / sqrt(2 * pi)

        def pulse(t: float) -> float:
            return SMALL * area * exp(-((t + H / 2) ** 2) / 2)

        for begin, name, stop, expected in (
            (-9.0, "from minus infinity", 50.0, DOCUMENT_PULSE),
            (0.0, "cut at its peak", 10.0, {1: CUT_PULSE_AT_1}),
        ):
            run = fmu.run(Experiment(stop, H, {"phi_start": 0.0}, torque=pulse, begin=begin))
            phi = run["phi"] / SMALL
            start = None if begin < 0 else begin
            exact, rate = references.gaussian_response(run.t, area, 0.0, 1.0, DOCUMENT_K2, W02, start)
            curvature = area * np.exp(-(run.t**2) / 2) - DOCUMENT_K2 * rate - W02 * exact
            if begin == 0:
                curvature -= area * references.impulse_response(run.t, DOCUMENT_K2, W02)[1]
            holding = H * H / 24 * float(np.max(np.abs(curvature)))
            yield Check(
                f"document's pulse {name}, at t = {', '.join(map(str, expected))} s",
                largest(abs(phi[round((t - begin) / H)] - value) for t, value in expected.items()),
                1.05 * holding,
                f"numbers of 15 digits; 1.05 x H^2/24*max|phi''| = {holding:.1e} of the input held from the middle",
                "rad",
            )
            shown = run.t <= 10
            yield Plot(
                f"Gaussian pulse of the document, {name}",
                "t [s]",
                "phi [rad]",
                [
                    Curve("FMU, RK4", run.t[shown][::20].tolist(), phi[shown][::20].tolist(), "", "."),
                    Curve("causal closed form", run.t[shown].tolist(), exact[shown].tolist()),
                ],
            )


def _gaussian(name: str, k2: float, center: float, sigma: float, stop: float, cut: bool = False) -> HoldScene:
    """Return a Gaussian pulse; if it is not `cut`, the exact response is the one from minus infinity."""
    return HoldScene(
        name,
        k2,
        stop,
        drive=lambda t: exp(-((t - center) ** 2) / (2 * sigma**2)),
        drive_rate_at_begin=center / sigma**2 * exp(-(center**2) / (2 * sigma**2)) if cut else 0.0,
        response=lambda t: references.gaussian_response(
            t, 1.0, center, sigma**2, k2, W02, start=0.0 if cut else None
        ),
        steps=(sigma / 20, sigma / 40, sigma / 80),
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
    HoldScene(
        "sine of 2 rad/s from rest, k2 = 0.5/s",
        0.5,
        20.0,
        drive=lambda t: float(np.sin(2.0 * t)),
        drive_rate_at_begin=2.0,
        response=lambda t: references.sinusoidal_response(t, 2.0, 0.5, W02),
    ),
    _gaussian("Gaussian pulse, k2 = 0.002/s", 0.002, 5.0, 0.5, 20.0),
    _gaussian("Gaussian pulse, k2 = 1/s", 1.0, 3.0, 0.3, 15.0),
    _gaussian("Gaussian pulse, critically damped", 2 * W0, 5.0, 0.5, 15.0),
    _gaussian("Gaussian pulse, overdamped k2 = 20/s", 20.0, 5.0, 0.5, 15.0),
    _gaussian("Gaussian pulse cut at its peak, k2 = 0.002/s", 0.002, 0.0, 1.0, 20.0, cut=True),
    _gaussian("Gaussian pulse cut on its rise, k2 = 1/s", 1.0, 0.5, 0.5, 15.0, cut=True),
    DocumentScene(),
)


def rounding(stop: float) -> float:
    """Return the relative round-off of a run: a random walk of one rounding a substep, taken fourfold."""
    return 4 * 1.1e-16 * sqrt(stop / SUBSTEP)


# Frequency response


def measured_response(fmu: Fmu, scene: FrequencyScene, w: float, samples: int) -> complex:
    """Return the complex amplitude of the angle per unit of the drive cos(w*t), from the last two periods of a run.

    The Fourier sum over whole periods, of `samples` communication steps each, picks that frequency alone.
    """
    period = 2 * pi / w
    H = period / samples
    drive = SMALL / abs(complex(references.frequency_response(w, scene.k2, W02)))
    phi, rate = (
        (0.0, 0.0)
        if scene.wait
        else (drive * x.real for x in references.held_frequency_response(w, H, scene.k2, W02))
    )
    periods = ceil(scene.wait / period) + 2
    run = fmu.run(
        Experiment(
            periods * period,
            H,
            {"phi_start": phi, "w_start": rate, "gamma": scene.k2},
            torque=lambda t: drive * float(np.cos(w * t)),
        )
    )
    last = slice(len(run.t) - 1 - 2 * samples, len(run.t) - 1)
    return complex(np.mean(run["phi"][last] * np.exp(-1j * w * run.t[last])) * 2 / drive)


def _forced_truncation(w: float, H: float, scene: FrequencyScene) -> float:
    """Return the error of RK4 relative to the amplitude: its growth rate times the run or, if shorter, twice 2/k2.

    Between communication points the pendulum moves freely about drive/w02.
    """
    phi, rate = references.held_frequency_response(w, H, scene.k2, W02)
    A = np.array([[0.0, 1.0], [-W02, -scene.k2]])
    defect = np.linalg.matrix_power(A, 5) @ np.array([phi - 1 / W02, rate])
    growth = SUBSTEP**4 / 120 * float(np.hypot(abs(defect[0]), abs(defect[1]) / W0))
    duration = min(scene.wait + 4 * pi / w, 4 / scene.k2)
    return growth * duration / abs(phi)


def _bode(scene: FrequencyScene, measured: NDArray[np.complex128]) -> Iterator[Plot]:
    fine = np.unique(np.concatenate((np.geomspace(0.1, 30, 300), W0 + np.linspace(-0.05, 0.05, 101))))
    exact = references.frequency_response(fine, scene.k2, W02)
    w = list(scene.frequencies)
    yield Plot(
        f"Frequency response, {scene.name}",
        "w [rad/s]",
        "|h(w)| [s2]",
        [
            Curve("FMU, RK4", w, np.abs(measured).tolist(), "", "o"),
            Curve("exact", fine.tolist(), np.abs(exact).tolist()),
        ],
        logarithmic="xy",
    )
    yield Plot(
        f"Phase of the frequency response, {scene.name}",
        "w [rad/s]",
        "arg h(w) [deg]",
        [
            Curve("FMU, RK4", w, np.degrees(np.angle(measured)).tolist(), "", "o"),
            Curve("exact", fine.tolist(), np.degrees(np.angle(exact)).tolist()),
        ],
        logarithmic="x",
    )


# Free evolution


# Held inputs


def _drive(fmu: Fmu, scene: HoldScene, H: float, fraction: float) -> Run:
    return fmu.run(
        Experiment(
            H * round(scene.stop / H),
            H,
            {"phi_start": 0.0, "gamma": scene.k2},
            torque=lambda t: SMALL * scene.drive(t + fraction * H),
        )
    )


def _against_held(scene: HoldScene, run: Run, peak: float) -> Iterator[Check]:
    """Yield the row that no holding blurs: the run against the exact propagation of the drive as it was held."""
    H = scene.steps[-1]
    u = [scene.drive(t + H / 2) for t in run.t[:-1]]
    exact = references.held_response(u, H, scene.k2, W02)[0]
    yield Check(
        f"{scene.name}: against the exact response to the held input",
        float(np.max(np.abs(run["phi"] / SMALL - exact))),
        _drive_floor(scene, run, peak),
        "1.5 x t*h^4*A^5/120 of the motion about drive/w02, and round-off",
        "s2",
    )


def _drive_floor(scene: HoldScene, run: Run, peak: float) -> float:
    """Return the error [s2] of RK4 and of rounding for a held drive."""
    phi, rate = scene.response(run.t)
    drive = np.array([scene.drive(t) for t in run.t])
    growth = truncation((phi - drive / W02, rate), scene.k2, W02)
    time = min(scene.stop, 4 / scene.k2)
    return 1.5 * time * float(np.max(growth)) + rounding(scene.stop) * peak


def _hold_errors(scene: HoldScene, H: float) -> tuple[float, float]:
    """Return the leading errors [s2] of holding a sample from the beginning and from the middle of the step.

    exact - held = H/2*(phi' - u(0)*h) and -H^2/24*(phi'' - u(0)*h' + u'(0)*h), with the impulse response h: Taylor
    expansion of the input about the sample, under the integral of the convolution.
    """
    t = np.linspace(0, scene.stop, 4001)
    phi, rate = scene.response(t)
    h, hdot = references.impulse_response(t, scene.k2, W02)
    u = np.array([scene.drive(time) for time in t])
    acceleration = u - scene.k2 * rate - W02 * phi
    early = H / 2 * (rate - u[0] * h)
    middle = H * H / 24 * (acceleration - u[0] * hdot + scene.drive_rate_at_begin * h)
    return float(np.max(np.abs(early))), float(np.max(np.abs(middle)))


def _sharpness(scene: HoldScene, t: Array) -> float:
    """Return max|phi''|/max|phi'| [1/s] of the response, the rate at which it can change its course."""
    phi, rate = scene.response(t)
    u = np.array([scene.drive(time) for time in t])
    return float(np.max(np.abs(u - scene.k2 * rate - W02 * phi)) / np.max(np.abs(rate)))


def _hold_plot(scene: HoldScene, run: Run) -> Plot:
    shown = np.linspace(0, len(run.t) - 1, 121).astype(int)
    u = np.array([scene.drive(t) for t in run.t]) / W02
    return Plot(
        scene.name,
        "t [s]",
        "phi/drive [s2]",
        [
            Curve("FMU, RK4", run.t[shown].tolist(), (run["phi"][shown] / SMALL).tolist(), "", "."),
            Curve("exact", run.t.tolist(), scene.response(run.t)[0].tolist()),
            Curve("drive/w02", run.t.tolist(), u.tolist(), ":"),
        ],
    )
