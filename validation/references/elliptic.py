"""The undamped pendulum: its period by the complete elliptic integral, its motion by Jacobi's elliptic functions."""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import atan2, ceil, copysign, cos, log, log1p, pi, sin, sqrt, tan

import numpy as np
from numpy.typing import ArrayLike

# Not its functions: a lone ufunc says not where it is from, and who pickles this code would ask all modules.
from scipy import special

from .arrays import Array, State

# Period of the undamped pendulum


def agm(a: float, b: float) -> float:
    """Return the arithmetic-geometric mean of two positive numbers; [C] (20), [DLMF] 19.8.1."""
    while abs(a - b) > 4e-16 * a:
        a, b = (a + b) / 2, sqrt(a * b)
    return (a + b) / 2


def period(amplitude: float, w02: float) -> float:
    """Return the period [s] of undamped swings, T = 2*pi/(w0*AGM(1, cos(amplitude/2))).

    [C] (14) and (20), with AGM(1 + k, 1 - k) = AGM(1, k'), which does not cancel near the upright position.

    Raises
    ------
    ValueError : the `amplitude` [rad] is not one of a swing
    """
    _require_swing(amplitude)
    return 2 * pi / (sqrt(w02) * agm(1.0, cos(amplitude / 2)))


def _require_swing(amplitude: float) -> None:
    if not abs(amplitude) <= pi + 1e-9:  # turns that were taken off leave their rounding
        raise ValueError(
            f"amplitude = {amplitude} rad (allowed: -pi to pi; math.radians makes rad of degrees)"
        )


def period_by_ellipkm1(amplitude: float, w02: float) -> float:
    """Return the same period from SciPy's K of the complementary parameter, T = 4*K/w0; [C] (14)."""
    return float(4 * special.ellipkm1(cos(amplitude / 2) ** 2) / sqrt(w02))


def period_by_ellipk(amplitude: float, w02: float) -> float:
    """Return the same period from ellipk(sin^2): the obvious formula, wrong by 3e-6 near the upright position."""
    return float(4 * special.ellipk(sin(amplitude / 2) ** 2) / sqrt(w02))


def complete_by_agm(k: float) -> float:
    """Return K(k) = pi/(2*AGM(1 + k, 1 - k)) as [C] (20) has it; 1 - k loses digits as k approaches 1."""
    return pi / (2 * agm(1 + k, 1 - k))


def incomplete_by_descent(angle: float, k: float, steps: int | None = None) -> float:
    """Return F(angle, k) for 0 <= angle <= pi/2, k < 1 by Gauss's descending transformation; [C] (18)-(19), corrected.

    F(angle, k) = (1 + k1)*F(angle1, k1) with k1 = (k/(1 + k'))^2 and

        sin(angle1) = (1 + k')*sin(angle)/(1 + sqrt(1 - k^2*sin(angle)^2)),

    where the root covers the sine. k falls to zero quadratically, and F(angle, 0) = angle. The cosine of angle1 is
    carried along in a form of positive terms, because the arcsine loses half of the digits near pi/2. `steps` cuts the
    descent short; by default it ends when k^2 no longer matters.
    """
    s, c, k1, factor = sin(angle), cos(angle), sqrt((1 - k) * (1 + k)), 1.0
    while k * k > 1e-17 if steps is None else steps > 0:
        delta = sqrt(c * c + (k1 * s) ** 2)
        c *= sqrt(2 + 2 * (1 + (k1 * s) ** 2) / (delta + k1 * s * s)) / (1 + delta)
        s *= (1 + k1) / (1 + delta)
        k, k1 = (k / (1 + k1)) ** 2, 2 * sqrt(k1) / (1 + k1)
        factor *= 1 + k
        steps = None if steps is None else steps - 1
    return factor * atan2(s, c)


def series_terms(amplitude: float, count: int) -> Array:
    """Return the first `count` terms ((2n-1)!!/(2n)!!)^2*k^(2n), n >= 0, of the bracket of [C] (17)."""
    n = np.arange(1, count)
    ratios = ((2 * n - 1) / (2 * n)) ** 2 * sin(amplitude / 2) ** 2
    return np.asarray(np.concatenate(([1.0], np.cumprod(ratios))))


def period_by_series(amplitude: float, w02: float, count: int) -> float:
    """Return the period [s] from `count` terms of [C] (17)."""
    return 2 * pi / sqrt(w02) * float(np.sum(series_terms(amplitude, count)[::-1]))


def series_length(amplitude: float, tolerance: float) -> int:
    """Return how many terms of [C] (17) bring the relative error of the period to `tolerance` or below.

    The error is the sum of the terms left out, formed from the smallest up, so that it keeps its digits.
    """
    log_m = log1p(-(cos(amplitude / 2) ** 2))
    count = ceil(log(1e-6 * tolerance * -log_m) / log_m)  # what lies beyond is a millionth of the tolerance
    terms = series_terms(amplitude, count + 1)
    error = np.cumsum(terms[::-1])[::-1] / np.sum(terms[::-1])  # error[N] is that of N terms
    return int(np.argmax(error <= tolerance))


def period_slope(amplitude: float, w02: float) -> float:
    """Return dT/d(amplitude) [s/rad] = (2/w0)*dK/dk*k', the conditioning of the period; [DLMF] 19.4.1."""
    k, k1 = sin(amplitude / 2), cos(amplitude / 2)
    K, E = float(special.ellipkm1(k1 * k1)), float(special.ellipe(k * k))
    return 2 / sqrt(w02) * k1 * (E - k1 * k1 * K) / (k * k1 * k1)


# Motion of the undamped pendulum


