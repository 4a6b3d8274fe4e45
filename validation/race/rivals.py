"""The rivals: integrators of SciPy and heyoka, each with the fastest right-hand side that it takes.

A rival is a `Solver`: what makes it ready is apart, then it goes from 0 to the end of the scene and returns the angle
and the rate on the grid. All of them get the same relative and absolute tolerance, the latter in units of the scene's
scale.
"""

from __future__ import annotations

import tempfile
import warnings
from bisect import bisect_left
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.machinery import ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from math import cos, exp, inf, nan, sin
from pathlib import Path
from sysconfig import get_path
from typing import Any

import numpy as np
from scipy.integrate import BDF, DOP853, LSODA, RK45, Radau, odeint

from ..fmu import W02
from ..races import clock
from ..references import Array
from .compiler import NoCompilerError, shared_library
from .scenes import Scene

# Steps [s] under a drive: from rest the first ones are else so long that they miss the pulse.
LONGEST_DRIVEN = 0.25
LEAST_TOLERANCE = 3e-14  # what SciPy's Runge-Kutta methods accept, a relative 100 ulp
SOURCE = Path(__file__).resolve().parent / "right_hand_side.c"

RightHandSide = Callable[[float, Array], Sequence[float]]


@dataclass(frozen=True)
class Outcome:
    """A run: its time [s] without set-up, phi [rad] and w [rad/s] on the grid, and why they end early, "" if not.

    `evaluations` are those of the acceleration, NaN for a solver that has none.
    """

    seconds: float
    phi: Array
    w: Array
    evaluations: float
    failure: str = ""


Run = Callable[[], Outcome]


@dataclass(frozen=True)
class Solver:
    """A way to integrate a scene.

    Attributes
    ----------
    family : what it is compared as
    knobs : values of what its accuracy depends on, a tolerance or a number of substeps, from the cheapest
    prepare : returns what runs a scene with such a value, as often as it is called, cut off after a time [s]
    counts_substeps : whether they are numbers of substeps, any of which between two of them does, too
    cut_off : a run that takes longer [s] is the last one, or is ended
    """

    name: str
    family: str
    knobs: Sequence[float]
    prepare: Callable[[Scene, float, float], Run]
    counts_substeps: bool = False
    cut_off: float = 0.1


def tolerances(spacing: float, least: float = LEAST_TOLERANCE) -> tuple[float, ...]:
    """Return 10^-2, 10^(-2-spacing), ... down to `least`."""
    count = int(-(np.log10(least) + 2) / spacing)
    return (*(10.0 ** (-2 - i * spacing) for i in range(count + 1)), least)


# The equation


def in_python(scene: Scene, held: float = 0.0) -> RightHandSide:
    """Return the right-hand side with the acting terms alone, in the form that was fastest of those tried."""
    k2, drive = scene.k2, scene.drive
    if scene.held:

        def pushed(_: float, y: Array) -> Sequence[float]:
            phi, w = y.tolist()
            return [w, held - k2 * w - W02 * sin(phi)]

        return pushed
    if drive is not None:
        peak, center, factor = drive.peak, drive.center, -1 / (2 * drive.variance)

        def driven(t: float, y: Array) -> Sequence[float]:
            phi, w = y.tolist()
            return [w, peak * exp(factor * (t - center) ** 2) - k2 * w - W02 * sin(phi)]

        return driven
    if k2:

        def damped(_: float, y: Array) -> Sequence[float]:
            phi, w = y.tolist()
            return [w, -k2 * w - W02 * sin(phi)]

        return damped

    def undamped(_: float, y: Array) -> Sequence[float]:
        phi, w = y.tolist()
        return [w, -W02 * sin(phi)]

    return undamped


def jacobian(scene: Scene) -> Callable[[float, Array], Sequence[Sequence[float]]]:
    """Return the matrix of partial derivatives for the implicit methods."""
    k2 = scene.k2
    return lambda _, y: [[0.0, 1.0], [-W02 * cos(y[0]), -k2]]


