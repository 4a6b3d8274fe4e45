"""Reference for the damped and driven nonlinear pendulum: Taylor series in decimal arithmetic, with stated digits.

No closed form is known for it. The order of the series (40) and the arithmetic (50 digits) are so high that a thousand
steps are in error by less than 1e-30; the result is then rounded to doubles. The inputs are the doubles given.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, localcontext

import numpy as np

from .arrays import Array

ORDER = 40
DIGITS = 50
TOLERANCE = Decimal("1e-34")  # of a step; a thousand steps stay below 1e-30


Coefficients = list[Decimal]


def motion(
    t: Sequence[float],
    phi0: float,
    rate0: float,
    k2: float,
    w02: float,
    drive: Sequence[float] | float = 0.0,
) -> tuple[Array, Array]:
    """Return phi [rad] and w [rad/s] at the times `t` [s], the first of which is that of the initial state.

    `drive` [1/s2] is one number, or one for each interval between the times, in which it is constant.
    """
    drives = [drive] * (len(t) - 1) if isinstance(drive, float) else drive
    with localcontext() as context:
        context.prec = DIGITS
        phi, w = Decimal(phi0), Decimal(rate0)
        states = [(phi0, rate0)]
        for begin, end, held in zip(t, t[1:], drives, strict=False):
            left = Decimal(end) - Decimal(begin)
            while left > 0:
                series = _series(phi, w, Decimal(k2), Decimal(w02), Decimal(held))
                step = min(left, _radius(series))
                phi, w = (_evaluate(coefficients, step) for coefficients in series)
                left -= step
            states.append((float(phi), float(w)))
    table = np.array(states)
    return table[:, 0], table[:, 1]


def _series(
    phi0: Decimal, w0: Decimal, k2: Decimal, w02: Decimal, drive: Decimal
) -> tuple[Coefficients, Coefficients]:
    """Return the Taylor coefficients of phi and w; those of sin(phi) and cos(phi) follow from each other."""
    phi, w = [phi0], [w0]
    sine, cosine = _sine_cosine(phi0)
    s, c = [sine], [cosine]
    weighted: Coefficients = []  # j*phi_j
    for n in range(1, ORDER + 1):
        w.append(((drive if n == 1 else 0) - k2 * w[-1] - w02 * s[-1]) / n)
        phi.append(w[n - 1] / n)
        weighted.append(n * phi[n])
        s.append(sum(a * b for a, b in zip(weighted, reversed(c), strict=True)) / n)  # type: ignore[arg-type]
        c.append(-sum(a * b for a, b in zip(weighted, reversed(s[:n]), strict=True)) / n)  # type: ignore[arg-type]
    return phi, w


def _sine_cosine(x: Decimal) -> tuple[Decimal, Decimal]:
    sine, cosine, term, n = x, Decimal(1), x, 1
    with localcontext() as context:
        context.prec += int(abs(x))  # terms of up to exp(|x|) cancel
        while abs(term) > TOLERANCE * TOLERANCE:
            term *= x / (n + 1)
            sign = -1 if (n + 1) % 4 in (2, 3) else 1
            if (n + 1) % 2:
                sine += sign * term
            else:
                cosine += sign * term
            n += 1
            if n > 10_000:
                raise ValueError(f"angle {x} is too large for the series")
    return sine, cosine


def _radius(series: tuple[Coefficients, Coefficients]) -> Decimal:
    """Return a step for which the last two terms are below the tolerance."""
    largest = max(
        (abs(coefficients[n]) / TOLERANCE) ** (Decimal(1) / n)
        for coefficients in series
        for n in (ORDER - 1, ORDER)
    )
    return 1 / largest if largest else Decimal(10) ** 9


def _evaluate(coefficients: Coefficients, step: Decimal) -> Decimal:
    value = Decimal(0)
    for coefficient in reversed(coefficients):
        value = value * step + coefficient
    return value
