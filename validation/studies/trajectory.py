"""Angle and rate of undamped swings and rotations against Jacobi's elliptic functions, through the FMU with RK4."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import pi, radians, sqrt, ulp

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipk

from .. import references
from ..checks import Check, Curve, Plot, Result
from ..fmu import W0, W02, Experiment, Fmu, Run
from ..metrics import observed_order, phase_and_drift, state_error
from .scene import Scene

TITLE = "Trajectory against elliptic functions"
FORMULA = (
    "phi = 2*atan2(k*sn u, dn u), w = 2*k*w0*cn u, u = w0*t + u0, k^2 = sin(phi0/2)^2 + (w_start/(2*w0))^2; "
    "k > 1 rotates: DLMF 22.19(i)"
)

STEP = 0.02  # communication step [s]: 4 substeps of the coarsest run
ROUNDING = 1.1e-16  # largest relative error of a rounding
SEPARATRIX = 2 * W0  # rate [rad/s] at the lowest point that ends in the upright position


@dataclass(frozen=True)
class MotionScene(Scene):
    """A start, angle [rad] and rate [rad/s], and how long to follow it [s].

    `substep` [s] is that of the run that is judged; two coarser ones with twice and four times of it tell the
    truncation error. Near the separatrix it is finer: the change of energy per period, of relative size 20*h^5
    (modified equation of RK4), must stay small against the distance 1 - k^2 from the separatrix, at 4h as well.
    `order` says that the order of the method shows: the drift h^5*t^2 is far below the phase error h^4*t, as it is for
    few periods of moderate amplitude.
    """

    TITLE = "{0.title}"

    title: str
    stop: float
    phi0: float = 0.0
    rate0: float = 0.0
    substep: float = 0.005
    order: bool = False

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the error of the state and, where it shows, the order."""
        fine, coarse, coarser = (_simulate(fmu, self, n * self.substep) for n in (1, 2, 4))
        exact = references.motion(fine.t, self.phi0, self.rate0, W02)
        error = state_error(fine["phi"], fine["w"], exact)
        truncation = _truncation(fine, coarse, coarser)
        floor = _floor(self, exact, fine.t)
        yield Check(
            self.name,
            error,
            1.5 * truncation + floor,
            f"1.5 x (h^4 + h^5 error {truncation:.1e}) + round-off as it moves the exact motion {floor:.1e}",
            "rad",
        )
        if self.order:
            order = observed_order(state_error(coarse["phi"], coarse["w"], exact), error)
            yield Check(
                f"order of RK4, {self.name}",
                abs(order - 4),
                0.05,
                f"observed {order:.3f}; n*h*w0 = 0.08, at 10.5 the drift h^5*t^2 cancels h^4*t; changes it by 0.01",
            )
        if self.name in PICTURES:
            yield from _pictures(self, fine, exact)


@dataclass(frozen=True)
class JacobiScene(Scene):
    """SciPy's ellipj where it fails."""

    TITLE = "ellipj near the separatrix"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Show SciPy's ellipj wrong for m >= 1 - 1e-10, and the remedy right."""
        amplitude = radians(179.9999)
        m = float(np.sin(amplitude / 2) ** 2)
        T = references.period(amplitude, W02)
        t = np.linspace(0, T, 201)
        sn = ellipj(ellipk(m) - W0 * t, m)[0]
        textbook = 2 * np.arcsin(np.clip(np.sqrt(m) * sn, -1, 1))
        remedy = references.libration(t, amplitude, W02)[0]
        yield Check(
            "2*asin(k*sn) with SciPy's ellipj is wrong at 179.9999 deg",
            float(np.max(np.abs(textbook - remedy))),
            1.0,
            "for m >= 1 - 1e-10 ellipj uses a form for u < K that is not periodic: wrong by radians beyond",
            "rad",
            at_least=True,
        )
        yield Check(
            "the sums of DLMF 22.11 return to the start there",
            abs(float(remedy[-1]) - amplitude),
            4 * ulp(pi),
            "at the turning point the angle does not depend on the rounding of T; the arctangent and k rounds",
            "rad",
        )
        yield Plot(
            "Swing from 179.9999 deg",
            "t [s]",
            "phi [rad]",
            [
                Curve("exact", t.tolist(), remedy.tolist()),
                Curve("2*asin(k*sn) with SciPy's ellipj", t.tolist(), textbook.tolist(), "--"),
            ],
        )


def _libration(amplitude: float, periods: float, substep: float = 0.005, order: bool = False) -> MotionScene:
    angle = radians(amplitude)
    stop = STEP * round(periods * references.period(angle, W02) / STEP)
    return MotionScene(f"swing from {amplitude:.8g} deg", stop, phi0=angle, substep=substep, order=order)


