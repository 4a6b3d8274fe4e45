"""What a substep costs and what a call: the FMUs against bare loops, each other, and rivals that are called once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from math import ceil, inf
from pathlib import Path

import numpy as np

from .. import loops, races
from ..checks import Curve, Note, Plot, Result, Table
from ..fmu import DEFAULT_PATH, DEFAULTS, K2, NATIVE_NAME, W02, Experiment, Fmu, SolverMethod
from ..loops import Loop
from ..races import clock
from ..styles import STYLES
from . import carriers, contest
from .compiler import NoCompilerError
from .contest import Rung
from .judging import GROUPS, raced
from .rivals import Run
from .scenes import UNDAMPED

RK4 = SolverMethod.ExplicitRungeKutta4
EXPLICIT = (SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2, RK4, SolverMethod.TaylorSeries)

SUBSTEP = 0.01  # of the races of substeps [s]
# Of such a race, all in one communication step: so many that a call of the native FMU is 5 percent of it or less.
SUBSTEPS = {SolverMethod.TaylorSeries: 500, SolverMethod.SDIRK4: 1000}
MANY = 5000  # of the others
TORQUE = 0.1  # lets every term of the equation act [N.m]
LOOP_NAMES = {False: "bare loop in Python", True: "bare loop in C"}  # by whether the FMU is native
NO_SLOWER_THAN = {False: 1.4, True: 1.25}  # a substep of the FMU in units of that of the bare loop
NATIVE_FASTER_BY = 10.0
FEW = 100  # substeps in a communication step
NATIVE_FASTER_BY_WITH_FEW = 7.0
SPEND = 2e-3  # of each runner in a round [s]


def _carrier(native: bool) -> str:
    return "native FMU" if native else "FMU"


def _beside(fmu: Fmu) -> Path:
    """Return where the FMU that carries the same model otherwise lies, if it was built."""
    return fmu.path.with_name(DEFAULT_PATH.name if fmu.native else NATIVE_NAME)


@cache
def substeps(fmu: Fmu) -> tuple[Result, ...]:
    """Return a substep of each method in the FMUs against bare loops, and one carrier against the other."""
    return tuple(_substeps(fmu))


def _substeps(fmu: Fmu) -> Iterator[Result]:
    with ExitStack() as stack:
        fmus = {fmu.native: fmu}
        bare: dict[bool, Mapping[str, Loop]] = {False: loops.PYTHON_LOOPS}
        if _beside(fmu).is_file():
            fmus[not fmu.native] = stack.enter_context(Fmu(_beside(fmu)))
        else:
            yield Note(f"Left out: the races with the other carrier, because there is no {_beside(fmu)}.")
        if True in fmus:
            try:
                bare[True] = loops.c_loops()
            except NoCompilerError as error:
                yield Note(f"Left out: the race of the native FMU against a {LOOP_NAMES[True]}: {error}.")
        yield from _race_substeps(fmus, {native: bare[native] for native in fmus if native in bare})


def _race_substeps(fmus: Mapping[bool, Fmu], bare: Mapping[bool, Mapping[str, Loop]]) -> Iterator[Result]:
    runners: dict[tuple[str, str], races.Runner] = {}
    for method in SolverMethod:
        for native, fmu in fmus.items():
            runners[_carrier(native), method.name] = partial(_seconds, fmu, _held(method, _many(method)))
        for native, of_method in bare.items():
            runners[LOOP_NAMES[native], method.name] = partial(
                _loop_seconds, of_method[method.name], _many(method)
            )
    times = races.race(runners, spend=SPEND)
    what = "all substeps in one communication step, all terms act"
    for native in bare:
        carrier, loop = _carrier(native), LOOP_NAMES[native]
        for method in SolverMethod:
            yield races.at_most(
                f"time: substep of {method.name} in the {carrier} against a {loop}",
                races.ratio(times[carrier, method.name], times[loop, method.name]),
                NO_SLOWER_THAN[native],
                f"{what}; the loop is written for this pendulum alone",
            )
    columns = ("method", *(f"{name} [us]" for name in dict.fromkeys(name for name, _ in runners)))
    rows = [
        (
            method.name,
            *(
                f"{1e6 * np.median(of) / _many(method):.3g}"
                for (_, name), of in times.items()
                if name == method.name
            ),
        )
        for method in SolverMethod
    ]
    yield Table("Time of a substep, median", columns, rows)
    if len(fmus) == 2:
        yield from _native_is_faster(fmus, times, what)


def _native_is_faster(
    fmus: Mapping[bool, Fmu], times: Mapping[tuple[str, str], list[float]], what: str
) -> Iterator[Result]:
    for method in EXPLICIT:
        ratio = races.ratio(times[_carrier(False), method.name], times[_carrier(True), method.name])
        name = f"time: substep of {method.name} in the FMU in units of that in the native FMU"
        yield races.at_least(name, ratio, NATIVE_FASTER_BY, what)
    short = _held(RK4, FEW, 20)
    of = races.race({native: partial(_seconds, fmu, short) for native, fmu in fmus.items()})
    yield races.at_least(
        f"time: communication step of {FEW} substeps of the FMU in units of that of the native FMU",
        races.ratio(of[False], of[True]),
        NATIVE_FASTER_BY_WITH_FEW,
        "RK4, all terms act; the call from Python counts for both",
    )


def _held(method: int, substeps: int, steps: int = 1) -> Experiment:
    """Return a run of communication steps of so many substeps under a held torque, of which nothing is recorded."""
    step = substeps * SUBSTEP
    start = {"tau": TORQUE, "solver.method": method, "solver.stepSize": SUBSTEP}
    return Experiment(steps * step, step, start, record=())


def _seconds(fmu: Fmu, experiment: Experiment) -> float:
    return fmu.run(experiment).seconds


def _many(method: SolverMethod) -> int:
    return SUBSTEPS.get(method, MANY)


def _loop_seconds(loop: Loop, substeps: int) -> float:
    """Return the time [s] of the default pendulum under `TORQUE` in a bare loop."""
    begin = clock()
    loop(TORQUE, K2, W02, DEFAULTS["phi_start"], 0.0, SUBSTEP, substeps)
    return clock() - begin


def cost(fmu: Fmu) -> Iterator[Result]:
    """Yield what a call of doStep costs, and what a substep costs."""
    many, one = 500, 500
    runners = {}
    for method in SolverMethod:
        runners[method, many] = partial(_seconds, fmu, _held(method, many))
        runners[method, 1] = partial(_seconds, fmu, _held(method, 1, one))
    times = races.race(runners, contest.ROUNDS, 0.0)
    rows = []
    for method in SolverMethod:
        substep = float(np.median(times[method, many])) / many
        step = float(np.median(times[method, 1])) / one
        call = step - substep
        rows.append((method.name, f"{1e6 * call:.3g}", f"{1e6 * substep:.3g}", f"{call / substep:.3g}"))
    yield Table(
        "Cost of a call of doStep and of a substep",
        ("method", "call [us]", "substep [us]", "substeps that cost as much as a call"),
        rows,
        "Called from Python by ctypes; default drag and a held torque, so that all terms act.",
    )


STEPS = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001)  # communication steps [s]
FITTED_TO, ERROR = UNDAMPED[1], 1e-6
SWING = replace(FITTED_TO, stop=2.0)  # the same motion, of which a part is enough


def communication(fmu: Fmu) -> Iterator[Result]:
    """Yield how the communication step eats the advantage over the rivals, which return the same points."""
    race = raced(fmu, FITTED_TO)
    fastest = [race.fastest(names, ERROR) for names in GROUPS[fmu.native].values()]
    (rk4,) = (solver for solver in carriers.solvers(fmu) if solver.name == RK4.name)
    rungs = [contest.fitted(rk4, FITTED_TO, ERROR), *(race.rungs[key] for key in fastest if key)]
    runs = {(rung.solver.name, step): _often(rung, step) for rung in rungs if rung for step in STEPS}
    times = {key: float(np.median(of)) for key, of in contest.timed(runs, SPEND).items()}
    names = list(dict.fromkeys(name for name, _ in times))
    title = f"Run time against the communication step, {_carrier(fmu.native)}: 90 deg, {SWING.stop:g} s"
    note = (
        f"Steps and tolerances are those that reach {ERROR:.0e} in {FITTED_TO.stop:g} s. All return phi and w at every "
        "communication point: the FMU is called for each, the rivals interpolate within their steps."
    )
    columns = ("communication step [s]", *(f"{name} [ms]" for name in names))
    rows = [(f"{step:g}", *(f"{1e3 * times[name, step]:.3g}" for name in names)) for step in STEPS]
    yield Table(title, columns, rows)
    curves = [
        Curve(name, STEPS, [times[name, step] for step in STEPS], STYLES[name].line, STYLES[name].marker)
        for name in names
    ]
    yield Plot(title, columns[0], "time [s]", curves, "xy", note)


def _often(rung: Rung, step: float) -> Run:
    """Return the run of a solver that is fitted, but with another communication step [s]."""
    knob = ceil(rung.knob * step / FITTED_TO.step) if rung.solver.counts_substeps else rung.knob
    return rung.solver.prepare(replace(SWING, points=round(SWING.stop / step)), knob, inf)
