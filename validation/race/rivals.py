"""The rivals: integrators of SciPy and heyoka, each with the fastest right-hand side that it takes.

A rival is a `Solver`: what makes it ready is apart, then it goes from 0 to the end of the scene and returns the angle
and the rate on the grid. All of them get the same relative and absolute tolerance, the latter in units of the scene's
scale.
"""

from __future__ import annotations

import tempfile
import warnings
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

LONGEST_DRIVEN = (
    0.25  # steps [s] under a drive: from rest the first ones are else so long that they miss the pulse
)
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


def in_python(scene: Scene) -> RightHandSide:
    """Return the right-hand side with the acting terms alone, in the form that was fastest of those tried."""
    k2, drive = scene.k2, scene.drive
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


def compiled(scene: Scene) -> RightHandSide:
    """Return the right-hand side as a function in C that returns one and the same array.

    Raises
    ------
    NoCompilerError : there is no C compiler, or none that finds the headers of Python
    """
    peak, center, variance = scene.drive or (0.0, 0.0, 1.0)
    function: RightHandSide = _compiled_module().function(np.empty(2), scene.k2, W02, peak, center, variance)
    return function


# SciPy


def _solve_ivp(method: type[Any], with_jacobian: bool, scene: Scene, tolerance: float, cut_off: float) -> Run:
    """Return a run of a method of solve_ivp, in the loop that solve_ivp has over its steps."""
    f, y0, grid = in_python(scene), [scene.phi0, scene.rate0], scene.grid
    options: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * scene.scale}
    if with_jacobian:
        options["jac"] = jacobian(scene)
    if scene.drive is not None:
        options["max_step"] = LONGEST_DRIVEN

    def run() -> Outcome:
        solver = method(f, 0.0, y0, scene.stop, **options)
        columns, reached = [solver.y], 1
        begin = clock()
        while solver.status == "running" and (cut_off == inf or clock() - begin < cut_off):
            solver.step()
            passed = reached
            while passed < len(grid) and grid[passed] <= solver.t:
                passed += 1
            if passed > reached:
                columns += solver.dense_output()(np.array(grid[reached:passed])).T.tolist()
                reached = passed
        seconds = clock() - begin
        phi, w = np.array(columns, dtype=float).T
        failure = {"running": f"cut off at {cut_off:g} s", "failed": "gave up"}.get(solver.status, "")
        return Outcome(seconds, phi, w, solver.nfev, failure)

    return run


def _odeint(
    right_hand_side: Callable[[Scene], RightHandSide],
    with_jacobian: bool,
    scene: Scene,
    tolerance: float,
    _: float,
) -> Run:
    f, y0, grid = right_hand_side(scene), [scene.phi0, scene.rate0], np.array(scene.grid)
    options: dict[str, Any] = {"rtol": tolerance, "atol": tolerance * scene.scale}
    if with_jacobian and scene.k2 > 1:
        options["Dfun"] = jacobian(scene)
    if scene.drive is not None:
        options["hmax"] = LONGEST_DRIVEN

    def run() -> Outcome:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what went wrong is in the message, too
            begin = clock()
            y, info = odeint(f, y0, grid, tfirst=True, mxstep=10**6, full_output=True, **options)
            seconds = clock() - begin
        failure = "" if info["message"] == "Integration successful." else "gave up"
        return Outcome(seconds, y[:, 0], y[:, 1], float(info["nfe"][-1]), failure)

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


# heyoka


@cache
def _taylor_integrator(k2: float, drive: Any, tolerance: float) -> Any:
    """Return heyoka's integrator, compiled for this equation and tolerance."""
    import heyoka

    phi, w = heyoka.make_vars("phi", "w")
    a = -W02 * heyoka.sin(phi)
    if k2:
        a = a - k2 * w
    if drive is not None:
        a = a + drive.peak * heyoka.exp((heyoka.time - drive.center) ** 2.0 * (-1 / (2 * drive.variance)))
    return heyoka.taylor_adaptive([(phi, w), (w, a)], [0.0, 0.0], tol=tolerance, fast_math=True)


def _heyoka(scene: Scene, tolerance: float, cut_off: float, ends_only: bool = False) -> Run:
    integrator = _taylor_integrator(scene.k2, scene.drive, tolerance)
    longest = inf if scene.drive is None else LONGEST_DRIVEN
    steps = 0 if cut_off == inf else int(cut_off / 2e-7)  # one takes 0.2 us or more; 0: any number
    grid = np.array(scene.grid)

    def run() -> Outcome:
        integrator.time = 0.0
        integrator.state[:] = scene.phi0, scene.rate0
        begin = clock()
        if ends_only:
            integrator.propagate_until(scene.stop, max_steps=steps)
            seconds = clock() - begin
            y = np.array([[scene.phi0, scene.rate0], integrator.state])
        else:
            y = integrator.propagate_grid(grid, max_delta_t=longest, max_steps=steps)[-1]
            seconds = clock() - begin
        finished = len(y) == len(grid) or ends_only
        failure = "" if finished and integrator.time == scene.stop else f"cut off at {steps} steps"
        return Outcome(seconds, y[:, 0], y[:, 1], nan, failure)

    return run


def heyoka_to_the_end() -> Solver:
    """Return heyoka without the grid."""
    knobs = tuple(10.0 ** (-8 - i / 2) for i in range(17))
    return Solver(HEYOKA, HEYOKA, knobs, partial(_heyoka, ends_only=True))


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