@cache
def _compiled_module() -> Any:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        library = shared_library(SOURCE, Path(folder), f"-I{get_path('include')}")
        loader = ExtensionFileLoader(SOURCE.stem, str(library))
        spec = spec_from_file_location(SOURCE.stem, library, loader=loader)
        assert spec is not None
        module = module_from_spec(spec)
        loader.exec_module(module)
    return module


def compiled(scene: Scene, held: float = 0.0) -> RightHandSide:
    """Return the right-hand side as a function in C that returns one and the same array.

    Raises
    ------
    NoCompilerError : there is no C compiler, or none that finds the headers of Python
    """
    gaussian = scene.drive or (0.0, 0.0, 1.0)
    function: RightHandSide = _compiled_module().function(np.empty(2), scene.k2, W02, held, *gaussian)
    return function


# SciPy. Where the drive jumps, its integrators begin anew. They find the first step themselves: to give them that of
# before saves nothing, and odeint's `tcrit` in one run takes up to twice the evaluations, or the run fails.


def _solve_ivp(method: type[Any], with_jacobian: bool, scene: Scene, tolerance: float, cut_off: float) -> Run:
    """Return a run of a method of solve_ivp, in the loop that solve_ivp has over its steps."""
    pieces = [(in_python(scene, held), times) for held, times in scene.pieces]
    options: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * scene.scale}
    if with_jacobian:
        options["jac"] = jacobian(scene)
    if scene.drive is not None:
        options["max_step"] = LONGEST_DRIVEN

    def start(piece: int, y: Sequence[float]) -> Any:
        f, times = pieces[piece]
        return method(f, times[0], y, times[-1], **options)

    def run() -> Outcome:
        solver, evaluations = start(0, [scene.phi0, scene.rate0]), 0
        columns = [solver.y[:, np.newaxis]]
        begin = clock()
        for piece, (_, times) in enumerate(pieces):
            if piece:
                solver = start(piece, solver.y)
            reached = 1
            while solver.status == "running" and (cut_off == inf or clock() - begin < cut_off):
                solver.step()
                passed = bisect_left(times, solver.t, reached)
                if passed > reached:
                    columns.append(solver.dense_output()(np.array(times[reached:passed])))
                if passed < len(times) and times[passed] == solver.t:
                    columns.append(solver.y[:, np.newaxis])
                    passed += 1
                reached = passed
            evaluations += solver.nfev
            if solver.status != "finished":
                break
        seconds = clock() - begin
        phi, w = np.concatenate(columns, axis=1)
        failure = {"running": f"cut off at {cut_off:g} s", "failed": "gave up"}.get(solver.status, "")
        return Outcome(seconds, phi, w, evaluations, failure)

    return run


def _odeint(
    right_hand_side: Callable[[Scene, float], RightHandSide],
    with_jacobian: bool,
    scene: Scene,
    tolerance: float,
    _: float,
) -> Run:
    pieces = [(right_hand_side(scene, held), np.array(times)) for held, times in scene.pieces]
    options: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * scene.scale}
    if with_jacobian and scene.k2 > 1:
        options["Dfun"] = jacobian(scene)
    if scene.drive is not None:
        options["hmax"] = LONGEST_DRIVEN

    def run() -> Outcome:
        rows, evaluations, failure = [np.array([[scene.phi0, scene.rate0]])], 0, ""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what went wrong is in the message, too
            begin = clock()
            for f, times in pieces:
                y, info = odeint(
                    f, rows[-1][-1], times, tfirst=True, mxstep=10**6, full_output=True, **options
                )
                rows.append(y[1:])
                evaluations += int(info["nfe"][-1])
                if info["message"] != "Integration successful.":
                    failure = "gave up"
                    break
            seconds = clock() - begin
        phi, w = np.concatenate(rows).T
        return Outcome(seconds, phi, w, evaluations, failure)

    return run


SOLVE_IVP = "solve_ivp"
ODEINT = "odeint"
COMPILED_ODEINT = "odeint, f in C"
HEYOKA = "heyoka"
PATIENT = 0.4  # cut-off [s] of the rivals that are fastest where nothing is stiff

