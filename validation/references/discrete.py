"""The exact discrete motion: what a method makes of the pendulum, straight from its tableau.

It says how large the error of a method has to be, without asking the FMU. It is not the truth, which is a closed form.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, cos, factorial, sin

import numpy as np

from .arrays import State
from .linear import NOISE
from .methods import METHODS, Tableau

Step = Callable[[float, float, Sequence[float], float, int], tuple[float, float]]


def motion(
    method: str,
    t: Sequence[float],
    phi0: float,
    rate0: float,
    k2: float,
    w02: float,
    substep: float,
    drive: Sequence[float] | Sequence[Sequence[float]] | float = 0.0,
) -> State:
    """Return phi and w at the communication points `t` [s], the first of which is that of the initial state.

    `method` is a name in `METHODS`.

    Each communication step is divided into equal substeps, as few as are not longer than `substep` [s]. `drive` [1/s2]
    is one number, or one for each communication step, which holds it, or for each the drive and its derivatives by time
    when it begins.
    """
    known = METHODS[method]
    advance = _taylor(known.order, k2, w02) if known.tableau is None else _runge_kutta(known.tableau, k2, w02)
    held = [drive] * (len(t) - 1) if isinstance(drive, float) else drive
    drives = [[u] if isinstance(u, float) else u for u in held]
    phi, w = phi0, rate0
    states = [(phi, w)]
    for begin, end, u in zip(t, t[1:], drives, strict=False):
        n = max(1, ceil((end - begin) / substep * (1 - NOISE)))
        phi, w = advance(phi, w, u, (end - begin) / n, n)
        states.append((phi, w))
    table = np.array(states)
    return table[:, 0], table[:, 1]


def _at(drive: Sequence[float], t: float) -> float:
    """Return the polynomial at `t` [s] whose value and derivatives at 0 are `drive`."""
    value = 0.0
    for k in range(len(drive) - 1, -1, -1):
        value = drive[k] + t / (k + 1) * value
    return value


def _runge_kutta(tableau: Tableau, k2: float, w02: float) -> Step:
    """Return the function of phi, w, drive, h and n that makes n steps."""
    nodes = [sum(row) for row in tableau.A]
    rows = [[(j, a) for j, a in enumerate(row[:i]) if a] for i, row in enumerate(tableau.A)]
    diagonals = [row[i] if len(row) > i else 0.0 for i, row in enumerate(tableau.A)]
    weights = [(j, b) for j, b in enumerate(tableau.b) if b]

    def advance(phi: float, w: float, drive: Sequence[float], h: float, n: int) -> tuple[float, float]:
        drives = [drive[0]] * len(nodes)
        for i in range(n):
            rates: list[float] = []
            accelerations: list[float] = []
            if len(drive) > 1:
                drives = [_at(drive, (i + c) * h) for c in nodes]
            for row, diagonal, u in zip(rows, diagonals, drives, strict=True):
                dx = dv = 0.0
                for j, a in row:
                    dx += a * rates[j]
                    dv += a * accelerations[j]
                x, v = phi + h * dx, w + h * dv
                if diagonal:
                    x, v = _implicit_stage(x, v, h * diagonal, u, k2, w02)
                rates.append(v)
                accelerations.append(u - k2 * v - w02 * sin(x))
            dx = dv = 0.0
            for j, b in weights:
                dx += b * rates[j]
                dv += b * accelerations[j]
            phi += h * dx
            w += h * dv
        return phi, w

    return advance


def _implicit_stage(X: float, V: float, b: float, drive: float, k2: float, w02: float) -> tuple[float, float]:
    """Solve v = V + b*(drive - k2*v - w02*sin(x)), x = X + b*v, by Newton's method for x + s*sin(x) = c, s < 1."""
    free = (V + b * drive) / (1 + b * k2)
    pull = b * w02 / (1 + b * k2)
    s, c = b * pull, X + b * free
    x = c
    for _ in range(50):
        correction = (x + s * sin(x) - c) / (1 + s * cos(x))
        x -= correction
        if abs(correction) <= 1e-16 * abs(x):
            break
    return x, free - pull * sin(x)


def _taylor(order: int, k2: float, w02: float) -> Step:
    """Return the function of phi, w, drive, h and n that makes n steps of the Taylor series of phi and w."""

    def advance(phi: float, w: float, drive: Sequence[float], h: float, n: int) -> tuple[float, float]:
        for i in range(n):
            x, v, s, c = [phi], [w], [sin(phi)], [cos(phi)]
            u = [_at(drive[k:], i * h) / factorial(k) for k in range(len(drive))]
            for k in range(order):
                x.append(v[k] / (k + 1))
                v.append(((u[k] if k < len(u) else 0.0) - k2 * v[k] - w02 * s[k]) / (k + 1))
                sine = cosine = 0.0
                for j in range(k + 1):
                    sine += v[j] * c[k - j]
                    cosine -= v[j] * s[k - j]
                s.append(sine / (k + 1))
                c.append(cosine / (k + 1))
            phi = w = 0.0
            for k in range(order, -1, -1):
                phi = phi * h + x[k]
                w = w * h + v[k]
        return phi, w

    return advance
