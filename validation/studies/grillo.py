"""Grillo's exercise through the FMU: frequency response, free evolution, Gaussian pulse, cost of holding the input."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import ceil, cos, exp, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

from .. import references
from ..checks import Check, Curve, Plot, Result, Table, formula
from ..fmu import W0, W02, Experiment, Fmu, Run, SolverMethod
from ..metrics import SAFETY, Array, free_rounding, largest, observed_order, walk
from .scene import Scene

TITLE = "Grillo's exercise: frequency response, free evolution, Gaussian pulse"
FORMULA = "h(w) = 1/(w02 - w^2 + i*k2*w); held input: h(w)*sinc(w*H/2)*exp(-i*w*H/2)"

SMALL = 1e-9  # amplitude [rad]: the nonlinearity, a relative SMALL^2*w0*T/16, is below rounding
DOCUMENT_K2 = 0.002  # [1/s]
SUBSTEP = 1e-3  # [s], the default
EPS = 2.0**-52

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
                f"h^4 error {rk4:.1e} as it adds up or of its periodic solution, round-off {rounding:.1e}",
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


Drive = Callable[[float], float]


@dataclass(frozen=True)
class Input:
    """What the FMU gets of a drive in a communication step.

    Attributes
    ----------
    order : of the error in the communication step
    polynomial : drive and its derivatives when the step begins, from the drive, its rate, begin and length of the step
    held : a fraction of the step at which it is sampled, None if it is interpolated
    """

    name: str
    order: int
    polynomial: Callable[[Drive, Drive, float, float], Sequence[float]]
    held: float | None = None


def _chord(u: Drive, _: Drive, t: float, H: float) -> Sequence[float]:
    return u(t), (u(t + H) - u(t)) / H


def _cubic(u: Drive, rate: Drive, t: float, H: float) -> Sequence[float]:
    """Return Hermite's cubic of the values and rates at both ends."""
    rise = (u(t + H) - u(t)) / H
    before, after = rate(t), rate(t + H)
    return u(t), before, (6 * rise - 4 * before - 2 * after) / H, (6 * before + 6 * after - 12 * rise) / H**2


INPUTS = (
    Input("held from the beginning of the step", 1, lambda u, _, t, H: (u(t),), 0.0),
    Input("held from its middle", 2, lambda u, _, t, H: (u(t + H / 2),), 0.5),
    Input("interpolated by chords", 2, _chord),
    Input("interpolated by cubics", 4, _cubic),
)


@dataclass(frozen=True)
class HoldScene(Scene):
    """A drive u(t) with its rate, from rest, held or interpolated over ever shorter communication steps [s].

    `response` is the exact response to the drive itself; a derivative of the drive, up to the sixth, is at most
    `fastest` [1/s] times the one before.
    """

    TITLE = "{0.title}"

    title: str
    k2: float
    stop: float
    drive: Drive
    drive_rate: Drive
    response: Callable[[Array], references.State]
    fastest: float
    steps: Sequence[float] = (0.05, 0.025, 0.0125)

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        peak = largest(np.abs(self.response(np.linspace(0, self.stop, 2001))[0]))
        errors: dict[str, list[float]] = {}
        runs: dict[str, Run] = {}  # with the shortest step
        for way in INPUTS:
            if way.held is None and not fmu.interpolates:
                continue
            errors[way.name] = []
            for H in self.steps:
                run = runs[way.name] = _drive(fmu, self, H, way)
                phi = run["phi"] / SMALL
                yield Check(
                    f"{self.name}: {way.name}, H = {H:g} s",
                    largest(np.abs(phi - _held(self, H, way))),
                    *_rounding(self, run, peak, way),
                    "s2",
                )
                errors[way.name].append(largest(np.abs(phi - self.response(run.t)[0])))
        yield from _laws(self)
        yield Table(
            f"Largest error relative to the peak, {self.name}",
            ("H [s]", *(f"{name}: {who}" for name in errors for who in ("FMU", "exact"))),
            [
                (
                    H,
                    *(
                        x / peak
                        for way in INPUTS
                        if way.name in errors
                        for x in (errors[way.name][i], largest(np.abs(_cost(self, H, way))))
                    ),
                )
                for i, H in enumerate(self.steps)
            ],
            shown=False,
        )
        yield _hold_plot(self, runs[INPUTS[1].name])
        if self.name in LAWS_SHOWN:
            yield _law_plot(self, errors, fmu.interpolates)


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
        drive_rate=lambda t: (center - t) / sigma**2 * exp(-((t - center) ** 2) / (2 * sigma**2)),
        response=lambda t: references.gaussian_response(
            t, 1.0, center, sigma**2, k2, W02, start=0.0 if cut else None
        ),
        fastest=sqrt(5) / sigma,  # the sixth derivative is at most 15/sigma^6, the fourth 3/sigma^4
        steps=(sigma / 20, sigma / 40, sigma / 80),
    )


