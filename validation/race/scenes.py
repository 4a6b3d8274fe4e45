"""The motions that are raced over, as a table, and their exact answers on the grid that all solvers return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import exp, pi, radians
from typing import NamedTuple

import numpy as np

from .. import references
from ..fmu import W02, Experiment
from ..metrics import SMALL
from ..references import Array, taylor

DECADES = tuple(10.0**-k for k in range(2, 13))
COARSE = (1e-3, 1e-6, 1e-9, 1e-12)  # the errors of the table "which method for which task"


class Gaussian(NamedTuple):
    """The drive peak*exp(-(t - center)^2/(2*variance)): [1/s2], [s], [s2]."""

    peak: float
    center: float
    variance: float

    def __call__(self, t: float) -> float:
        """Return the drive [1/s2] at the time `t` [s]."""
        return self.peak * exp(-((t - self.center) ** 2) / (2 * self.variance))

    def polynomials(self, h: float, n: int) -> Array:
        """Return cubics that fit the drive in the middle of each of `n` steps of `h` [s], a row each.

        They are given by the drive and its first three derivatives at the beginning of the step.
        """
        s = -h / 2
        x = (np.arange(n) * h - s - self.center) / self.variance
        d0 = self.peak * np.exp(-(x**2) * self.variance / 2)
        d1, d2, d3 = -x * d0, (x * x - 1 / self.variance) * d0, (3 / self.variance - x * x) * x * d0
        columns = d0 + s * (d1 + s * (d2 / 2 + s * d3 / 6)), d1 + s * (d2 + s * d3 / 2), d2 + s * d3, d3
        return np.ascontiguousarray(np.transpose(columns))


@dataclass(frozen=True)
class Scene:
    """A motion of the default pendulum, m = L = 1, with another drag and other start values.

    Attributes
    ----------
    stop : end [s]
    points : communication steps of equal length; their ends are the grid on which all solvers give phi and w
    phi0, rate0 : initial angle [rad] and rate [rad/s]
    k2 : damping rate [1/s]
    drive : the FMU gets it sampled in the middle of each substep, and held
    held : drive [1/s2] in each communication step, at whose ends it jumps; () for none
    reference : where the exact answer comes from, a key of REFERENCES
    scale : what errors are relative to [rad]
    targets : errors at which the solvers are compared; the reference is good to a tenth of the least
    task : what the table "which method for which task" calls it, "" for a scene that it leaves out
    leads : whether its picture leads the report, for which the slow are raced, too
    loosest : tolerance with which rivals begin
    """

    name: str
    stop: float
    points: int
    phi0: float
    rate0: float = 0.0
    k2: float = 0.0
    drive: Gaussian | None = None
    held: tuple[float, ...] = ()
    reference: str = "Taylor series"
    scale: float = 1.0
    targets: tuple[float, ...] = DECADES
    task: str = ""
    leads: bool = False
    loosest: float = 1e-2

    @property
    def step(self) -> float:
        """Communication step [s]."""
        return self.stop / self.points

    @property
    def grid(self) -> list[float]:
        """Times [s] of the answers, 0 included."""
        return Experiment(self.stop, self.step).times()

    @property
    def conserves(self) -> bool:
        """Whether the energy stays."""
        return not (self.k2 or self.drive or self.held)

    @property
    def pieces(self) -> list[tuple[float, list[float]]]:
        """What is smooth in itself, between two jumps: the held drive [1/s2], and the grid from end to end [s]."""
        times = self.grid
        return list(zip(self.held, map(list, pairwise(times)), strict=True)) if self.held else [(0.0, times)]

    @property
    def start(self) -> Mapping[str, float]:
        """Start values of the FMU."""
        return {"gamma": self.k2, "phi_start": self.phi0, "w_start": self.rate0}


def _by_taylor(scene: Scene) -> references.State:
    return taylor.motion(scene.grid, scene.phi0, scene.rate0, scene.k2, W02, scene.held or 0.0)


def _by_elliptic_functions(scene: Scene) -> references.State:
    return references.motion(scene.grid, scene.phi0, scene.rate0, W02)


def _free(scene: Scene) -> references.State:
    return references.free_evolution(np.array(scene.grid), scene.phi0, scene.rate0, scene.k2, W02)


def _by_faddeeva(scene: Scene) -> references.State:
    assert scene.drive is not None
    return references.gaussian_response(scene.grid, *scene.drive, k2=scene.k2, w02=W02, start=0.0)


def _overdamped(scene: Scene) -> references.State:
    return references.overdamped_fall(scene.grid, scene.phi0, scene.k2, W02)


REFERENCES = {
    "Taylor series": _by_taylor,
    "elliptic functions": _by_elliptic_functions,
    "free linear motion": _free,
    "Faddeeva function": _by_faddeeva,
    "slow manifold": _overdamped,
}


@cache
def exact(scene: Scene) -> tuple[Array, Array]:
    """Return phi [rad] and w [rad/s] on the grid of the scene."""
    return REFERENCES[scene.reference](scene)


AMPLITUDES = (30.0, 90.0, 170.0, 179.9)  # of the undamped swings [deg]
UNDAMPED = tuple(
    Scene(
        f"undamped {angle:g} deg, 20 s",
        20.0,
        20,
        radians(angle),
        task="no drag" if angle == 90 else "",
        leads=angle == 90,
    )
    for angle in AMPLITUDES
)
ROTATION = Scene(
    "rotation, 8 rad/s at the bottom, 20 s", 20.0, 20, 0.0, rate0=8.0, reference="elliptic functions"
)
DAMPED = Scene("damped 170 deg, k2 = 0.5/s, 10 s", 10.0, 10, radians(170), k2=0.5, task="weak drag")
GAUSSIAN = Gaussian(SMALL * W02, 4.0, 0.09)
PULSE = Scene(
    "Gaussian pulse through tau, k2 = 0.5/s, 8 s",
    8.0,
    8,
    0.0,
    k2=0.5,
    drive=GAUSSIAN,
    reference="Faddeeva function",
    scale=SMALL,
    targets=COARSE,
)
STIFF = Scene("stiff, k2 = 1e3/s, 90 deg, 10 s", 10.0, 10, pi / 2, k2=1e3, targets=COARSE, task="strong drag")
EXTREME = Scene(
    "stiff, k2 = 1e6/s, 90 deg, 1e5 s",
    1e5,
    10,
    pi / 2,
    k2=1e6,
    reference="slow manifold",
    targets=COARSE[:3],
    task="extreme drag",
)
LONG = Scene(
    "undamped 30 deg, 1000 periods",
    1000 * references.period(radians(30), W02),
    100,
    radians(30),
    reference="elliptic functions",
    targets=COARSE[:2],
    loosest=1e-7,
)
TRAIN = Scene(
    "torque that jumps every 0.5 s, k2 = 0.5/s, 10 s",
    10.0,
    20,
    0.0,
    k2=0.5,
    held=tuple(float(7 * n * n % 11 - 5) for n in range(20)),  # -5 to 5 in no order
    targets=COARSE,
    task="jumps",
)
# Errors grow 1e5-fold to the end: rounding alone becomes 1e-10.
CHAOS = Scene(
    "chaos under +-12 N.m, 1.5 s each, k2 = 1/s, 24 s",
    24.0,
    16,
    0.2,
    k2=1.0,
    held=(12.0, -12.0) * 8,
    targets=COARSE[:2],
    task="chaos",
    loosest=1e-6,
)
OFTEN = Scene(
    "undamped 90 deg, 2 s, answers every 1 ms",
    2.0,
    2000,
    radians(90),
    reference="elliptic functions",
    targets=COARSE[:3],
    task="every 1 ms",
)
SCENES = (*UNDAMPED, ROTATION, DAMPED, PULSE, TRAIN, CHAOS, OFTEN, STIFF, EXTREME, LONG)
