"""Explicit Runge-Kutta methods.

References: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", sections II.1 and II.7.
"""

from __future__ import annotations

from itertools import repeat

from .motion import Motion


def explicit_euler(motion: Motion, x: float, v: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit (forward) Euler method: order 1, 1 stage.

    Crawford, eq. (25). Not the semi-implicit (symplectic) Euler method: both states advance with the
    values at the beginning of the substep.
    """
    acceleration = motion.acceleration()
    for _ in repeat(None, n):
        a = acceleration(x, v)
        x += h * v
        v += h * a
    return x, v, n


def explicit_midpoint2(motion: Motion, x: float, v: float, h: float, n: int) -> tuple[float, float, int]:
    """Explicit midpoint method (modified Euler, "RK2"): order 2, 2 stages.

    Crawford, eqs. (29)-(31). Not Heun's method, which has the same stability function.
    """
    acceleration = motion.acceleration()
    half = h / 2
    for _ in repeat(None, n):
        a1 = acceleration(x, v)
        v2 = v + half * a1
        a2 = acceleration(x + half * v, v2)
        x += h * v2
        v += h * a2
    return x, v, 2 * n


def explicit_runge_kutta4(motion: Motion, x: float, v: float, h: float, n: int) -> tuple[float, float, int]:
    """Classical Runge-Kutta method ("RK4"): order 4, 4 stages.

    Crawford, eq. (32), with the stages of der(x) = v inserted into those of der(v), which saves a third of the
    arithmetic.
    """
    acceleration = motion.acceleration()
    half = h / 2
    sixth = h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in repeat(None, n):
        middle = x + half * v
        end = x + h * v
        a1 = acceleration(x, v)
        a2 = acceleration(middle, v + half * a1)
        a3 = acceleration(middle + half_half * a1, v + half * a2)
        a4 = acceleration(end + half_h * a2, v + h * a3)
        a23 = a2 + a3
        a123 = a1 + a23
        x = end + sixth_h * a123
        v += sixth * (a123 + a23 + a4)
    return x, v, 4 * n