RESONANCE = sqrt(W02 - DOCUMENT_K2**2 / 2)
LAWS_SHOWN = ("sine of 2 rad/s from rest, k2 = 0.5/s", "Gaussian pulse, overdamped k2 = 20/s")
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
        drive_rate=lambda t: 2.0 * cos(2.0 * t),
        response=lambda t: references.sinusoidal_response(t, 2.0, 0.5, W02),
        fastest=2.0,
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
    """Return the error of RK4 relative to the amplitude, the smaller of two bounds.

    Its growth rate times the run or, if shorter, twice 2/k2, along the free motion about drive/w02; or the difference
    of RK4's own periodic solution, and twice the free evolution from there to the start.
    """
    phi, rate = references.held_frequency_response(w, H, scene.k2, W02)
    A = np.array([[0.0, 1.0], [-W02, -scene.k2]])
    defect = np.linalg.matrix_power(A, 5) @ np.array([phi - 1 / W02, rate])
    growth = SUBSTEP**4 / 120 * float(np.hypot(abs(defect[0]), abs(defect[1]) / W0))
    duration = min(scene.wait + 4 * pi / w, 4 / scene.k2)
    n, one = ceil(H / SUBSTEP), np.eye(2)
    z = H / n * A
    substep = one + z @ (one + z @ (one + z @ (one + z / 4) / 3) / 2)
    step = np.linalg.matrix_power(substep, n)
    own = np.linalg.solve(np.exp(1j * w * H) * one - step, (one - step) @ (1 / W02, 0.0))
    periodic = abs(own[0] - phi) + 2 * float(np.hypot(abs(own[0] - phi), abs(own[1] - rate) / W0))
    return float(min(growth * duration, periodic) / abs(phi))


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


def _times(scene: HoldScene, H: float) -> Array:
    return np.arange(round(scene.stop / H) + 1, dtype=float) * H


def _drive(fmu: Fmu, scene: HoldScene, H: float, way: Input) -> Run:
    """Return a run under the drive as it is held, with RK4, or interpolated, with TaylorSeries, whose error is nil."""
    start, stop = {"phi_start": 0.0, "gamma": scene.k2}, H * round(scene.stop / H)
    fraction = way.held
    if fraction is not None:
        return fmu.run(Experiment(stop, H, start, lambda t: SMALL * scene.drive(t + fraction * H)))
    start |= {"solver.method": SolverMethod.TaylorSeries, "solver.stepSize": H}
    return fmu.run(Experiment(stop, H, start, inputs=SMALL * _polynomials(scene, H, way)))


@cache
def _polynomials(scene: HoldScene, H: float, way: Input) -> Array:
    """Return the drive in each communication step, its value and derivatives when the step begins."""
    return np.array(
        [way.polynomial(scene.drive, scene.drive_rate, t, H) for t in _times(scene, H)[:-1].tolist()]
    )


@cache
def _held(scene: HoldScene, H: float, way: Input) -> Array:
    """Return the exact angle [s2] at n*H under the drive as the FMU gets it."""
    return references.polynomial_response(_polynomials(scene, H, way), H, scene.k2, W02)[0]


@cache
def _cost(scene: HoldScene, H: float, way: Input) -> Array:
    """Return what the input costs at n*H [s2]: the exact answer to the drive less that to the input."""
    held = _held(scene, H, way)
    return np.asarray(scene.response(_times(scene, H))[0] - held)


