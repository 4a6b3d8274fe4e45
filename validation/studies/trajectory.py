"""Angle and rate of undamped swings and rotations against Jacobi's elliptic functions, through the FMU with RK4."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from math import pi, radians, sqrt, ulp

import numpy as np
from scipy.special import ellipj, ellipk

from .. import references
from ..checks import Check, Curve, Plot, Result, formula
from ..fmu import W0, W02, Experiment, Fmu, Run, SolverMethod, swing
from ..metrics import ROUNDING, SIGMAS, Array, phase_and_drift, state_error
from ..references import discrete
from .scene import Scene

TITLE = "Trajectory against elliptic functions"
FORMULA = (
    "phi = 2*atan2(k*sn u, dn u), w = 2*k*w0*cn u, u = w0*t + u0, k^2 = sin(phi0/2)^2 + (w_start/(2*w0))^2; "
    "k > 1 rotates: DLMF 22.19(i)"
)

RK4 = SolverMethod.ExplicitRungeKutta4.name
STEP = 0.02  # communication step [s]: 4 substeps of the coarsest run
SEPARATRIX = 2 * W0  # rate [rad/s] at the lowest point that ends in the upright position


@dataclass(frozen=True)
class MotionScene(Scene):
    """A start, angle [rad] and rate [rad/s], and how long to follow it [s].

    What is judged is what RK4's discrete motion leaves unexplained, and what RK4's leading terms do. `substep` [s] is
    such that RK4's own error stands above rounding, and yet, near the separatrix, changes the energy by little against
    its distance from that of the separatrix.
    """

    TITLE = "{0.title}"

    title: str
    stop: float
    phi0: float = 0.0
    rate0: float = 0.0
    substep: float = 0.005

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the error of the state."""
        run = _simulate(fmu, self)
        exact = references.motion(run.t, self.phi0, self.rate0, W02)
        own = discrete_motion(self)
        rounding = _rounding(self, exact, run.t)
        yield Check(
            f"{self.name}: error beyond that of RK4",
            state_error(run["phi"], run["w"], own),
            2 * rounding,
            f"against RK4's discrete motion, {state_error(*own, exact):.2e} rad off the elliptic functions; round-off "
            "of both, as it moves the exact motion",
            "rad",
        )
        phi, w, neglected = leading_errors(self)
        leading = state_error(phi, w, (np.zeros_like(phi), np.zeros_like(w)))
        yield Check(
            f"{self.name}: against elliptic functions, beyond RK4's leading terms",
            state_error(run["phi"] - phi, run["w"] - w, exact),
            rounding + neglected * leading,
            f"h^4 and h^5 terms {leading:.2e} rad, next terms {neglected:.1e} of those; round-off as it moves the "
            "exact motion",
            "rad",
        )
        if self.name in PICTURES:
            yield from _pictures(self, run, exact)


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
        yield formula(
            "2*asin(k*sn) with SciPy's ellipj is wrong at 179.9999 deg",
            float(np.max(np.abs(textbook - remedy))),
            1.0,
            "for m >= 1 - 1e-10 ellipj uses a form for u < K that is not periodic: wrong by radians beyond",
            "rad",
            at_least=True,
        )
        yield formula(
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
            note="For m >= 1 - 1e-10 SciPy's ellipj is right for |u| <= K only, here for the first half of the "
            "period, and then stays at the turning point; the sums of DLMF 22.11 return to the start.",
        )


def _libration(amplitude: float, periods: float, substep: float = 0.005) -> MotionScene:
    angle = radians(amplitude)
    stop = STEP * round(periods * references.period(angle, W02) / STEP)
    return MotionScene(f"swing from {amplitude:.8g} deg", stop, phi0=angle, substep=substep)


