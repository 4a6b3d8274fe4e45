"""Errors, orders and periods of recorded runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import floor, log2, log10, nan, sqrt
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import references
from .fmu import W0, W02

# Conventions: numbers that no theory gives, the same for all studies.
SAFETY = 1.5  # times a leading term whose next one is not computed
NEXT = 2.0  # coefficient of a next term of which only the power is known
SIGMAS = 4.0  # standard deviations that a random walk of roundings is given
ORDER = 0.1  # deviation of an observed order from that in theory
# Amplitude [rad] of linear motion: the nonlinearity, a relative SMALL^2*w0*T/16, is below rounding.
SMALL = 1e-9

UNIT = 2.0**-53  # the largest relative rounding
ROUNDING = UNIT / sqrt(3)  # standard deviation of a relative rounding

Array = NDArray[np.float64]
Quantity = TypeVar("Quantity", float, Array)


def walk(steps: float) -> float:
    """Return what that many relative roundings add up to, at random."""
    return SIGMAS * ROUNDING * sqrt(steps)


def free_rounding(time: float, substep: float, w0: float = W0) -> float:
    """Return the round-off of a free motion relative to its size: of the state, and of the phase w0*time itself.

    The substep rounds the same way each time, and so does the argument of the exact sine.
    """
    return walk(time / substep) + 2 * UNIT * w0 * time


def linear_rounding(state: references.State, drive: ArrayLike, H: float, k2: float) -> float:
    """Return the round-off of phi in the reference of a driven linear motion, `state` at n*H, steps of `H` [s].

    The state walks. And the increments round the same way each time, twenty times at most: four times in the
    arithmetic, and with the coefficients of the step, which come of four products, and six squarings with two each.
    """
    size = float(np.max(np.hypot(state[0], state[1] / W0)))
    systematic = 20 * UNIT * references.response_rounding(state, drive, H, k2, W02)
    return walk(len(state[0])) * size + systematic


def state_error(phi: Array, w: Array, exact: tuple[Array, Array], w0: float = W0) -> float:
    """Return the largest distance [rad] between states (phi, w/w0)."""
    return float(np.max(np.hypot(phi - exact[0], (w - exact[1]) / w0)))


def growth(own: tuple[Array, Array], near: tuple[Array, Array], w0: float = 1.0) -> Array:
    """Return by how much an error of any earlier time has grown at most, at each time of two neighbouring motions.

    The ratio of their distance to the least one before; distances of states (phi, w/w0), so that none is 0.
    """
    distance = np.hypot(near[0] - own[0], (near[1] - own[1]) / w0)
    return np.asarray(distance / np.minimum.accumulate(distance))


def largest(values: Iterable[float]) -> float:
    """Return the largest of `values`, and NaN if one is NaN, which Python's max() can lose."""
    return float(np.max(np.fromiter(values, dtype=float)))


def six_digits(value: float) -> float:
    """Return the largest relative rounding of a positive `value` that is written with six digits."""
    return 0.5 * 10.0 ** (floor(log10(value)) - 5) / value


def observed_order(coarse: float, fine: float) -> float:
    """Return the order that the errors at h and h/2 show."""
    return log2(coarse / fine)


def phase_and_drift(fine: Quantity, coarse: Quantity, coarser: Quantity) -> tuple[Quantity, Quantity]:
    """Return the two truncation errors of RK4 in `fine`, from the same quantity at the substeps h, 2h and 4h.

    The phase error grows like h^4, and the energy drifts like h^5: coarse - fine = 15*phase + 31*drift, and
    coarser - coarse is 16 times the former and 32 times the latter.
    """
    near, far = coarse - fine, coarser - coarse
    return (32 * near - far) / (16 * 15), (far - 16 * near) / (16 * 31)


def upward_crossings(t: Array, phi: Array, w: Array, a: Array) -> list[float]:
    """Return the times [s] at which phi passes zero upwards, by quintic Hermite interpolation.

    The interpolant uses angle, rate and acceleration at both ends of a step H; its crossing time is in error by
    O(H^6), and by O(H^7) without damping, where the acceleration vanishes with the angle.
    """
    return [
        float(
            t[i]
            + (t[i + 1] - t[i]) * _root(_quintic(t[i + 1] - t[i], phi[i : i + 2], w[i : i + 2], a[i : i + 2]))
        )
        for i in np.flatnonzero((phi[:-1] < 0) & (phi[1:] >= 0))
    ]


def upward_crossing(run: Mapping[str, Array], t: Array, n: int = 0) -> float:
    """Return the time [s] of the n-th crossing (from 0, or from the last as -1), NaN if there is none."""
    crossings = upward_crossings(t, run["phi"], run["w"], run["a"])
    return crossings[n] if -len(crossings) <= n < len(crossings) else nan


def _quintic(H: float, phi: Array, w: Array, a: Array) -> Sequence[float]:
    """Return the coefficients, in powers of s = (t - t0)/H, of the interpolant of both ends."""
    p0, p1 = float(phi[0]), float(phi[1])
    v0, v1 = H * float(w[0]), H * float(w[1])
    b0, b1 = H * H * float(a[0]), H * H * float(a[1])
    rise = p1 - p0 - v0 - b0 / 2
    slope = v1 - v0 - b0
    bend = b1 - b0
    return (
        p0,
        v0,
        b0 / 2,
        10 * rise - 4 * slope + bend / 2,
        -15 * rise + 7 * slope - bend,
        6 * rise - 3 * slope + bend / 2,
    )


def _root(coefficients: Sequence[float]) -> float:
    """Return the zero in [0, 1] of a polynomial that rises there from below zero."""
    low, high, s = 0.0, 1.0, 0.5
    for _ in range(60):
        value = slope = 0.0
        for coefficient in reversed(coefficients):
            slope = slope * s + value
            value = value * s + coefficient
        if value < 0:
            low = s
        else:
            high = s
        new = s - value / slope if slope > 0 else s
        if not low < new < high:
            new = 0.5 * (low + high)
        if new == s:
            break
        s = new
    return s