def _laws(scene: HoldScene) -> Iterator[Check]:
    """Yield what the input costs against its leading terms, and the order of the cubics."""
    *_, coarse, fine = scene.steps
    fastest = _fastest(scene)
    for H in (coarse, fine):
        for way, (term, leading) in zip(INPUTS, _leading_terms(scene, H), strict=False):
            cost = _cost(scene, H, way)
            yield formula(
                f"{scene.name}: cost of an input {way.name}, H = {H:g} s",
                largest(np.abs(cost - leading)) / largest(np.abs(leading)),
                (H * fastest / 2) ** 2,
                f"at all times against {term}, {largest(np.abs(leading)):.3e} s2 at most; relative to it, the next "
                f"term is (H*r/2)^2 or less, r = {fastest:.3g}/s the fastest rate of pendulum and drive",
            )
    cubic = INPUTS[-1]
    costs = [largest(np.abs(_cost(scene, H, cubic))) for H in (coarse, fine)]
    yield formula(
        f"{scene.name}: order of an input {cubic.name}",
        abs(observed_order(*costs) - cubic.order),
        3 / log(2) * (fine * fastest / 2) ** 2,
        f"theory {cubic.order}; the next term as before",
    )


def _fastest(scene: HoldScene) -> float:
    """Return the fastest rate [1/s] of the pendulum and the drive."""
    return max(scene.fastest, W0 if scene.k2 < 2 * W0 else references.real_roots(scene.k2, W02)[0])


def _rounding(scene: HoldScene, run: Run, peak: float, way: Input) -> tuple[float, str]:
    """Return the error [s2] of the method and of rounding, and what it is made of.

    The step of the exact answer rounds the same way each time, too.
    """
    steps = len(run.t)
    same = steps * EPS * peak
    if way.held is None:
        return walk(steps) * peak + same, "against the exact response to that input; round-off, of both"
    phi, rate = scene.response(run.t)
    drive = np.array([scene.drive(t) for t in run.t])
    growth = references.rk4_error_rate((phi - drive / W02, rate), scene.k2, W02, SUBSTEP)[0]
    own = SAFETY * min(scene.stop, 4 / scene.k2) * largest(growth)
    return (
        own + walk(scene.stop / SUBSTEP) * peak + same,
        f"against the exact response to that input; {SAFETY} x t*h^4*A^5/120 of the motion about drive/w02, and "
        "round-off",
    )


def _leading_terms(scene: HoldScene, H: float) -> Iterator[tuple[str, Array]]:
    """Yield the leading terms at n*H [s2] of what `INPUTS` cost, but for the cubics, in words and in numbers.

    Taylor expansion of the drive less the input in a step, under the integral of the convolution with the impulse
    response h.
    """
    t = _times(scene, H)
    phi, rate = scene.response(t)
    h, hdot = references.impulse_response(t, scene.k2, W02)
    u = np.array([scene.drive(time) for time in t])
    begun = scene.drive_rate(0.0) * h
    bent = u - scene.k2 * rate - W02 * phi - u[0] * hdot  # phi'' - u(0)*h'
    yield (
        "H/2*(phi' - u(0)*h) - H^2/6*(phi'' - u(0)*h' - u'(0)*h/2)",
        H / 2 * (rate - u[0] * h) - H * H / 6 * (bent - begun / 2),
    )
    yield "-H^2/24*(phi'' - u(0)*h' + u'(0)*h)", -H * H / 24 * (bent + begun)
    yield "-H^2/12*(phi'' - u(0)*h' - u'(0)*h)", -H * H / 12 * (bent - begun)


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


def _law_plot(scene: HoldScene, errors: Mapping[str, Sequence[float]], interpolates: bool) -> Plot:
    H = scene.steps
    curves = []
    for way, marker in zip(INPUTS, "osd^", strict=True):
        exact = [largest(np.abs(_cost(scene, step, way))) for step in H]
        curves.append(Curve(f"{way.name}, exact", H, exact))
        if way.name in errors:
            curves.append(Curve(f"{way.name}, FMU", H, errors[way.name], "", marker, like=curves[-1].label))
    return Plot(
        f"Error against communication step, {scene.name}",
        "H [s]",
        "largest error [s2]",
        curves,
        "xy",
        note="An input that is held from the beginning of the step costs an error of the first order in H, one from "
        "its middle or along chords the second, and cubics the fourth."
        + (
            " This FMU cannot interpolate its input (canInterpolateInputs is false), so that only the exact answers to "
            "chords and cubics are shown; the native FMU can." * (not interpolates)
        ),
    )
