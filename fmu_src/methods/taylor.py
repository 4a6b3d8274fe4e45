"""The Taylor series method, and what a model may build its series of.

Terms are those of a step h: the k-th is h^k/k! times the k-th derivative at the beginning of the step. A product of two
series has the convolution of their terms, and that of a derivative follows from it: if der(x) has the terms d, the term
k + 1 of x is d[k]*h/(k + 1).

Reference: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", section I.8.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from math import isfinite

from .motion import Motion

ORDER = 16


def taylor_series(motion: Motion, x: float, v: float, h: float, n: int) -> tuple[float, float, int]:
    """Taylor series of x and v up to the order 16, each coefficient of a counted as an evaluation."""
    step = motion.taylor_step(h, ORDER)
    for _ in repeat(None, n):
        x, v = step(x, v)
        if not isfinite(x):
            break
    return x, v, ORDER * n


def convolution(first: Sequence[float], second: Sequence[float], k: int) -> float:
    """Return the term k of the product of two series, of which the terms up to k are known."""
    product = first[0] * second[k]
    for j in range(1, k + 1):
        product += first[j] * second[k - j]
    return product


def total(terms: Sequence[float]) -> float:
    """Return the sum of a series, from its last term on; built-in `sum` rounds in another way from Python 3.12 on."""
    value = 0.0
    for term in reversed(terms):
        value += term
    return value