SCENES = (
    *(_libration(amplitude, 5, order=True) for amplitude in (10, 30, -30)),
    *(_libration(amplitude, 5) for amplitude in (1, 60, 90, 120, 150)),
    *(_libration(amplitude, 5, 0.001) for amplitude in (170, 175, 179)),
    _libration(179.9, 3, 0.001),
    _libration(-179.9, 3, 0.001),
    *(_libration(amplitude, 2, 0.0005) for amplitude in (179.99, 179.999)),
    _libration(179.9999, 1, 0.00025),
    MotionScene("start at 1 rad with 2 rad/s", 12.0, 1.0, 2.0),
    MotionScene("start at 1 rad with -2 rad/s", 12.0, 1.0, -2.0),
    MotionScene("start at 100 rad with -3 rad/s", 12.0, 100.0, -3.0),
    MotionScene("rotation from 7 rad/s", 8.0, rate0=7.0),
    MotionScene("rotation from -7 rad/s", 8.0, rate0=-7.0),
    MotionScene("rotation from 1 rad, 8 rad/s", 8.0, 1.0, 8.0),
    MotionScene("rotation from 20 rad/s", 8.0, rate0=20.0),
    *(
        MotionScene(f"start at {factor:.7g} of the separatrix's rate", 6.0, 0.0, factor * SEPARATRIX, substep)
        for distance, substep in ((1e-3, 0.001), (1e-6, 0.0005))
        for factor in (1 + distance, 1 - distance, -1 - distance, -1 + distance)
    ),
    MotionScene("on the separatrix, up", 4.0, rate0=SEPARATRIX, substep=0.0005),
    MotionScene("on the separatrix, down", 4.0, rate0=-SEPARATRIX, substep=0.0005),
    *(
        MotionScene(f"rest at {name}", 6.0, phi0=angle, substep=0.0005)
        for name, angle in (
            ("pi - 1e-3 rad", pi - 1e-3),
            ("1e-3 rad - pi", 1e-3 - pi),
            ("pi + 1e-3 rad", pi + 1e-3),
            ("pi - 1e-5 rad", pi - 1e-5),
            ("pi + 1e-5 rad", pi + 1e-5),
        )
    ),
    JacobiScene(),
)


def _simulate(fmu: Fmu, scene: MotionScene, substep: float) -> Run:
    start = {"gamma": 0.0, "phi_start": scene.phi0, "solver.stepSize": substep}
    start |= {"w_start": scene.rate0} if scene.rate0 else {}
    return fmu.run(Experiment(scene.stop, STEP, start, record=("phi", "w")))


def _truncation(fine: Run, coarse: Run, coarser: Run) -> float:
    """Return the truncation error [rad] of the finest run, from three runs at h, 2h and 4h."""
    total = np.zeros_like(fine.t)
    for name, scale in (("phi", 1.0), ("w", W0)):
        phase, drift = phase_and_drift(fine[name], coarse[name], coarser[name])
        total += ((np.abs(phase) + np.abs(drift)) / scale) ** 2
    return float(np.sqrt(np.max(total)))


def _floor(scene: MotionScene, exact: references.State, t: NDArray[np.float64]) -> float:
    """Return the round-off [rad], four standard deviations of random walks, seen through the exact motion.

    The angle itself walks by half a unit in the last place a substep. As the start is left, the walk of one e-folding
    1/w0 adds to the start. The energy changes where the pendulum moves fast, for about 2/w0 at each passage of the
    lowest point: there each substep rounds the rate, and this moves the motion from the first passage on.
    """
    e_folding = 1 / (scene.substep * W0)  # substeps
    half_ulp = ulp(float(np.max(np.abs(exact[0])))) / 2
    start = scene.phi0 + 4 * half_ulp * sqrt(e_folding)
    floor = 4 * half_ulp * sqrt(scene.stop / scene.substep)
    floor += state_error(*references.motion(t, start, scene.rate0, W02), exact)
    lowest = np.flatnonzero(np.diff(np.sign(np.sin(exact[0] / 2))))
    if not lowest.size:
        return floor
    after = t[lowest[0] :] - t[lowest[0]]
    walk = 4 * ROUNDING * sqrt(2 * lowest.size * e_folding)
    rate = 2 * sqrt(W02 * (1 - references.complement(scene.phi0, scene.rate0, W02)))
    moved = references.motion(after, 0.0, rate * (1 + walk), W02)
    return floor + state_error(*moved, references.motion(after, 0.0, rate, W02))


PICTURES = ("swing from 179 deg", "rotation from 7 rad/s", "rest at pi - 1e-5 rad")


def _pictures(scene: MotionScene, run: Run, exact: references.State) -> Iterator[Result]:
    every = max(1, len(run.t) // 60)
    yield Plot(
        scene.name.capitalize(),
        "t [s]",
        "phi [rad]",
        [
            Curve("FMU, RK4", run.t[::every].tolist(), run["phi"][::every].tolist(), "", "."),
            Curve("exact", run.t.tolist(), exact[0].tolist()),
        ],
    )
