"""Diagonally implicit Runge-Kutta methods: one loop over the stages of a tableau.

Stage i of a substep h from x and v is

    v_i = v + h*sum_j A_ij*a_j,   x_i = x + h*sum_j A_ij*v_j,   a_j = a(x_j, v_j),   j <= i

With what is known on its right-hand side, V = v + h*sum_j A_ij*a_j and X = x + h*sum_j A_ij*v_j with j < i, it is the
implicit stage of the model, v_i = V + b*a(x_i, v_i), x_i = X + b*v_i, b = h*A_ii. The last stage is the result of the
substep, and an explicit first one is the last of the substep before. b*a_i is had as v_i - V: where the motion is
stiff, a(x_i, v_i) would magnify the rounding of v_i.

References: Hairer, Wanner, "Solving Ordinary Differential Equations II", section IV.6; Bank, Coughran, Fichtner,
Grosse, Rose, Smith, "Transient simulation of silicon devices and circuits", IEEE Transactions on Electron Devices 32
(1985), 1992 (trapezoid, then the second-order formula of Gear).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import repeat
from math import inf, isfinite, nan, sqrt
from typing import Any

from .motion import Acceleration, Solver

MAX_EVALUATIONS = 200  # of `newton_stage`: bisection alone takes one for each of the 64 bits of a double

Tableau = tuple[tuple[float, ...], ...]

# Rows of A, of which the last one holds the weights, too. The diagonal is the same for all stages, but for a first one
# that is explicit.
IMPLICIT_EULER = ((1.0,),)
IMPLICIT_TRAPEZOID = ((0.0,), (1 / 2, 1 / 2))
_GEAR = 1 / (2 + sqrt(2))  # 1 - sqrt(2)/2 without its cancellation
TR_BDF2 = ((0.0,), (_GEAR, _GEAR), (sqrt(2) / 4, sqrt(2) / 4, _GEAR))
SDIRK4 = (  # Hairer, Wanner II, eq. (IV.6.16)
    (1 / 4,),
    (1 / 2, 1 / 4),
    (17 / 50, -1 / 25, 1 / 4),
    (371 / 1360, -137 / 2720, 15 / 544, 1 / 4),
    (25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4),
)


def diagonally_implicit(tableau: Tableau) -> Solver:
    """Return the method of `tableau`.

    Its stages are written out: a loop over the tableau would cost a third of the substep.
    """
    names: dict[str, Any] = {"repeat": repeat, "isfinite": isfinite}
    exec(_source(tableau), names)
    solver: Solver = names["solver"]
    return solver


def _source(tableau: Tableau) -> str:
    """Return the method of `tableau` as source text.

    With kick_i = b*a_i the sums are X = x + sum_j (h*A_ij)*v_j and V = v + sum_j (A_ij/A_ii)*kick_j.
    """
    diagonal = tableau[-1][-1]
    last = len(tableau) - 1
    is_explicit = tableau[0] == (0.0,)
    head = [f"b = h * {diagonal!r}", "stage = motion.implicit_stage(b)"]
    head += ["kick0 = b * motion.acceleration()(x, v)", "nfev = 1"] if is_explicit else ["nfev = 0"]
    substep = ["v0 = v"] if is_explicit else []
    for i, row in enumerate(tableau):
        if row[-1] == 0.0:
            continue
        head += [f"h{i}{j} = h * {row[j]!r}" for j in range(i)]
        X = " + ".join(["x", *(f"h{i}{j} * v{j}" for j in range(i))])
        V = " + ".join(["v", *(f"{row[j] / diagonal!r} * kick{j}" for j in range(i))])
        substep += [f"V = {V}", f"x{i}, v{i}, evaluations = stage({X}, V)", "nfev += evaluations"]
        if i < last:
            substep.append(f"kick{i} = v{i} - V")
    substep += [f"kick0 = v{last} - V"] if is_explicit else []
    substep += [f"x, v = x{last}, v{last}", "if not isfinite(x): break"]
    lines = [
        "def solver(motion, x, v, h, n):",
        *(f"    {line}" for line in head),
        "    for _ in repeat(None, n):",
        *(f"        {line}" for line in substep),
        "    return x, v, nfev",
    ]
    return "\n".join(lines)


def newton_stage(
    acceleration: Acceleration,
    partial_derivatives: Callable[[float, float], tuple[float, float]],
    b: float,
    x_before: float,
    v_before: float,
) -> tuple[float, float, int]:
    """Solve v = v_before + b*a(x, v), x = x_before + b*v by Newton's method, for models that know no better way.

    `partial_derivatives` returns those of a with respect to x and v. Where the solution is a single one the residual
    rises with v, so its sign says on which side the solution lies, and bisection helps where Newton's method is slow.

    Returns
    -------
    x, v : the solution, not finite where it cannot be found
    evaluations : how often a was evaluated
    """
    v, x = v_before, x_before + b * v_before
    low, high, last_move = -inf, inf, inf
    evaluations = 0
    while True:
        a = acceleration(x, v)
        a_x, a_v = partial_derivatives(x, v)
        evaluations += 1
        residual = (v - v_before) - b * a
        correction = residual / (1.0 - b * (a_v + b * a_x))
        if residual > 0.0:
            high = v
        else:
            low = v
        # Newton's method doubles the digits: after a step this small all are right.
        is_last = abs(correction) <= 1e-9 * (abs(v) + abs(v_before) + abs(b * a))
        is_slow = abs(correction) > 0.5 * last_move or not low < v - correction < high
        bisects = not is_last and is_slow and isfinite(high - low)
        after = 0.5 * (low + high) if bisects else v - correction
        last_move = abs(after - v)
        v, x = after, x_before + b * after
        if is_last or not isfinite(x) or after in (low, high):
            return x, v, evaluations
        if evaluations == MAX_EVALUATIONS:
            return nan, nan, evaluations
