"""What it costs to hold or to interpolate the input over the communication step, as every importer has to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, exp, log, sqrt

import numpy as np

from .. import references
from ..checks import Check, Curve, Plot, Result, Table, formula
from ..fmu import SUBSTEP, W0, W02, Experiment, Fmu, Run, SolverMethod
from ..metrics import SMALL, Array, free_rounding, largest, linear_rounding, observed_order, walk
from .scene import Scene

TITLE = "Held and interpolated inputs"
FORMULA = "cost of an input: exact response to the drive less that to the polynomials that stand for it"


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
                name = f"{self.name}: {way.name}, H = {H:g} s, error beyond that of the method"
                yield Check(name, *_judged(self, run, H, peak, way), "s2")
                errors[way.name].append(largest(np.abs(run["phi"] / SMALL - self.response(run.t)[0])))
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


LAWS_SHOWN = ("sine of 2 rad/s from rest, k2 = 0.5/s", "Gaussian pulse, overdamped k2 = 20/s")
SCENES = (
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
    _gaussian("Gaussian pulse cut on its rise, critically damped", 2 * W0, 0.5, 0.5, 15.0, cut=True),
)


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
def _held(scene: HoldScene, H: float, way: Input) -> references.State:
    """Return the exact angle [s2] and rate [s] at n*H under the drive as the FMU gets it."""
    return references.polynomial_response(_polynomials(scene, H, way), H, scene.k2, W02)


@cache
def _cost(scene: HoldScene, H: float, way: Input) -> Array:
    """Return what the input costs at n*H [s2]: the exact answer to the drive less that to the input."""
    held, _ = _held(scene, H, way)
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


def _judged(scene: HoldScene, run: Run, H: float, peak: float, way: Input) -> tuple[float, float, str]:
    """Return the error [s2] beyond that of the method, its bound, and what that is made of.

    The exact answers round, too.
    """
    phi, exact = run["phi"] / SMALL, _held(scene, H, way)
    drive = _polynomials(scene, H, way)[:, 0]
    of_exact = linear_rounding(exact, drive, H, scene.k2)
    if way.held is None:
        error = largest(np.abs(phi - exact[0]))
        reason = "against the exact response to that input; round-off, of both"
        return error, walk(len(run.t)) * peak + of_exact, reason
    own = references.rk4_response(drive, H, scene.k2, W02, SUBSTEP)[0]
    return (
        largest(np.abs(phi - own)),
        free_rounding(scene.stop, SUBSTEP) * peak + of_exact,
        f"RK4's own error {largest(np.abs(own - exact[0])):.1e} s2, R(h*A)^n against the exact response to that input; "
        "round-off, of both",
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
        note=f"The FMU gets the drive of the middle of each communication step of {scene.steps[-1]:g} s, and holds "
        "it for all of the step; the points lie on the exact line. Below: what holding costs.",
        below=[Curve("FMU less exact", run.t, run["phi"] / SMALL - exact)],
        below_label="error [s2]",
    )


def _law_plot(scene: HoldScene, errors: Mapping[str, Sequence[float]], interpolates: bool) -> Plot:
    H = scene.steps
    curves = []
    for way, line, marker in zip(INPUTS, ("-", "--", ":", "-."), "osd^", strict=True):
        exact = [largest(np.abs(_cost(scene, step, way))) for step in H]
        curves.append(Curve(f"{way.name}, exact", H, exact, line))
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
