"""Tables and pictures of races."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..checks import Curve, Plot, Table
from ..fmu import Fmu
from ..races import Ratio
from ..styles import STYLES
from . import carriers, contest
from .contest import Race, Rung, ladder
from .judging import GROUPS, OURS, compare, raced, rivals, why_not
from .machine import provenance
from .rivals import Solver
from .scenes import COARSE, SCENES, STIFF, Scene


def shown(scene: Scene, solver: Solver, knob: float) -> float:
    """Return the step [s] of a method of the FMU, the tolerance of a rival."""
    return scene.step / knob if solver.counts_substeps else knob


def percentiles(times: Sequence[float]) -> tuple[float, float, float]:
    """Return the median, the 10th and the 90th percentile."""
    low, median, high = np.percentile(times, (10, 50, 90)).tolist()
    return median, low, high


def interval(ratio: Ratio | None) -> str:
    """Return a ratio as a cell."""
    return "" if ratio is None else f"{ratio.median:.3g} ({ratio.low:.3g} to {ratio.high:.3g})"


# Tables

STIFFLY_STABLE = tuple(name for name in OURS if name != "ImplicitTrapezoid")


def fastest(fmu: Fmu, scene: Scene) -> Table:
    """Return who is the fastest of each group to every error of the scene."""
    race = raced(fmu, scene)
    groups = {"FMU": OURS, **GROUPS[fmu.native]}
    columns = ["error", "method of the FMU", "h [s]", "time [ms]"]
    for group in GROUPS[fmu.native]:
        columns += [group, "tolerance", "time [ms]", f"{group}/FMU"]
    rows = []
    for error in scene.targets:
        row: list[object] = [f"{error:.0e}"]
        for group, names in groups.items():
            key = race.fastest(names, error)
            if key is None:
                chosen = [solver for solver in _solvers(fmu) if solver.name in names]
                row += [why_not(chosen, scene, error), "", ""]
            else:
                median, low, high = (1e3 * seconds for seconds in percentiles(race.times[key]))
                knob = f"{shown(scene, race.rungs[key].solver, key[1]):.3g}"
                row += [key[0], knob, f"{median:.3g} ({low:.3g} to {high:.3g})"]
            if group != "FMU":
                row.append(interval(compare(race, OURS, names, error).ratio))
        rows.append(row)
    note = (
        "Errors are the largest on the grid of communication points. The FMU's step is fitted to the error to "
        f"{100 * contest.FINENESS:g} percent, tolerances are on a grid of a decade or less. Times: median and from "
        "the 10th to the 90th percentile of the rounds; ratios: median and interval of 95 percent."
    )
    return Table(f"Fastest to an error: {scene.name}", columns, rows, note)


def everything(fmu: Fmu, scene: Scene) -> Table:
    """Return all runs, and the times of all rounds of those that were raced; it is written as a CSV file alone."""
    race = raced(fmu, scene)
    rounds = len(next(iter(race.times.values()), []))
    rows = []
    for rung in _rungs(fmu, race):
        times = race.times.get((rung.solver.name, rung.knob), [])
        measured = percentiles(times) if times else ("", "", "")
        rows.append(
            (
                *(rung.solver.name, shown(scene, rung.solver, rung.knob), *map(_cell, rung.errors)),
                *(_cell(rung.evaluations), rung.failure, rung.seconds),
                *(*measured, *times),
            )
        )
    columns = (
        *("solver", "h [s] or tolerance", "final error", "rms error", "largest error", "energy error"),
        *("period error", "evaluations", "failure", "first run [s]", "median [s]", "10 % [s]", "90 % [s]"),
        *(f"round {i + 1} [s]" for i in range(rounds)),
    )
    head = (("FMU", fmu.path.name), *provenance())
    return Table(f"All runs: {scene.name}", columns, rows, shown=False, head=head)


def _cell(number: float) -> float | str:
    return "" if np.isnan(number) else number


def choice(fmu: Fmu) -> Table:
    """Return which method to use for which task and error, and what that costs."""
    groups = GROUPS[fmu.native]
    columns = ["task", "motion", "error", "method", "solver.stepSize [s]", "time [ms]"]
    for group in groups:
        columns += [f"{group} [ms]", "ratio"]
    rows = []
    for scene in (scene for scene in SCENES if scene.task):
        ours = STIFFLY_STABLE if scene.k2 >= STIFF.k2 else OURS
        for error in (error for error in COARSE if error in scene.targets):
            rows.append(
                [scene.task, scene.name, f"{error:.0e}", *_choice(fmu, scene, ours, error)]
                + [cell for names in groups.values() for cell in _against(fmu, scene, ours, names, error)]
            )
    note = (
        "The step is the longest that reaches the error. Under strong drag ImplicitTrapezoid is left out: what it does "
        "not resolve it does not damp, R(-infinity) = -1."
    )
    return Table("Which method for which task", columns, rows, note, folded=False)


def _choice(fmu: Fmu, scene: Scene, ours: Sequence[str], error: float) -> tuple[str, str, str]:
    """Return the fastest of our methods to an error, its step [s] and its time [ms]."""
    race = raced(fmu, scene)
    key = race.fastest(ours, error)
    if key is None:
        return why_not(carriers.solvers(fmu), scene, error), "", ""
    return key[0], f"{shown(scene, race.rungs[key].solver, key[1]):.2g}", f"{1e3 * race.median(key):.2g}"


def _against(
    fmu: Fmu, scene: Scene, ours: Sequence[str], theirs: Sequence[str], error: float
) -> tuple[str, str]:
    """Return the time [ms] of the fastest of some rivals to an error, and the ratio to that of ours."""
    race = raced(fmu, scene)
    key = race.fastest(theirs, error)
    if key is None:
        return why_not([solver for solver in _solvers(fmu) if solver.name in theirs], scene, error), ""
    ratio = compare(race, ours, theirs, error).ratio
    name = f" {key[0]}" if len(theirs) > 1 else ""
    return f"{1e3 * race.median(key):.2g}{name}", f"{ratio.median:.2g}" if ratio else ""


def _solvers(fmu: Fmu) -> tuple[Solver, ...]:
    return (*carriers.solvers(fmu), *rivals(fmu.native)[0])


def _rungs(fmu: Fmu, race: Race) -> Iterator[Rung]:
    """Yield the runs of the ladders, and those that were fitted between them."""
    for solver in _solvers(fmu):
        rungs = {rung.knob: rung for rung in ladder(solver, race.scene)}
        rungs |= {rung.knob: rung for rung in race.rungs.values() if rung.solver == solver}
        yield from (rungs[knob] for knob in sorted(rungs, reverse=not solver.counts_substeps))


# Pictures

HELD = " The FMU gets a smooth drive sampled in the middle of each substep: an error of order 2, whatever the method."


def against_time(fmu: Fmu, scene: Scene) -> Plot:
    """Return the largest errors against the medians of the run times, of all runs that were raced."""
    race = raced(fmu, scene)
    points: dict[str, list[tuple[float, float]]] = {}
    for key, rung in race.rungs.items():
        points.setdefault(key[0], []).append((rung.errors.largest, race.median(key)))
    for of_solver in points.values():
        of_solver.sort()
    carrier = "native FMU" if fmu.native else "FMU"
    title = f"Error against run time, {carrier}: {scene.name}"
    note = (
        f"The nearer to the lower left corner, the better. Solid: methods of the FMU; broken: rivals. Medians of "
        f"{contest.ROUNDS} rounds; at the same error the fastest of each kind, and what is not much slower."
        + HELD
        * (scene.drive is not None)
    )
    x_label, leads = f"largest error [{_unit(scene)}]", scene.leads
    return Plot(title, x_label, "time [s]", _curves(points), "xy", note, leads)


def against_evaluations(fmu: Fmu, scene: Scene) -> Plot:
    """Return the largest errors against the evaluations of the acceleration, which no machine changes."""
    points: dict[str, list[tuple[float, float]]] = {}
    for rung in _rungs(fmu, raced(fmu, scene)):
        if rung.errors.largest <= 1 and rung.evaluations > 0:
            points.setdefault(rung.solver.name, []).append((rung.errors.largest, rung.evaluations))
    title = f"Error against evaluations: {scene.name}"
    ended = [
        solver.name
        for solver in _solvers(fmu)
        if ladder(solver, scene)[-1].errors.largest > scene.targets[-1]
    ]
    note = (
        "The work without a clock, which no machine changes: how often the acceleration is evaluated. Of a Taylor "
        "series each coefficient counts. Errors above 1 are left out."
        + HELD * (scene.drive is not None and not fmu.interpolates)
        + (
            f" {scene.targets[-1]:.0e} is not reached by {', '.join(ended)}: too slow, or rounding."
            * bool(ended)
        )
    )
    return Plot(title, f"largest error [{_unit(scene)}]", "evaluations", _curves(points), "xy", note)


def _curves(points: dict[str, list[tuple[float, float]]]) -> list[Curve]:
    curves = []
    for name, style in STYLES.items():
        if name in points:
            x, y = zip(*points[name], strict=True)
            curves.append(Curve(name, x, y, style.line, style.marker))
    return curves


def _unit(scene: Scene) -> str:
    return "rad" if scene.scale == 1 else "relative"
