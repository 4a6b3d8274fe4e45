"""Explicit Runge-Kutta methods.

References: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sections II.1 and II.7.
"""

from __future__ import annotations

from itertools import repeat

from .motion import Motion


def explicit_euler(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit (forward) Euler method: order 1, 1 stage.

    Crawford, eq. (25). Not the semi-implicit (symplectic) Euler method: both states advance with the
    values at the beginning of the substep.
    """
    acceleration = motion.acceleration()
    for _ in repeat(None, n):
        a = acceleration(phi, w)
        phi += h * w
        w += h * a
    return phi, w, n


def explicit_midpoint2(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit midpoint method (modified Euler, "RK2"): order 2, 2 stages.

    Crawford, eqs. (29)-(31). Not Heun's method, which has the same stability function.
    """
    acceleration = motion.acceleration()
    half = h / 2
    for _ in repeat(None, n):
        a1 = acceleration(phi, w)
        w2 = w + half * a1
        a2 = acceleration(phi + half * w, w2)
        phi += h * w2
        w += h * a2
    return phi, w, 2 * n


def explicit_runge_kutta4(motion: Motion, phi: float, w: float, h: float, n: int) -> tuple[float, float, int]:
    """Classical Runge-Kutta method ("RK4"): order 4, 4 stages.

    Crawford, eq. (32), with the stages of der(phi) = w inserted into those of der(w), which saves a third of the
    arithmetic.
    """
    acceleration = motion.acceleration()
    half = h / 2
    sixth = h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in repeat(None, n):
        middle = phi + half * w
        end = phi + h * w
        a1 = acceleration(phi, w)
        a2 = acceleration(middle, w + half * a1)
        a3 = acceleration(middle + half_half * a1, w + half * a2)
        a4 = acceleration(end + half_h * a2, w + h * a3)
        a23 = a2 + a3
        a123 = a1 + a23
        phi = end + sixth_h * a123
        w += sixth * (a123 + a23 + a4)
    return phi, w, 4 * n
