"""The atlas: what each method makes of undamped swings, over amplitude and step, by a sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import hypot, nan

import numpy as np

from .. import references
from ..checks import Check, Map, Maps, Result, Table
from ..fmu import OUTPUTS, W0, W02, Fmu, SolverMethod
from ..metrics import UNIT, Array, largest
from ..references import discrete
from ..references.methods import METHODS
from ..sweep.interface import interface
from ..sweep.plan import Common, axis, of_axes
from ..sweep.row import Row, columns, run
from .methods import magnification, radius_of_convergence
from .scene import Case

TITLE = "Atlas: error and time of each method over amplitude and step"
FORMULA = (
    "a sweep; error of (phi, w/w0) after 2 s against elliptic functions, and against the discrete motions"
)

AMPLITUDES = (1, 10, 30, 60, 90, 120, 150, 170, 179, 179.9)  # [deg]
END = 2.0  # about a small period [s]
STEPS = tuple(2**i for i in range(1, 11))  # substeps in it
JUDGED = AMPLITUDES[1::2], tuple(n for n in STEPS if n <= 64)  # more only round more
ROUNDS = 2  # of which the shorter times are shown
LINEAR = 1e-6  # round-off [rad] up to which its growth is that of a small change


@dataclass(frozen=True)
class Cell:
    """What a method has to make of a swing: phi [rad] and w/w0 [rad] at the end, and its round-off [rad]."""

    phi: float
    rate: float
    rounding: float


def sweep(fmu: Fmu, amplitudes: Sequence[float], steps: Sequence[int]) -> list[Row]:
    """Return the rows of all methods, of `amplitudes` [deg] and of numbers of substeps."""
    known = interface(fmu.description)
    axes = (
        "solver.method=" + ",".join(method.name for method in SolverMethod),
        "phi_start=" + ",".join(map(str, amplitudes)) + ":deg",
        "solver.stepSize=" + ",".join(repr(END / n) for n in steps),
        "gamma=0",
    )
    names, _, runs = of_axes([axis(text, known) for text in axes])
    common = Common(known, names, END, END)
    return [run(fmu, common, values)[0] for values in runs()]


@cache
def cell(method: SolverMethod, amplitude: float, n: int) -> Cell:
    """Return the discrete motion of n substeps from `amplitude` [rad], and how far rounding can move it.

    A substep rounds the state and, magnified by its coefficients, the stages, or the terms of its series; what comes of
    this at the end is the product of the derivatives of the substeps behind it.
    """
    h = END / n
    t = [i * h for i in range(n + 1)]
    phi, w = discrete.motion(method.name, t, amplitude, 0.0, 0.0, W02, h)
    states = np.array((phi, w / W0)).T
    unit = (
        7 * UNIT * (magnification(method) * float(np.max(np.hypot(*states.T))) + _terms(method, amplitude, h))
    )
    growth, rounding = np.eye(2), 0.0
    for state in states[-2::-1]:
        rounding += unit * float(np.linalg.norm(growth, 2))
        growth = growth @ _derivative(method, state, h)
    return Cell(float(phi[-1]), float(w[-1] / W0), rounding)


def _terms(method: SolverMethod, amplitude: float, h: float) -> float:
    """Return the sum of the sizes of the terms of a Taylor step, by the nearest singularities; 0 for other methods."""
    if METHODS[method.name].tableau is not None:
        return 0.0
    radius = radius_of_convergence(amplitude)
    powers = range(1, METHODS[method.name].order + 1)
    return sum(hypot(4 / k, 4 / (W0 * radius)) * (h / radius) ** k for k in powers)


def _is_divided(method: SolverMethod, h: float) -> bool:
    """Return whether the FMU divides a substep, so that the equations of its implicit stages have a single root."""
    tableau = METHODS[method.name].tableau
    return METHODS[method.name].stable and tableau is not None and tableau.A[-1][-1] * h * W0 >= 1


def _derivative(method: SolverMethod, state: Array, h: float) -> Array:
    """Return the derivative of a substep in the state (phi, w/w0), by central differences."""
    small = 1e-6
    ends = [
        np.array(discrete.motion(method.name, [0.0, h], x, W0 * v, 0.0, W02, h))[:, -1] / (1.0, W0)
        for x, v in (state + sign * shift for shift in small * np.eye(2) for sign in (1, -1))
    ]
    return np.array([ends[0] - ends[1], ends[2] - ends[3]]).T / (2 * small)


def _number(row: Row, name: str) -> float:
    value = row[name]
    return value if isinstance(value, float) else nan


def _motions(fmu: Fmu) -> Iterator[Result]:
    """Hold each method's motions, and the errors in the rows of the sweep, against those of the discrete one."""
    rows = sweep(fmu, *JUDGED)
    for method in SolverMethod:
        yield from _judged(method, [row for row in rows if row["solver.method"] == method.name])