SCENES = (
    *(_libration(amplitude, 5) for amplitude in (1, 10, 30, -30, 60, 90, 120, 150)),
    *(_libration(amplitude, 5, 0.001) for amplitude in (170, 175, 179)),
    _libration(179.9, 3, 0.001),
    _libration(-179.9, 3, 0.001),
    *(_libration(amplitude, 2, 0.001) for amplitude in (179.99, 179.999)),
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
        MotionScene(f"rest at {name}", 6.0, phi0=angle)
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


def _simulate(fmu: Fmu, scene: MotionScene) -> Run:
    start = swing(scene.phi0, scene.substep) | ({"w_start": scene.rate0} if scene.rate0 else {})
    return fmu.run(Experiment(scene.stop, STEP, start, record=("phi", "w")))


@cache
def discrete_motion(scene: MotionScene, n: int = 1) -> references.State:
    """Return phi [rad] and w [rad/s] of RK4's discrete motion, substeps n times as long, at communication points."""
    t = Experiment(scene.stop, STEP).times()
    return discrete.motion(RK4, t, scene.phi0, scene.rate0, 0.0, W02, n * scene.substep)


@cache
def leading_errors(scene: MotionScene) -> tuple[Array, Array, float]:
    """Return the h^4 and h^5 errors of phi [rad] and w [rad/s], and the next terms relative to them.

    From the discrete motion with h, 2h and 4h. The next terms are (4*h*rate)^2, and what the change of the energy at 4h
    does near the upright position: at a distance d [rad] from it an energy w02*d^2/2 separates swing and rotation.
    """
    runs = [discrete_motion(scene, n) for n in (1, 2, 4)]
    phi, w = (sum(phase_and_drift(*column)) for column in zip(*runs, strict=True))
    t = np.array(Experiment(scene.stop, STEP).times())
    exact = references.motion(t, scene.phi0, scene.rate0, W02)
    fastest = float(np.hypot(W0, np.max(np.abs(exact[1]))))
    energy = runs[2][1] ** 2 / 2 + 2 * W02 * np.sin(runs[2][0] / 2) ** 2
    distance = np.hypot(np.remainder(exact[0], 2 * pi) - pi, exact[1] / W0)
    nearest = np.minimum.accumulate(distance[::-1])[::-1]  # from now on
    moved = float(np.max(np.abs(energy - energy[0]) / (W02 * nearest**2 / 2)))
    return phi, w, (4 * scene.substep * fastest) ** 2 + moved


def _rounding(scene: MotionScene, exact: references.State, t: Array) -> float:
    """Return the round-off [rad], random walks of roundings seen through the exact motion.

    The angle itself walks with each substep. As the start is left, the walk of one e-folding 1/w0 adds to the start.
    The energy changes where the pendulum moves fast, for about 2/w0 at each passage of the lowest point: there each
    substep rounds the rate, and this moves the motion from the first passage on.
    """
    e_folding = 1 / (scene.substep * W0)  # substeps
    step = SIGMAS * ulp(float(np.max(np.abs(exact[0])))) / sqrt(12)  # of the walk of the angle
    start = scene.phi0 + step * sqrt(e_folding)
    moved = step * sqrt(scene.stop / scene.substep)
    moved += state_error(*references.motion(t, start, scene.rate0, W02), exact)
    lowest = np.flatnonzero(np.diff(np.sign(np.sin(exact[0] / 2))))
    if not lowest.size:
        return moved
    after = t[lowest[0] :] - t[lowest[0]]
    walk = SIGMAS * ROUNDING * sqrt(2 * lowest.size * e_folding)
    rate = 2 * sqrt(W02 * (1 - references.complement(scene.phi0, scene.rate0, W02)))
    faster = references.motion(after, 0.0, rate * (1 + walk), W02)
    return moved + state_error(*faster, references.motion(after, 0.0, rate, W02))


PICTURES = ("swing from 179 deg", "rotation from 7 rad/s", "rest at pi - 1e-5 rad")


def _pictures(scene: MotionScene, run: Run, exact: references.State) -> Iterator[Result]:
    every = max(1, len(run.t) // 60)
    own = discrete_motion(scene)
    yield Plot(
        scene.name.capitalize(),
        "t [s]",
        "phi [rad]",
        [Curve("FMU, RK4", run.t[::every], run["phi"][::every], "", "."), Curve("exact", run.t, exact[0])],
        note=f"RK4 with h = {1e3 * scene.substep:g} ms: the points of the FMU lie on the exact line. Below: the "
        "distance of the states, and RK4's own error by its discrete motion. Where the lines are one, nothing else is "
        "wrong.",
        below=[
            Curve(
                "FMU less exact",
                run.t[1:],
                np.hypot(run["phi"] - exact[0], (run["w"] - exact[1]) / W0)[1:],
            ),
            Curve(
                "RK4's discrete motion less exact",
                run.t[1:],
                np.hypot(own[0] - exact[0], (own[1] - exact[1]) / W0)[1:],
                "--",
            ),
        ],
        below_label="error [rad]",
        below_logarithmic="y",
    )
