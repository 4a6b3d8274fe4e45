"""The fall of the nonlinear pendulum from rest through drag so strong that the motion is slow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .arrays import State


def overdamped_fall(t: ArrayLike, phi0: float, k2: float, w02: float) -> State:
    """Return phi [rad] and w [rad/s] at `t` [s], 0 or long after 1/k2, to a relative (w02/k2^2)^2.

    With e = w02/k2^2 the motion takes the slow path w = -w02/k2*sin(phi)*(1 + e*cos(phi)) after the time 1/k2, from
    phi0 + e*sin(phi0) on: the expansion of phi'' + k2*phi' + w02*sin(phi) = 0 in powers of e.

    Raises
    ------
    ValueError : `phi0` [rad] is not between 0 and pi
    """
    if not 0 < phi0 < np.pi:
        raise ValueError(f"phi0 = {phi0} rad (allowed: between 0 and pi; math.radians makes rad of degrees)")
    times = np.asarray(t, dtype=float)
    e = w02 / k2**2
    begin = phi0 + e * np.sin(phi0)
    phi = np.full_like(times, begin)
    for _ in range(5):  # the correction by e converges at once
        fall = w02 * times / k2 + e * np.log(np.sin(begin) / np.sin(phi))
        phi = 2 * np.arctan(np.tan(begin / 2) * np.exp(-fall))
    w = -w02 / k2 * np.sin(phi) * (1 + e * np.cos(phi))
    return np.where(times > 0, phi, phi0), np.where(times > 0, w, 0.0)
