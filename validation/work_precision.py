"""Error against run time: every method over its step sizes, SciPy's integrators as yardsticks, all in one run.

The rows of SCENES are about errors, those of RACES about run times.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, partial
from itertools import pairwise
from math import exp, inf, isnan, log, nan, pi, radians, sin, sqrt, ulp
from pathlib import Path

import numpy as np
from scipy.integrate import odeint, solve_ivp

from . import races, references
from .checks import Check, Curve, Note, Plot, Result, Table
from .fmu import EULER, IMPLICIT_EULER, METHOD_NAMES, MIDPOINT, RK4, W0, W02, Experiment, Fmu, Run
from .loops import Loop, NoCompilerError, c_loop, python_loop
from .metrics import largest, observed_order, state_error
from .races import Ratio, clock
from .references import taylor

TITLE = "Error against run time"
FORMULA = (
    "error = |(phi, w/w0) - exact|, time of the processor: least of repeats of all doStep calls, h = 2^-k s"
)

ORDERS = {EULER: 1, MIDPOINT: 2, RK4: 4, IMPLICIT_EULER: 1}
REPEATS = 3
FAMILIES = {"solve_ivp": ("RK45", "DOP853", "LSODA"), "odeint": ("odeint",)}
LINES = {EULER: ("-", "o"), MIDPOINT: ("-", "s"), RK4: ("-", "^"), IMPLICIT_EULER: ("-", "v")}
TARGETS = tuple(10.0**-k for k in range(3, 13))
FASTER_AT = tuple(10.0**-k for k in range(3, 10))  # errors at which the FMU is to be faster than solve_ivp
FASTER_BY = {False: 2.0, True: 20.0}  # at least so many times; by whether the FMU is native
SUBSTEP = 1e-3  # of the races of substeps [s]
SUBSTEPS = 20_000  # of such a race, all in one communication step
TORQUE = 0.1  # lets every term of the equation act [N.m]
LOOP_NAMES = {False: "bare loop in Python", True: "bare loop in C"}  # by whether the FMU is native
NO_SLOWER_THAN = {False: 1.4, True: 1.25}  # a substep of the FMU in units of that of the bare loop
NATIVE_FASTER_BY = {SUBSTEPS: 10.0, 100: 7.0}  # by the number of substeps in a communication step
SCIPY_SPEND = 0.005  # of a race against SciPy [s]: its runs take longer than that
COMMUNICATION_STEPS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)

Exact = Callable[[Sequence[float]], references.State]


@dataclass(frozen=True)
class WorkScene:
    """A motion with its exact answer.

    Attributes
    ----------
    start : start values that differ from the defaults
    stop, step : end and communication step [s]; with a torque the communication step is the substep itself
    exact : phi and w at given times
    exponents : range of k, h = 2^-k s, of each method
    k2 : damping rate [1/s] of the right-hand side that SciPy gets
    drive : drive [1/s2] as a function of time; the FMU gets it sampled in the middle of each step
    scale : what errors are relative to [rad]
    solvers : SciPy's solvers
    slopes : methods whose order shows over the whole run: (method, k) compares h = 2^-k with h/2
    floor : whether RK4's finest step is judged by rounding
    headline : whether its picture leads the report
    """

    name: str
    start: dict[str, float]
    stop: float
    step: float
    exact: Exact
    exponents: dict[int, range]
    k2: float = 0.0
    drive: Callable[[float], float] | None = None
    scale: float = 1.0
    solvers: Sequence[str] = ("RK45", "DOP853", "LSODA")
    slopes: Sequence[tuple[int, int]] = ()
    floor: bool = False
    headline: bool = False
    slow: bool = False


@dataclass(frozen=True)
class RatioScene:
    """The time to reach given errors, FMU against SciPy, and how it depends on the communication step."""

    name: str = "time to reach an error, undamped 90 deg"
    slow: bool = True


@dataclass(frozen=True)
class SubstepScene:
    """A substep of the FMU against loops that were written by hand, and one carrier against the other."""

    name: str = "substeps against bare loops, and one carrier against the other"
    slow: bool = False


@dataclass(frozen=True)
class CostScene:
    """What a call of doStep costs, and what a substep costs."""

    name: str = "cost of a call and of a substep"
    slow: bool = False


@dataclass(frozen=True)
class SavingScene:
    """What leaving out terms that do not act saves."""

    name: str = "terms that do not act"
    slow: bool = False


@dataclass(frozen=True)
class Point:
    """A run: step size or tolerance, errors, time [s], evaluations; `error` is inf where it diverged."""

    label: float
    error: float
    largest: float
    seconds: float
    nfev: int
    failure: str = ""


def _taylor(angle: float, k2: float) -> Exact:
    @cache
    def at(times: tuple[float, ...]) -> references.State:
        return taylor.motion(times, angle, 0.0, k2, W02)

    return lambda t: at(tuple(t))


def _libration(angle: float) -> Exact:
    return lambda t: references.libration(t, radians(angle), W02)


SMALL = 1e-9  # amplitude of the linear scenes [rad]
PULSE = {"center": 4.0, "variance": 0.09}  # of the Gaussian drive: [s], [s2]
PERIODS = 10
EXPLICIT = {EULER: range(8, 15), MIDPOINT: range(4, 14), RK4: range(3, 13), IMPLICIT_EULER: range(8, 14)}

# Slopes are read where h is so small that the next term of the error expansion changes them by less than 0.1: the
# amplitude error of the Euler methods, pi*h*w0 a period, is then below 0.1 over the whole run.
SLOPES = ((EULER, 13), (IMPLICIT_EULER, 12), (MIDPOINT, 9), (RK4, 7))

SCENES: tuple[WorkScene | SavingScene, ...] = (
    WorkScene(
        "undamped 30 deg, 10 periods",
        {"gamma": 0.0},
        PERIODS * references.period(radians(30), W02),
        1.0,
        _libration(30),
        EXPLICIT,
        slopes=SLOPES,
        floor=True,
    ),
    WorkScene(
        "undamped 90 deg, 10 periods",
        {"gamma": 0.0, "phi_start": radians(90)},
        PERIODS * references.period(radians(90), W02),
        1.0,
        _libration(90),
        EXPLICIT,
        floor=True,
        headline=True,
    ),
    WorkScene(
        "damped nonlinear 170 deg, k2 = 0.5/s, 10 s",
        {"gamma": 0.5, "phi_start": radians(170)},
        10.0,
        1.0,
        _taylor(radians(170), 0.5),
        EXPLICIT,
        k2=0.5,
        slopes=((MIDPOINT, 10), (RK4, 8)),
    ),
    WorkScene(
        "impulse response, k2 = 0.002/s, 20 s",
        {"phi_start": 0.0, "w_start": SMALL * W0},
        20.0,
        1.0,
        lambda t: references.free_evolution(t, 0.0, SMALL * W0, 0.002, W02),
        EXPLICIT,
        k2=0.002,
        scale=SMALL,
        slopes=SLOPES,
    ),
    WorkScene(
        "Gaussian pulse through tau, k2 = 0.5/s, 8 s",
        {"phi_start": 0.0, "gamma": 0.5},
        8.0,
        1.0,
        lambda t: references.gaussian_response(t, SMALL * W02, **PULSE, k2=0.5, w02=W02, start=0.0),
        {EULER: range(5, 10), MIDPOINT: range(3, 10), RK4: range(3, 10), IMPLICIT_EULER: range(5, 10)},
        k2=0.5,
        drive=lambda t: SMALL * W02 * exp(-((t - PULSE["center"]) ** 2) / (2 * PULSE["variance"])),
        scale=SMALL,
        slopes=((RK4, 7),),
    ),
    WorkScene(
        "stiff, k2 = 1e3/s, 90 deg, 1 s",
        {"gamma": 1e3, "phi_start": radians(90)},
        1.0,
        1.0,
        _taylor(radians(90), 1e3),
        {EULER: range(7, 16), MIDPOINT: range(7, 14), RK4: range(7, 14), IMPLICIT_EULER: range(0, 15)},
        k2=1e3,
        solvers=("RK45", "LSODA", "Radau"),
    ),
    WorkScene(
        "stiff, k2 = 1e6/s, 90 deg, 1e5 s",
        {"gamma": 1e6, "phi_start": radians(90)},
        1e5,
        1e5 / 8,
        lambda t: _overdamped(t, 1e6),
        {EULER: range(17, 19), MIDPOINT: range(17, 19), RK4: range(17, 19), IMPLICIT_EULER: range(-14, -2)},
        k2=1e6,
        solvers=("LSODA", "Radau"),
        slopes=((IMPLICIT_EULER, -8),),
    ),
    SavingScene(),
)
RACES = (RatioScene(), SubstepScene(), CostScene())


def _overdamped(t: Sequence[float], k2: float) -> references.State:
    """Return the slow motion from 90 deg, tan(phi/2) = exp(-w02*t/k2), to a relative w02/k2^2 = 1e-11."""
    phi = 2 * np.arctan(np.exp(-W02 / k2 * np.asarray(t)))
    return phi, -W02 / k2 * np.sin(phi)


def run(fmu: Fmu, scene: WorkScene | SavingScene | RatioScene | SubstepScene | CostScene) -> Iterator[Result]:
    """Yield the rows, tables and pictures of a scene."""
    if isinstance(scene, WorkScene):
        yield from _work(fmu, scene)
    elif isinstance(scene, RatioScene):
        yield from _ratio(fmu)
    elif isinstance(scene, SubstepScene):
        yield from _substeps(fmu)
    elif isinstance(scene, CostScene):
        yield from _cost(fmu)
    else:
        yield from _saving(fmu)


# Runs


def fmu_point(fmu: Fmu, scene: WorkScene, method: int, h: float, step: float, spend: float = 0.02) -> Point:
    """Return errors and time of a run of the FMU with substeps of at most `h` [s], repeated for `spend` [s]."""
    recorded = fmu.run(_experiment(scene, method, h, step, ("phi", "w")))
    final, worst = _errors(scene, recorded)
    timed = _experiment(scene, method, h, step, ())
    seconds, spent = recorded.seconds, 0.0
    while spent < spend and not recorded.failure:
        again = fmu.run(timed).seconds
        seconds, spent = min(seconds, again), spent + again
    return Point(h, final, worst, seconds, recorded.nfev, recorded.failure)


def _experiment(scene: WorkScene, method: int, h: float, step: float, record: Sequence[str]) -> Experiment:
    start = scene.start | {"solver.method": method, "solver.stepSize": h}
    drive = scene.drive
    if drive is None:
        return Experiment(scene.stop, step, start, None, record)
    return Experiment(scene.stop, h, start, lambda t: drive(t + h / 2), record)


def _errors(scene: WorkScene, run: Run) -> tuple[float, float]:
    if run.failure:
        return inf, inf
    points = np.unique(np.linspace(0, len(run.t) - 1, 50, dtype=int))
    t, phi, w = run.t[points], run["phi"][points], run["w"][points]
    exact = scene.exact(t.tolist())
    last = (exact[0][-1:], exact[1][-1:])
    return state_error(phi[-1:], w[-1:], last) / scene.scale, state_error(phi, w, exact) / scene.scale


def scipy_point(scene: WorkScene, solver: str, tolerance: float, repeats: int = REPEATS) -> Point:
    """Return error and time of a run of SciPy with the fastest right-hand side that it accepts."""
    k2, drive = scene.k2, scene.drive
    if drive is not None:

        def f(t: float, y: Sequence[float]) -> tuple[float, float]:
            return y[1], drive(t) - k2 * y[1] - W02 * sin(y[0])

    elif k2:

        def f(t: float, y: Sequence[float]) -> tuple[float, float]:
            return y[1], -k2 * y[1] - W02 * sin(y[0])

    else:

        def f(t: float, y: Sequence[float]) -> tuple[float, float]:
            return y[1], -W02 * sin(y[0])

    y0 = (scene.start.get("phi_start", pi / 6), scene.start.get("w_start", 0.0))
    absolute = tolerance * scene.scale
    # Without it the first steps of a driven run from rest are so long that they miss the pulse.
    longest = {"max_step": 0.25} if drive is not None else {}
    best = inf
    for _ in range(repeats):
        begin = clock()
        if solver == "odeint":
            ends, info = odeint(
                f,
                y0,
                (0.0, scene.stop),
                rtol=tolerance,
                atol=absolute,
                tfirst=True,
                mxstep=10**6,
                full_output=True,
            )
            y, nfev = ends[-1], int(info["nfe"][-1])
        else:
            solution = solve_ivp(
                f, (0.0, scene.stop), y0, method=solver, rtol=tolerance, atol=absolute, **longest
            )
            y, nfev = solution.y[:, -1], solution.nfev
        best = min(best, clock() - begin)
        if best > 0.05:
            break
    exact = scene.exact([0.0, scene.stop])
    error = state_error(y[:1], y[1:], (exact[0][-1:], exact[1][-1:])) / scene.scale
    return Point(tolerance, error, nan, best, nfev)


@cache
def scipy_points(name: str, solver: str, exponents: tuple[float, ...]) -> list[Point]:
    """Return a sweep over tolerances 10^-e for the scene `name`, which ends where a run takes over 0.1 s."""
    scene = next(scene for scene in SCENES if isinstance(scene, WorkScene) and scene.name == name)
    points: list[Point] = []
    for exponent in exponents:
        points.append(scipy_point(scene, solver, max(10.0**-exponent, 3e-14)))
        if points[-1].seconds > 0.1:
            break
    return points


# Scenes


def _work(fmu: Fmu, scene: WorkScene) -> Iterator[Result]:
    of_fmu = {
        method: [fmu_point(fmu, scene, method, 2.0**-k, scene.step) for k in exponents]
        for method, exponents in scene.exponents.items()
    }
    of_scipy = {solver: scipy_points(scene.name, solver, tuple(range(3, 14))) for solver in scene.solvers}
    for method, k in scene.slopes:
        coarse, fine = (point for point in of_fmu[method] if point.label in (2.0**-k, 2.0 ** -(k + 1)))
        order = observed_order(coarse.largest, fine.largest)
        expected = 2 if scene.drive is not None else ORDERS[method]
        reason = f"observed {order:.3f}, theory {expected}" + (
            ", from holding the input" if scene.drive else ""
        )
        yield Check(f"slope of {METHOD_NAMES[method]}, {scene.name}", abs(order - expected), 0.1, reason)
    if scene.floor:
        yield _floor(scene, of_fmu[RK4])
    for method in of_fmu:
        diverged = [point for point in of_fmu[method] if point.failure]
        if scene.k2 >= 1e3 and method != IMPLICIT_EULER:
            yield _divergence(scene, method, of_fmu[method])
        elif diverged:
            yield Check(
                f"runs of {METHOD_NAMES[method]} that fail, {scene.name}", len(diverged), 0, "stable steps"
            )
    yield _cheapest(scene, of_fmu, of_scipy)
    yield _table(scene, of_fmu, of_scipy)
    curves = _curves(fmu, of_fmu) + _scipy_curves(of_scipy)
    if scene.headline:
        curves += _other_carrier(fmu, scene)
    yield _plot(scene, curves)


def _floor(scene: WorkScene, points: Sequence[Point]) -> Check:
    """Return the row of the round-off floor: the finest step's error against truncation and a random walk.

    Each substep rounds the state once, by at most half an ulp. A change of the amplitude also changes the period, and
    the phase then runs away with the time.
    """
    amplitude = scene.start.get("phi_start", pi / 6)
    T = references.period(amplitude, W02)
    runaway = 2 * pi * PERIODS * amplitude * references.period_slope(amplitude, W02) / T
    reference, finest = points[-5], points[-1]
    truncation = reference.largest * (finest.label / reference.label) ** 4
    walk = sqrt(scene.stop / finest.label) * ulp(amplitude) / 2
    bound = 1.5 * truncation + 3 * walk * (1 + runaway)
    reason = (
        f"1.5 x h^4 error {truncation:.1e} + 3 sigma of {walk:.1e} rad, x {1 + runaway:.1f} for the phase"
    )
    return Check(f"round-off floor of RK4, {scene.name}", finest.largest, bound, reason, "rad")


def _divergence(scene: WorkScene, method: int, points: Sequence[Point]) -> Check:
    """Return the row that runs beyond the stability limit, and no others, fail or end with an error above 1."""
    limit = (2.7852935634 if method == RK4 else 2.0) / scene.k2
    right = sum(point.error > 1 if point.label > limit else point.error <= 1 for point in points)
    name = f"{METHOD_NAMES[method]} is lost beyond its limit, and only there; {scene.name}"
    return Check(
        name,
        len(points) - right,
        0,
        f"real stability limit {limit:.3e} s; {len(points)} runs, those on the wrong side",
    )


def _cheapest(scene: WorkScene, of_fmu: dict[int, list[Point]], of_scipy: dict[str, list[Point]]) -> Table:
    def best(runs: list[tuple[str, Point]], target: float) -> tuple[object, ...]:
        name, point = min(
            ((name, p) for name, p in runs if p.error <= target),
            key=lambda run: run[1].seconds,
            default=("none", None),
        )
        return (name, point.label, point.seconds) if point else (name, "", inf)

    ours = [(METHOD_NAMES[method], p) for method, points in of_fmu.items() for p in points]
    scipys = [(solver, p) for solver, points in of_scipy.items() for p in points]
    rows = []
    for target in TARGETS[::3]:
        fmu, scipy = best(ours, target), best(scipys, target)
        ratio = scipy[2] / fmu[2] if inf not in (fmu[2], scipy[2]) else ""  # type: ignore[operator]
        rows.append((f"{target:.0e}", *fmu, *scipy, ratio))
    columns = ("error", "FMU method", "h [s]", "time [s]", "SciPy", "tolerance", "time [s]", "SciPy/FMU")
    return Table(f"Cheapest run below an error: {scene.name}", columns, rows)


def _table(scene: WorkScene, of_fmu: dict[int, list[Point]], of_scipy: dict[str, list[Point]]) -> Table:
    named = [(METHOD_NAMES[method], points) for method, points in of_fmu.items()]
    named += [(f"SciPy {solver}", points) for solver, points in of_scipy.items()]
    return Table(
        f"Work and precision: {scene.name}",
        ("method", "h [s] or tolerance", "final error", "largest error", "time [s]", "evaluations", "result"),
        [
            (
                *(name, p.label, p.error, "" if isnan(p.largest) else p.largest, p.seconds, p.nfev),
                "diverged" if p.failure else "",
            )
            for name, points in named
            for p in points
        ],
    )


def _curve(label: str, points: Sequence[Point], line: str, marker: str) -> Curve:
    shown = [p for p in points if 0 < p.error < 10]
    return Curve(label, [p.error for p in shown], [p.seconds for p in shown], line, marker)


def _curves(fmu: Fmu, of_fmu: dict[int, list[Point]]) -> list[Curve]:
    return [
        _curve(f"{_carrier(fmu)} {METHOD_NAMES[method]}", points, *LINES[method])
        for method, points in of_fmu.items()
    ]


def _scipy_curves(of_scipy: dict[str, list[Point]]) -> list[Curve]:
    markers = ("x", "+", "*")
    return [
        _curve(f"SciPy {solver}", points, "--", marker)
        for (solver, points), marker in zip(of_scipy.items(), markers, strict=False)
    ]


def _carrier(fmu: Fmu) -> str:
    return "native FMU" if fmu.native else "FMU"


def _other_carrier(fmu: Fmu, scene: WorkScene) -> list[Curve]:
    """Return the curve of RK4 in the FMU that carries the same model otherwise, if it lies beside this one."""
    path = _beside(fmu)
    if not path.is_file():
        return []
    with Fmu(path) as other:
        points = [fmu_point(other, scene, RK4, 2.0**-k, scene.step) for k in scene.exponents[RK4]]
        return [_curve(f"{_carrier(other)} {METHOD_NAMES[RK4]}", points, "-.", "D")]


def _beside(fmu: Fmu) -> Path:
    """Return where the FMU that carries the same model otherwise lies, if it was built."""
    return fmu.path.with_name("DampedPendulum.fmu" if fmu.native else "DampedPendulumNative.fmu")


def _plot(scene: WorkScene, curves: Sequence[Curve]) -> Plot:
    unit = "rad" if scene.scale == 1 else "relative"
    title = f"Error against run time: {scene.name}"
    return Plot(title, f"final error [{unit}]", "time [s]", curves, "xy", headline=scene.headline)


def _ratio(fmu: Fmu) -> Iterator[Result]:
    scene = next(s for s in SCENES if isinstance(s, WorkScene) and s.headline)
    of_scipy = {
        solver: scipy_points(scene.name, solver, tuple(np.arange(3, 13.6, spacing)))
        for solver, spacing in (("RK45", 1.0), ("DOP853", 0.5), ("LSODA", 0.25), ("odeint", 0.25))
    }
    sweep = [fmu_point(fmu, scene, RK4, 2.0**-k, scene.step) for k in range(4, 13)]
    rows = []
    ratios: dict[str, list[float]] = {family: [] for family in FAMILIES}
    for target in TARGETS:
        h = _step_for(fmu, scene, target, sweep)
        rivals = {family: _fastest(of_scipy, solvers, target) for family, solvers in FAMILIES.items()}
        times = _race(fmu, scene, h, rivals)
        measured = {family: _against(times, family) for family in FAMILIES}
        if target in FASTER_AT:
            yield _faster(fmu, target, h, rivals["solve_ivp"], measured["solve_ivp"])
        for family, ratio in measured.items():
            ratios[family].append(nan if ratio is None else ratio.median)
        fastest = {name: min(seconds) for name, seconds in times.items()}
        of_rivals = [x for family in FAMILIES for x in (*rivals[family], fastest.get(family, ""))]
        shown = [_interval(ratio) for ratio in measured.values()]
        rows.append((f"{target:.0e}", METHOD_NAMES[RK4], h, fastest["FMU"], *of_rivals, *shown))
    yield Table(
        "What to use to reach an error, undamped 90 deg over 10 periods",
        (
            *("error [rad]", "method", "h [s]", "time [s]"),
            *("best of solve_ivp", "tolerance", "time [s]"),
            *("odeint", "tolerance", "time [s]"),
            *("solve_ivp/FMU", "odeint/FMU"),
        ),
        rows,
        note="solve_ivp: best of RK45, DOP853, LSODA; odeint is the older interface to LSODA, all in Fortran but the "
        "right-hand side. SciPy gets a right-hand side of math.sin and tuples and the tolerance that suits it best. "
        f"Times are the shortest, ratios medians of {races.ROUNDS} rounds with their "
        f"{100 * races.CONFIDENCE:g} percent intervals.",
    )
    yield Note(_conclusion(ratios), headline=True)
    yield from _communication(fmu, scene, of_scipy)


def _fastest(of_scipy: dict[str, list[Point]], solvers: Sequence[str], target: float) -> tuple[str, float]:
    """Return the solver and the tolerance that reach the target first, ("none", NaN) if none does."""
    reaching = [
        (p.seconds, solver, p.label) for solver in solvers for p in of_scipy[solver] if p.error <= target
    ]
    return min(reaching, default=(inf, "none", nan))[1:]


def _step_for(fmu: Fmu, scene: WorkScene, target: float, sweep: Sequence[Point]) -> float:
    """Return a step that reaches the target by a little."""
    for coarse, fine in pairwise(sweep):
        if fine.error <= target < coarse.error:
            slope = log(coarse.error / fine.error) / log(coarse.label / fine.label)
            h = float(fine.label * (target / fine.error) ** (1 / slope))
            while fmu_point(fmu, scene, RK4, h, scene.step, spend=0.0).error > target:
                h *= 0.97
            return h
    raise ValueError(f"no step of the sweep reaches an error of {target}")


def _race(
    fmu: Fmu, scene: WorkScene, h: float, rivals: dict[str, tuple[str, float]]
) -> dict[str, list[float]]:
    """Return the times [s] of the FMU and of those rivals that reach the error, a number a round."""
    experiment = _experiment(scene, RK4, h, scene.step, ())
    runners: dict[str, races.Runner] = {"FMU": lambda: fmu.run(experiment).seconds}
    for family, (solver, tolerance) in rivals.items():
        if not isnan(tolerance):
            runners[family] = partial(_scipy_seconds, scene, solver, tolerance)
    return races.race(runners, spend=SCIPY_SPEND)


def _scipy_seconds(scene: WorkScene, solver: str, tolerance: float) -> float:
    return scipy_point(scene, solver, tolerance, repeats=1).seconds


def _against(times: dict[str, list[float]], rival: str) -> Ratio | None:
    """Return how many times as fast as `rival` the FMU was, None if that did not take part."""
    return races.ratio(times[rival], times["FMU"]) if rival in times else None


def _faster(fmu: Fmu, target: float, h: float, rival: tuple[str, float], measured: Ratio | None) -> Check:
    name = f"time: FMU against the best of solve_ivp at an error of {target:.0e}"
    if measured is None:
        return races.not_measured(name, FASTER_BY[fmu.native], "no solver of solve_ivp reaches this error")
    solver, tolerance = rival
    reason = f"RK4 with h = {h:.3g} s, 1 s communication step; {solver} with tolerance {tolerance:.1e}"
    return races.at_least(name, measured, FASTER_BY[fmu.native], reason)


def _interval(ratio: Ratio | None) -> str:
    return "none" if ratio is None else f"{ratio.median:.3g} ({ratio.low:.3g} to {ratio.high:.3g})"


def _conclusion(ratios: dict[str, list[float]]) -> str:
    ivp, ivp_at = min(
        (ratio, target)
        for ratio, target in zip(ratios["solve_ivp"], TARGETS, strict=True)
        if not isnan(ratio)
    )
    lost = [f"{target:.0e}" for ratio, target in zip(ratios["odeint"], TARGETS, strict=True) if ratio < 2]
    return (
        "For an undamped swing from 90 deg over 10 periods the FMU with RK4 and a communication step of 1 s reaches an "
        f"error of 1e-3 {ratios['solve_ivp'][0]:.1f} times, of 1e-6 {ratios['solve_ivp'][3]:.1f} times and of 1e-9 "
        f"{ratios['solve_ivp'][6]:.1f} times as fast as the best of solve_ivp "
        f"(least: {ivp:.1f} times, at {ivp_at:.0e}). "
        f"It is less than twice as fast as odeint at {', '.join(lost) or 'no error'}. "
        "Use RK4; the Euler methods are for teaching, and ImplicitEuler for stiff drag."
    )


def _communication(fmu: Fmu, scene: WorkScene, of_scipy: dict[str, list[Point]]) -> Iterator[Result]:
    target = 1e-6
    reaching = (p.seconds for s in FAMILIES["solve_ivp"] for p in of_scipy[s] if p.error <= target)
    best = min(reaching, default=nan)
    h = 0.0125
    points = [fmu_point(fmu, scene, RK4, h, step, spend=0.1) for step in COMMUNICATION_STEPS]
    yield Table(
        "How the communication step eats the advantage: RK4, h = 0.0125 s, undamped 90 deg over 10 periods",
        ("communication step [s]", "final error [rad]", "time [s]", "best of solve_ivp at 1e-6 [s]", "ratio"),
        [
            (step, p.error, p.seconds, best, best / p.seconds)
            for step, p in zip(COMMUNICATION_STEPS, points, strict=True)
        ],
    )


def _substeps(fmu: Fmu) -> Iterator[Result]:
    with ExitStack() as stack:
        carriers = {fmu.native: fmu}
        loops: dict[bool, Loop] = {False: python_loop}
        if _beside(fmu).is_file():
            carriers[not fmu.native] = stack.enter_context(Fmu(_beside(fmu)))
        else:
            yield Note(f"Left out: the races with the other carrier, because there is no {_beside(fmu)}.")
        if True in carriers:
            try:
                loops[True] = c_loop(Path(stack.enter_context(tempfile.TemporaryDirectory())))
            except NoCompilerError as error:
                yield Note(f"Left out: the race of the native FMU against a {LOOP_NAMES[True]}: {error}.")
        yield from _race_substeps(carriers, {native: loops[native] for native in carriers if native in loops})


def _race_substeps(carriers: dict[bool, Fmu], loops: dict[bool, Loop]) -> Iterator[Result]:
    long = Experiment(SUBSTEPS * SUBSTEP, SUBSTEPS * SUBSTEP, {"tau": TORQUE}, record=())
    runners = {_carrier(carrier): partial(_seconds, carrier, long) for carrier in carriers.values()}
    runners |= {LOOP_NAMES[native]: partial(_loop_seconds, loop) for native, loop in loops.items()}
    times = races.race(runners)
    what = f"RK4, {SUBSTEPS} substeps in one communication step, all terms act"
    for native in loops:
        carrier, loop = _carrier(carriers[native]), LOOP_NAMES[native]
        yield races.at_most(
            f"time: substep of the {carrier} against a {loop}",
            races.ratio(times[carrier], times[loop]),
            NO_SLOWER_THAN[native],
            f"{what}; the loop is written for this pendulum alone",
        )
    if len(carriers) < 2:
        return
    yield _native_is_faster("substep", times, SUBSTEPS, what)
    short = Experiment(20.0, 100 * SUBSTEP, {"tau": TORQUE}, record=())
    times = races.race(
        {_carrier(carrier): partial(_seconds, carrier, short) for carrier in carriers.values()}
    )
    reason = "RK4, all terms act; the call from Python counts for both"
    yield _native_is_faster("communication step of 100 substeps", times, 100, reason)


def _native_is_faster(what: str, times: dict[str, list[float]], substeps: int, reason: str) -> Check:
    name = f"time: {what} of the FMU in units of that of the native FMU"
    ratio = races.ratio(times["FMU"], times["native FMU"])
    return races.at_least(name, ratio, NATIVE_FASTER_BY[substeps], reason)


def _seconds(fmu: Fmu, experiment: Experiment) -> float:
    return fmu.run(experiment).seconds


def _loop_seconds(loop: Loop) -> float:
    """Return the time [s] of the default pendulum under `TORQUE` in a bare loop."""
    begin = clock()
    loop(TORQUE, 0.002, W02, pi / 6, 0.0, SUBSTEP, SUBSTEPS)
    return clock() - begin


def _cost(fmu: Fmu) -> Iterator[Result]:
    rows = []
    for method in METHOD_NAMES:
        start = {"gamma": 0.0, "solver.method": method}
        long, short = (
            Experiment(n * step, step, start | {"solver.stepSize": h}, record=())
            for n, step, h in ((10, 1.0, 1e-3), (2000, 1e-3, 1e-3))
        )
        substep = min(fmu.run(long).seconds for _ in range(REPEATS)) / 10_000
        step = min(fmu.run(short).seconds for _ in range(REPEATS)) / 2000
        rows.append((METHOD_NAMES[method], step - substep, substep, (step - substep) / substep))
    yield Table(
        "Cost of a call of doStep and of a substep",
        ("method", "call [s]", "substep [s]", "substeps that cost as much as a call"),
        rows,
    )


def _saving(fmu: Fmu) -> Iterator[Result]:
    """Compare an undamped free swing with the same swing under a drag too small to change a bit."""
    negligible = 1e-300
    runs, times = [], []
    for gamma in (0.0, negligible):
        experiment = Experiment(10.0, 1.0, {"gamma": gamma}, record=("phi", "w"))
        results = [fmu.run(experiment) for _ in range(2 * REPEATS)]
        runs.append(results[0])
        times.append(min(result.seconds for result in results))
    difference = largest(float(np.max(np.abs(runs[0][name] - runs[1][name]))) for name in ("phi", "w"))
    yield Check(
        "the full form gives the same numbers as the one without drag",
        difference,
        0.0,
        f"a term of 1e-300 is lost in the sum; leaving it out takes {times[0] / times[1]:.2f} of the time",
        "rad",
    )
