"""Each method for one pendulum alone, written by hand: the loops that the FMUs are raced against.

A loop advances the angle `phi` [rad] and its rate `w` [rad/s] under a held drive [1/s2] by `n` substeps of `h` [s] and
returns the angle. Those in C are in loop.c. All but the Taylor series give the bits of the FMU.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from math import cos, sin, sqrt
from operator import mul
from pathlib import Path

from .race.compiler import shared_library

Loop = Callable[[float, float, float, float, float, float, int], float]

SOURCE = Path(__file__).resolve().parent / "loop.c"
ORDER = 16  # of the Taylor series


def explicit_euler(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after explicit Euler steps."""
    drag, gravity = -damping_rate, -w02
    for _ in range(n):
        a = drive + drag * w + gravity * sin(phi)
        phi += h * w
        w += h * a
    return phi


def explicit_midpoint2(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after steps of the explicit midpoint method."""
    drag, gravity = -damping_rate, -w02
    half = h / 2
    for _ in range(n):
        a1 = drive + drag * w + gravity * sin(phi)
        w2 = w + half * a1
        a2 = drive + drag * w2 + gravity * sin(phi + half * w)
        phi += h * w2
        w += h * a2
    return phi


def explicit_runge_kutta4(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after RK4 steps, without a call in them but the sine."""
    drag, gravity = -damping_rate, -w02
    half, sixth = h / 2, h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in range(n):
        middle = phi + half * w
        end = phi + h * w
        a1 = drive + drag * w + gravity * sin(phi)
        a2 = drive + drag * (w + half * a1) + gravity * sin(middle)
        a3 = drive + drag * (w + half * a2) + gravity * sin(middle + half_half * a1)
        a4 = drive + drag * (w + h * a3) + gravity * sin(end + half_h * a2)
        a23 = a2 + a3
        a123 = a1 + a23
        phi = end + sixth_h * a123
        w += sixth * (a123 + a23 + a4)
    return phi


def kepler(s: float, c: float) -> float:
    """Return the root x of x + s*sin(x) = c, 0 <= s < 1, by Newton's method from x = c."""
    x = c
    while True:
        before, slope = x, 1 + s * cos(x)
        correction = ((x - c) + s * sin(x)) / slope
        x -= correction
        # What is left is a quarter of an ulp or less.
        if s * correction * correction <= 2**-54 * slope * abs(x) or x == before:
            return x


def implicit_euler(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after implicit Euler steps."""
    denominator = 1 + h * damping_rate
    kick, push = h * w02 / denominator, h * drive
    s = h * kick
    for _ in range(n):
        v = (w + push) / denominator
        phi = kepler(s, phi + h * v)
        w = v - kick * sin(phi)
    return phi


def implicit_trapezoid(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after steps of the trapezoidal rule; the half step at the end is the first of the next step."""
    b = h / 2
    denominator = 1 + b * damping_rate
    kick, push = b * w02 / denominator, b * drive
    s = b * kick
    change = b * (drive - damping_rate * w - w02 * sin(phi))
    for _ in range(n):
        middle = w + change
        v = (middle + push) / denominator
        phi = kepler(s, phi + b * w + b * v)
        w = v - kick * sin(phi)
        change = w - middle
    return phi


def tr_bdf2(drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int) -> float:
    """Return the angle after steps of the trapezoidal rule to (2 - sqrt(2))*h and Gear's formula to h."""
    diagonal, weight = 1 / (2 + sqrt(2)), sqrt(2) / 4
    b, weight_h, kicks = h * diagonal, h * weight, weight / diagonal
    denominator = 1 + b * damping_rate
    kick, push = b * w02 / denominator, b * drive
    s = b * kick
    kick0 = b * (drive - damping_rate * w - w02 * sin(phi))
    for _ in range(n):
        middle = w + kick0
        v = (middle + push) / denominator
        w1 = v - kick * sin(kepler(s, phi + b * w + b * v))
        known = w + kicks * kick0 + kicks * (w1 - middle)
        v = (known + push) / denominator
        phi = kepler(s, phi + weight_h * w + weight_h * w1 + b * v)
        w = v - kick * sin(phi)
        kick0 = w - known
    return phi


def sdirk4(drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int) -> float:
    """Return the angle after SDIRK4 steps; Hairer, Wanner II, eq. (IV.6.16)."""
    b = h / 4
    denominator = 1 + b * damping_rate
    kick, push = b * w02 / denominator, b * drive
    s = b * kick
    h10 = h * (1 / 2)
    h20, h21 = h * (17 / 50), h * (-1 / 25)
    h30, h31, h32 = h * (371 / 1360), h * (-137 / 2720), h * (15 / 544)
    h40, h41, h42, h43 = h * (25 / 24), h * (-49 / 48), h * (125 / 16), h * (-85 / 12)
    k20, k21 = 34 / 25, -4 / 25
    k30, k31, k32 = 371 / 340, -137 / 680, 15 / 136
    k40, k41, k42, k43 = 25 / 6, -49 / 12, 125 / 4, -85 / 3
    for _ in range(n):
        v = (w + push) / denominator
        w0 = v - kick * sin(kepler(s, phi + b * v))
        kick0 = w0 - w
        before = w + 2 * kick0
        v = (before + push) / denominator
        w1 = v - kick * sin(kepler(s, phi + h10 * w0 + b * v))
        kick1 = w1 - before
        before = w + k20 * kick0 + k21 * kick1
        v = (before + push) / denominator
        w2 = v - kick * sin(kepler(s, phi + h20 * w0 + h21 * w1 + b * v))
        kick2 = w2 - before
        before = w + k30 * kick0 + k31 * kick1 + k32 * kick2
        v = (before + push) / denominator
        w3 = v - kick * sin(kepler(s, phi + h30 * w0 + h31 * w1 + h32 * w2 + b * v))
        kick3 = w3 - before
        v = (w + k40 * kick0 + k41 * kick1 + k42 * kick2 + k43 * kick3 + push) / denominator
        phi = kepler(s, phi + h40 * w0 + h41 * w1 + h42 * w2 + h43 * w3 + b * v)
        w = v - kick * sin(phi)
    return phi


def taylor_series(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Return the angle after steps along the Taylor series of phi, w, sin(phi), cos(phi), with the powers of h."""
    ratios = [h / k for k in range(1, ORDER + 1)]
    for _ in range(n):
        rates, sines, cosines = [w], [sin(phi)], [cos(phi)]
        force = drive
        for ratio in ratios:
            phi += ratio * rates[-1]
            a = force - damping_rate * rates[-1] - w02 * sines[-1]
            force = 0.0
            sine = ratio * sum(map(mul, rates, reversed(cosines)))
            cosines.append(-ratio * sum(map(mul, rates, reversed(sines))))
            sines.append(sine)
            rates.append(ratio * a)
        w = sum(reversed(rates))
    return phi


PYTHON_LOOPS: dict[str, Loop] = {
    "ExplicitEuler": explicit_euler,
    "ExplicitMidPoint2": explicit_midpoint2,
    "ExplicitRungeKutta4": explicit_runge_kutta4,
    "ImplicitEuler": implicit_euler,
    "ImplicitTrapezoid": implicit_trapezoid,
    "TRBDF2": tr_bdf2,
    "SDIRK4": sdirk4,
    "TaylorSeries": taylor_series,
}


@cache
def c_loops() -> dict[str, Loop]:
    """Compile the loops in C and return them by the names of the methods.

    Raises
    ------
    NoCompilerError : there is no C compiler, or it fails
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        library = ctypes.CDLL(str(shared_library(SOURCE, Path(folder))))
    return {method: _typed(library[loop.__name__]) for method, loop in PYTHON_LOOPS.items()}


def _typed(function: ctypes._NamedFuncPointer) -> Loop:
    arguments: Sequence[type[ctypes._SimpleCData[float]]] = [ctypes.c_double] * 6
    function.argtypes, function.restype = [*arguments, ctypes.c_int], ctypes.c_double
    loop: Loop = function
    return loop