def _judged(method: SolverMethod, rows: Sequence[Row]) -> Iterator[Check]:
    motions, errors = [], []
    for row in rows:
        n, amplitude = round(END / _number(row, "solver.stepSize")), _number(row, "phi_start")
        if _is_divided(method, END / n) or (expected := cell(method, amplitude, n)).rounding > LINEAR:
            continue
        phi, rate = _number(row, "phi"), _number(row, "w") / W0
        motions.append(hypot(phi - expected.phi, rate - expected.rate) / expected.rounding)
        exact = references.libration(END, amplitude, W02)
        error = hypot(expected.phi - float(exact[0]), expected.rate - float(exact[1]) / W0)
        errors.append(abs(_number(row, "error") - error) / expected.rounding)
    reason = (
        f"of the round-off: four roundings of a substep, three of the discrete one, grown as it grows them; "
        f"{len(motions)} amplitudes and steps where that is less than {LINEAR:g} rad"
    )
    yield Check(f"{method.name}: swings are the discrete motions", largest(motions), 1.0, reason)
    yield Check(f"{method.name}: errors in the rows are theirs", largest(errors), 1.0, reason)


def _atlas(fmu: Fmu) -> Iterator[Result]:
    """Draw the errors and times of all methods."""
    rows, *repeated = (sweep(fmu, AMPLITUDES, STEPS) for _ in range(ROUNDS))
    maps = []
    for method in SolverMethod:
        of_method = [i for i, row in enumerate(rows) if row["solver.method"] == method.name]
        shape = len(AMPLITUDES), len(STEPS)
        errors = [_number(rows[i], "error") for i in of_method]
        seconds = [min(_number(some[i], "seconds") for some in (rows, *repeated)) for i in of_method]
        # From the shortest step on.
        maps.append(Map(method.name, np.reshape(errors, shape)[:, ::-1], np.reshape(seconds, shape)[:, ::-1]))
    kinds = columns(Common(interface(fmu.description), (), END, END))
    shown = [name for name in kinds if name not in ("run", "fmu", *OUTPUTS[2:])]
    yield Table("Atlas", shown, [[row[name] for name in shown] for row in rows], shown=False)
    times = np.concatenate([np.asarray(one.others).ravel() for one in maps])
    yield Maps(
        "Undamped swings, 2 s: the error at the end (above), and the time of the processor (below)",
        "h [s]",
        "amplitude [deg]",
        [END / n for n in STEPS[::-1]],
        AMPLITUDES,
        maps,
        "error of (phi, w/w0) [rad]",
        (1e-16, 1.0),
        "time [s]",
        (float(np.nanmin(times)), float(np.nanmax(times))),
        note="Each cell is a run; longer steps are at the right, larger swings at the top. Crossed out: off by more "
        "than 1 rad, or no number. Steps beyond 1/(d*w0), d = 1 for ImplicitEuler and 1/2 for ImplicitTrapezoid, "
        "are divided by the FMU. Near the upright position a method seems right where the swing hardly leaves it in "
        "2 s.",
    )


SCENES = (Case("motions", _motions),)
RACES = (Case("atlas", _atlas),)