def jacobi(u: ArrayLike, m1: float) -> tuple[Array, Array, Array]:
    """Return sn, cn, dn of `u` for the complementary parameter m1 = 1 - m, 0 < m1 <= 1.

    SciPy's ellipj for m <= 1/2; beyond it the sums of [DLMF] 22.11-22.12 over hyperbolic functions, because ellipj
    fails for m >= 1 - 1e-10.
    """
    u = np.asarray(u, dtype=float)
    if m1 >= 0.5:
        sn, cn, dn = (np.asarray(x, dtype=float) for x in special.ellipj(u, 1 - m1)[:3])
        return sn, cn, dn
    k = sqrt(1 - m1)
    K, K1 = float(special.ellipkm1(m1)), float(special.ellipk(m1))
    c = pi / (2 * K1)
    u = u - 4 * K * np.round(u / (4 * K))
    sn, cn, dn = np.tanh(c * u), 1 / np.cosh(c * u), 1 / np.cosh(c * u)
    for n in range(1, 15):  # exp(-2*c*K*14) < 1e-19 for every m >= 1/2
        sign = (-1) ** n
        minus, plus = c * (u - 2 * n * K), c * (u + 2 * n * K)
        sech = _sech(minus) + _sech(plus)
        sn += sign * (np.tanh(minus) + np.tanh(plus))
        cn += sign * sech
        dn += sech
    return np.asarray(c / k * sn), np.asarray(c / k * cn), np.asarray(c * dn)


def _sech(x: Array) -> Array:
    return np.asarray(2 * np.exp(-np.abs(x)) / (1 + np.exp(-2 * np.abs(x))))


def libration(t: ArrayLike, amplitude: float, w02: float) -> State:
    """Return phi [rad] and w [rad/s] at `t` [s] of undamped swings released at rest from `amplitude` [rad].

    phi = 2*atan2(k*cn, k'), w = -2*k*k'*w0*sn/dn at u = w0*t: no arcsine, so no loss of digits at the turning points.

    Raises
    ------
    ValueError : the `amplitude` is not one of a swing
    """
    _require_swing(amplitude)
    k, k1, w0 = sin(amplitude / 2), cos(amplitude / 2), sqrt(w02)
    if k == 0:
        return np.zeros_like(t, dtype=float), np.zeros_like(t, dtype=float)
    sn, cn, dn = jacobi(w0 * np.asarray(t, dtype=float), k1 * k1)
    return 2 * np.arctan2(k * cn, k1), -2 * k * k1 * w0 * sn / dn


def motion(t: ArrayLike, phi0: float, rate0: float, w02: float) -> State:
    """Return phi [rad] and w [rad/s] at `t` [s] of the undamped pendulum from any initial state; [DLMF] 22.19(i).

    Swings for m < 1, the separatrix for m = 1, rotation over the top for m > 1, where
    m = sin(phi0/2)^2 + (rate0/(2*w0))^2 is the energy in units of that of the upright position.
    """
    turns = round(phi0 / (2 * pi))
    start = phi0 - 2 * pi * turns
    phi, w = _motion_from_first_turn(np.asarray(t, dtype=float), start, rate0, w02)
    return phi + 2 * pi * turns, w


def _motion_from_first_turn(t: Array, start: float, rate0: float, w02: float) -> State:
    if rate0 == 0:
        return libration(t, start, w02)
    w0, sign = sqrt(w02), copysign(1.0, rate0)
    b = rate0 / (2 * w0)
    k = sqrt(sin(start / 2) ** 2 + b * b)
    m1 = complement(start, rate0, w02)
    if m1 > 0:
        u0 = incomplete(atan2(sin(start / 2), b), m1)
        sn, cn, dn = jacobi(w0 * t + u0, m1)
        return 2 * np.arctan2(k * sn, dn), 2 * k * w0 * cn
    if m1 == 0:
        u = w0 * t + sign * float(np.arcsinh(tan(start / 2)))
        return 2 * sign * np.arctan(np.sinh(u)), 2 * w0 * sign / np.cosh(u)
    reciprocal_m1 = -m1 / k**2  # 1 - 1/m
    u = k * w0 * t + sign * incomplete(start / 2, reciprocal_m1)
    K = float(special.ellipkm1(reciprocal_m1))
    half_turns = np.round(u / (2 * K))
    sn, cn, dn = jacobi(u - 2 * K * half_turns, reciprocal_m1)
    return 2 * sign * (np.arctan2(sn, cn) + pi * half_turns), 2 * k * w0 * sign * dn


def complement(phi0: float, rate0: float, w02: float) -> float:
    """Return 1 - m = cos(phi0/2)^2 - rate0^2/(4*w02), the distance from the separatrix.

    The difference is formed in 50 digits from the doubles given: doubles lose all its digits near the separatrix.
    """
    with localcontext() as context:
        context.prec = 50
        x = Decimal(phi0)
        term = total = Decimal(1)
        n = 0
        while abs(term) > Decimal(10) ** -48:
            n += 2
            term *= -x * x / (n * (n - 1))
            total += term
        return float((1 + total) / 2 - Decimal(rate0) ** 2 / (4 * Decimal(w02)))


def incomplete(angle: float, m1: float) -> float:
    """Return F(angle | 1 - m1), m1 = k'^2, for |angle| <= pi by Carlson's R_F; [DLMF] 19.25.5."""
    if abs(angle) > pi / 2:
        return copysign(2 * float(special.ellipkm1(m1)), angle) - incomplete(copysign(pi, angle) - angle, m1)
    s, c = sin(angle), cos(angle)
    return float(s * special.elliprf(c * c, c * c + m1 * s * s, 1.0))