PYTHON_RIVALS = (
    Solver("DOP853", SOLVE_IVP, tolerances(1.0), partial(_solve_ivp, DOP853, False), cut_off=PATIENT),
    Solver("LSODA", SOLVE_IVP, tolerances(0.25), partial(_solve_ivp, LSODA, True), cut_off=PATIENT),
    Solver("RK45", SOLVE_IVP, tolerances(1.0), partial(_solve_ivp, RK45, False)),
    Solver("Radau", SOLVE_IVP, tolerances(1.0), partial(_solve_ivp, Radau, True)),
    Solver("BDF", SOLVE_IVP, tolerances(1.0), partial(_solve_ivp, BDF, True)),
    Solver(ODEINT, ODEINT, tolerances(0.25), partial(_odeint, in_python, True), cut_off=PATIENT),
)


# heyoka. From rest at 90 deg the last coefficients vanish with some tolerances, and it takes that for an endless step;
# its ladder goes past them.


@cache
def _taylor_integrator(k2: float, drive: Any, held: bool, tolerance: float) -> Any:
    """Return heyoka's integrator, compiled for this equation and tolerance; a held drive is its parameter."""
    import heyoka

    phi, w = heyoka.make_vars("phi", "w")
    a = -W02 * heyoka.sin(phi)
    if k2:
        a = a - k2 * w
    if drive is not None:
        a = a + drive.peak * heyoka.exp((heyoka.time - drive.center) ** 2.0 * (-1 / (2 * drive.variance)))
    if held:
        a = a + heyoka.par[0]
    return heyoka.taylor_adaptive([(phi, w), (w, a)], [0.0, 0.0], tol=tolerance, fast_math=True)


def _heyoka(scene: Scene, tolerance: float, cut_off: float) -> Run:
    integrator = _taylor_integrator(scene.k2, scene.drive, bool(scene.held), tolerance)
    longest = inf if scene.drive is None else LONGEST_DRIVEN
    steps = 0 if cut_off == inf else int(cut_off / 2e-7)  # one takes 0.2 us or more; 0: any number
    pieces = [(held, np.array(times)) for held, times in scene.pieces]

    def run() -> Outcome:
        integrator.time = 0.0
        integrator.state[:] = scene.phi0, scene.rate0
        rows = [np.array([[scene.phi0, scene.rate0]])]
        begin = clock()
        for held, times in pieces:
            if scene.held:
                integrator.pars[0] = held
            if len(times) == 2:  # the end alone is faster without a grid
                integrator.propagate_until(times[1], max_delta_t=longest, max_steps=steps)
                rows.append(integrator.state[np.newaxis].copy())
            else:
                rows.append(integrator.propagate_grid(times, max_delta_t=longest, max_steps=steps)[-1][1:])
            if integrator.time != times[-1]:
                break
        seconds = clock() - begin
        phi, w = np.concatenate(rows).T
        failure = "" if integrator.time == scene.stop else f"cut off at {steps} steps"
        return Outcome(seconds, phi, w, nan, failure)

    return run


def heyoka_to_the_end() -> Solver:
    """Return heyoka with the knobs of a race in a single step."""
    return Solver(HEYOKA, HEYOKA, tuple(10.0 ** (-8 - i / 2) for i in range(17)), _heyoka)


def compiled_rivals() -> Iterator[Solver | str]:
    """Yield the rivals of the native FMU, and of those that this machine does not have what they need."""
    if find_spec("heyoka") is not None:
        yield Solver(HEYOKA, HEYOKA, tolerances(1.0, 1e-16), _heyoka)
    else:
        yield "heyoka is left out: pip install '.[peers]'"
    try:
        _compiled_module()
    except NoCompilerError as error:
        yield f"SciPy's odeint with a right-hand side in C is left out: {error}"
    else:
        yield Solver(COMPILED_ODEINT, COMPILED_ODEINT, tolerances(0.25), partial(_odeint, compiled, False))
