"""Grillo's exercise through the FMU: frequency response, free evolution, Gaussian pulse, cost of holding the input."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, cos, exp, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from .. import references
from ..checks import Check, Curve, Plot, Result, Table, formula
from ..fmu import W0, W02, Experiment, Fmu, Run
from ..metrics import SAFETY, Array, free_rounding, largest, observed_order, walk
from .scene import Scene

TITLE = "Grillo's exercise: frequency response, free evolution, Gaussian pulse"
FORMULA = "h(w) = 1/(w02 - w^2 + i*k2*w); held input: h(w)*sinc(w*H/2)*exp(-i*w*H/2)"

SMALL = 1e-9  # amplitude [rad]: the nonlinearity, a relative SMALL^2*w0*T/16, is below rounding
DOCUMENT_K2 = 0.002  # [1/s]
SUBSTEP = 1e-3  # [s], the default
SAMPLED = {0.0: "when the step begins", 0.5: "in its middle"}  # by the fraction of the step

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
            sampled = measured_response(fmu, self, w, samples)
            held, _ = references.held_frequency_response(w, H, self.k2, W02)
            rk4 = _forced_error(w, H, self)
            rounding = walk((self.wait + 2 * period) / SUBSTEP)
            yield Check(
                f"response at w = {w:.9g} rad/s, {self.name}",
                abs(sampled / held - 1),
                SAFETY * rk4 + rounding,
                f"complex amplitude, relative to (exp(i*w*H) - A)^-1*b, the exact one of the held cosine; {SAFETY} x "
                f"h^4 error {rk4:.1e} as if it added up all the time, round-off {rounding:.1e}",
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
        rk4, neglected = references.rk4_error(run.t, exact, self.k2, W02, SUBSTEP)
        beyond = np.hypot(run["phi"] / SMALL - exact[0] - rk4[0], (run["w"] / SMALL - exact[1] - rk4[1]) / W0)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            largest(beyond) / peak,
            SAFETY * largest(np.hypot(neglected[0], neglected[1] / W0)) / peak
            + free_rounding(self.stop, SUBSTEP),
            f"angle and rate/w0, relative to the peak; error {largest(error) / peak:.2e}, {SAFETY} x the next term "
            "t*h^6*A^7/336, and round-off",
        )
        shown = run.t <= 20
        yield Plot(
            self.name[0].upper() + self.name[1:],
            "t [s]",
            "phi [1e-9 rad]",
            [
                Curve("FMU, RK4", run.t[shown][::4], run["phi"][shown][::4] / SMALL, "", "."),
                Curve("exact", run.t[shown], exact[0][shown]),
            ],
            note="c1*exp((-k2 + i*sqrt(nabla))*t/2) + c2*exp((-k2 - i*sqrt(nabla))*t/2), the roots corrected, from "
            "an initial angle and rate. Below: distance of the states.",
            below=[Curve("FMU less exact", run.t[shown][1:], error[shown][1:] / peak)],
            below_label="relative to the peak",
            below_logarithmic="y",
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
        peak = largest(np.abs(self.response(np.linspace(0, self.stop, 2001))[0]))
        rows = []
        for H in self.steps:
            row = [H]
            for fraction in (0.0, 0.5):
                run, held = _drive(fmu, self, H, fraction), _held(self, H, fraction)
                phi, exact = run["phi"] / SMALL, self.response(run.t)[0]
                rounding = _rounding(self, run, peak)
                yield Check(
                    f"{self.name}: held, H = {H:g} s, sampled {SAMPLED[fraction]}",
                    largest(np.abs(phi - held)),
                    rounding,
                    f"against the exact response to the held input; {SAFETY} x t*h^4*A^5/120 of the motion about "
                    "drive/w02, and round-off",
                    "s2",
                )
                row += [largest(np.abs(phi - exact)), largest(np.abs(held - exact))]
            rows.append(tuple(row))
        yield from _law(self, rows)
        yield Table(
            f"Largest error relative to the peak, {self.name}",
            ("H [s]", *(f"sampled {SAMPLED[x]}: {who}" for x in SAMPLED for who in ("FMU", "exact"))),
            [(H, *(x / peak for x in errors)) for H, *errors in rows],
            "What holding the input costs: first order in H, second if the sample is taken in the middle of the step.",
        )
        yield _hold_plot(self, run)
        yield _law_plot(self, rows)


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
            holding = H * H / 24 * largest(np.abs(curvature))
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
                    Curve("FMU, RK4", run.t[shown][::20], phi[shown][::20], "", "."),
                    Curve("causal closed form", run.t[shown], exact[shown]),
                    Curve("drive/w02", run.t[shown], area * np.exp(-(run.t[shown] ** 2) / 2) / W02, ":"),
                ],
                note="The plot of the document, from -10 to 10 s, as it was meant: the angle follows the drive, then "
                "rings. Below: the input is held from the middle of steps of 10 ms.",
                below=[Curve("FMU less exact", run.t[shown], phi[shown] - exact[shown])],
                below_label="error [rad]",
            )
        integral, _ = quad(
            lambda x: exp(-x * x) * cos(sqrt(4 * W02 - DOCUMENT_K2**2) / 2 * sqrt(2) * x), -8, 8
        )
        closed = sqrt(pi) * exp(-(4 * W02 - DOCUMENT_K2**2) / 8)
        yield formula(
            "the document's constant I by quadrature",
            abs(integral - closed),
            1.5e-8 * sqrt(pi),
            f"sqrt(pi)*exp(-beta^2*c/2) = {closed:.12g}; QUADPACK's tolerance 1.5e-8 of the integral of the absolute "
            "value",
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
        free = references.free_evolution(run.t, self.phi0, self.rate0 * W0, self.k2, W02)
        driven = references.held_response([drive(t) for t in run.t[:-1]], self.H, self.k2, W02)
        exact = free[0] + driven[0]
        own, neglected = references.rk4_error(run.t, free, self.k2, W02, SUBSTEP)
        # While it is driven the pendulum moves about the deflection of the drive, in steps of it.
        u = np.append([drive(t) for t in run.t[:-1]], 0.0)
        forced = references.rk4_error_rate((driven[0] - u / W02, driven[1]), self.k2, W02, SUBSTEP)[0]
        rk4 = largest(np.abs(own[0])) + min(self.stop, 4 / self.k2) * largest(forced)
        peak = largest(np.abs(exact))
        yield Check(
            f"{self.name}: free evolution and convolution together",
            largest(np.abs(run["phi"] / SMALL - exact)) / peak,
            (SAFETY * rk4 + largest(np.abs(neglected[0]))) / peak + free_rounding(self.stop, SUBSTEP),
            f"relative to the peak; {SAFETY} x h^4 error {rk4 / peak:.1e}, and round-off",
        )
        yield Plot(
            self.name[0].upper() + self.name[1:],
            "t [s]",
            "phi [1e-9 rad]",
            [
                Curve("FMU, RK4", run.t[::5], run["phi"][::5] / SMALL, "", "."),
                Curve("free evolution + response", run.t, exact),
                Curve("free evolution alone", run.t, free[0], "--"),
                Curve("drive/w02", run.t, u / W02, ":"),
            ],
            note="An initial state and a pulse of the drive about 5 s: linear, so that the solutions add. Below: the "
            "FMU.",
            below=[Curve("FMU less exact", run.t[1:], np.abs(run["phi"] / SMALL - exact)[1:] / peak)],
            below_label="|error|/peak",
            below_logarithmic="y",
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
    GeneralScene(DOCUMENT_K2),
    GeneralScene(1.0),
    GeneralScene(20.0),
)


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


def _forced_error(w: float, H: float, scene: FrequencyScene) -> float:
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
        note="The document's Bode plot as it was meant. Below: the phase, which falls through -90 deg at w0.",
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


def _held(scene: HoldScene, H: float, fraction: float) -> Array:
    """Return the exact angle [s2] at n*H under the drive as it is held."""
    samples = [scene.drive((n + fraction) * H) for n in range(round(scene.stop / H))]
    return references.held_response(samples, H, scene.k2, W02)[0]


def _law(scene: HoldScene, rows: Sequence[Sequence[float]]) -> Iterator[Check]:
    """Yield the order in H and the leading term of the exact errors of holding."""
    H, *_ = rows[-1]
    t = np.linspace(0, scene.stop, 4001)
    begin, middle = _hold_errors(scene, H)
    next_term = 2 * H * _sharpness(scene, t)
    for order, column, leading, term in (
        (1, 2, begin, "H/2*max|phi' - u(0)*h|"),
        (2, 4, middle, "H^2/24*max|phi'' - u(0)*h' + u'(0)*h|"),
    ):
        coarse, fine = rows[-2][column], rows[-1][column]
        yield formula(
            f"{scene.name}: order of holding, sampled {SAMPLED[(order - 1) / 2]}",
            abs(observed_order(coarse, fine) - order),
            next_term,
            f"theory {order}; the next term is H*max|phi''|/max|phi'| of it, or less",
        )
        yield formula(
            f"{scene.name}: error of holding, H = {H:g} s, sampled {SAMPLED[(order - 1) / 2]}",
            abs(fine / leading - 1),
            next_term,
            f"{term} = {leading:.3e} s2; the next term as before",
        )


def _rounding(scene: HoldScene, run: Run, peak: float) -> float:
    """Return the error [s2] of RK4 and of rounding for a held drive."""
    phi, rate = scene.response(run.t)
    drive = np.array([scene.drive(t) for t in run.t])
    growth = references.rk4_error_rate((phi - drive / W02, rate), scene.k2, W02, SUBSTEP)[0]
    time = min(scene.stop, 4 / scene.k2)
    return SAFETY * time * largest(growth) + walk(scene.stop / SUBSTEP) * peak


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
    exact = scene.response(run.t)[0]
    return Plot(
        scene.name[0].upper() + scene.name[1:],
        "t [s]",
        "phi/drive [s2]",
        [
            Curve("FMU, RK4", run.t[shown], run["phi"][shown] / SMALL, "", "."),
            Curve("exact", run.t, exact),
            Curve("drive/w02", run.t, u, ":"),
        ],
        note=f"Held from the middle of steps of {scene.steps[-1]:g} s. Below: what holding costs.",
        below=[Curve("FMU less exact", run.t, run["phi"] / SMALL - exact)],
        below_label="error [s2]",
    )


def _law_plot(scene: HoldScene, rows: Sequence[Sequence[float]]) -> Plot:
    H = [row[0] for row in rows]
    return Plot(
        f"Error against communication step, {scene.name}",
        "H [s]",
        "largest error [s2]",
        [
            Curve("FMU, sampled when the step begins", H, [row[1] for row in rows], "", "o"),
            Curve("exact, held", H, [row[2] for row in rows]),
            Curve("FMU, sampled in the middle", H, [row[3] for row in rows], "", "s"),
            Curve("exact, held from the middle", H, [row[4] for row in rows], "--"),
        ],
        "xy",
        note="First order in H if the input is held from the beginning of the step, second from its middle. The "
        "FMU's own error is far below both.",
    )
