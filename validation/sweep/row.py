"""One run and what is written of it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import hypot, isfinite, sqrt

import numpy as np

from ..fmu import OUTPUTS, Experiment, Fmu
from ..metrics import Array
from ..references.arrays import State
from ..references.elliptic import motion
from ..references.linear import free_evolution
from ..references.taylor import motion as series
from .plan import Common, Values

Cell = str | float | int | None
Row = dict[str, Cell]
Trajectory = dict[str, Array]

# What pythonfmu says before the FMU's sentence.
WRAPPER = re.compile(r"\AFatal py exception encountered: .*\n")
SMALL = 1e-8  # amplitude [rad] up to which sin(phi) is phi to a relative 2e-17, less than the half of a last digit
FARTHEST = 500.0  # angle [rad] that a Taylor series follows: as many digits more are needed for its sine
LONGEST = 1e4  # damping times that it follows: its steps are a fraction of one


def columns(common: Common) -> dict[str, type]:
    """Return the columns of a row and what stands in them: text, floating-point or whole numbers."""
    settable = common.interface.variables.values()
    return {
        "run": str,
        **{variable.name: str if variable.items else float for variable in settable},
        "stop_time": float,
        "output_interval": float,
        **dict.fromkeys(OUTPUTS, float),
        "error": float,
        "reference": str,
        "solver.nfev": int,
        "seconds": float,
        "warnings": str,
        "failure": str,
        "fmu": str,
    }


def experiment(common: Common, values: Values) -> Experiment:
    """Return what the FMU is asked to do."""
    variables = common.interface.variables
    start = {
        name: int(value) if variables[name].items else value
        for name, value in zip(common.names, values, strict=True)
    }
    if common.record:
        outputs = tuple(dict.fromkeys((*common.record, *OUTPUTS)))
        return Experiment(common.stop, common.interval, start, record=outputs)
    return Experiment(common.stop, common.interval, start, record=OUTPUTS, ends=True)


def run(fmu: Fmu, common: Common, values: Values) -> tuple[Row, Trajectory | None]:
    """Run the FMU; return the row, and the trajectory if it is to be recorded, which ends where the FMU failed.

    An instance that failed is not used again.

    Outputs are those at the end, `error` [rad] is the distance of (phi, w/w0) from the exact answer there, and
    `seconds` the time of the processor for the steps. What there is none of is None.
    """
    done = fmu.run(experiment(common, values))
    row = empty(common, values)
    row["solver.nfev"], row["seconds"] = done.nfev, done.seconds
    row["warnings"] = "; ".join(done.warnings) or None
    row["failure"] = WRAPPER.sub("", done.failure) or None
    end = {name: float(done[name][-1]) for name in OUTPUTS}
    if all(isfinite(value) for value in end.values()):
        row |= end
        exact = answer(common.parameters(values), common.stop, common.series)
        if exact is not None and not done.failure:
            row["reference"], row["error"] = exact[0], distance(common, values, end, exact[1])
    elif not done.failure:
        row["failure"] = "the outputs at the end are not finite, and the FMU said nothing"
    if row["failure"]:
        fmu.renew()
    if not common.record:
        return row, None
    reached = len(done.t) - bool(row["failure"])
    return row, {"time": done.t[:reached]} | {name: done[name][:reached] for name in common.record}


def empty(common: Common, values: Values) -> Row:
    """Return the row of a run of which only the parameters are known."""
    row: Row = dict.fromkeys(columns(common))
    variables = common.interface.variables
    row |= {name: variables[name].shown(value) for name, value in common.parameters(values).items()}
    row |= {"stop_time": common.stop, "output_interval": common.interval}
    return row | {"run": common.identity(values), "fmu": common.interface.guid}


def distance(common: Common, values: Values, end: Mapping[str, float], exact: State) -> float:
    """Return the distance [rad] of (phi, w/w0) at the end from the exact ones, w0 = sqrt(g/L)."""
    given = common.parameters(values)
    phi, w = (float(x) for x in exact)
    return hypot(end["phi"] - phi, (end["w"] - w) / sqrt(abs(given["g"] / given["L"]) or 1.0))


def answer(given: Mapping[str, float], t: float, with_series: bool) -> tuple[str, State] | None:
    """Return phi and w at `t` [s] by an exact reference, and its name; None where there is none.

    "elliptic": undamped, by elliptic functions; "linear": swings of up to `SMALL`, by the linear solution; "series":
    all others, by a Taylor series in 50 digits, if it is asked for and not too long.
    """
    k2, w02 = given["gamma"] / given["m"], given["g"] / given["L"]
    drive = given["tau"] / (given["m"] * given["L"] ** 2)
    phi0, rate0 = given["phi_start"], given["w_start"]
    try:
        with np.errstate(all="ignore"):
            if drive == 0 and w02 > 0 and hypot(phi0, rate0 / sqrt(w02)) <= SMALL:
                return _finite("linear", free_evolution(t, phi0, rate0, k2, w02))
            if drive == 0 and w02 > 0 and k2 == 0:
                return _finite("elliptic", motion(t, phi0, rate0, w02))
            farthest = abs(phi0) + (abs(rate0) + 2 * sqrt(abs(w02))) * t + abs(drive) * t * t / 2
            if with_series and farthest <= FARTHEST and k2 * t <= LONGEST:
                phi, w = series([0.0, t], phi0, rate0, k2, w02, drive)
                return _finite("series", (phi[-1], w[-1]))
    except (ArithmeticError, ValueError):  # beyond what the reference can be computed for
        return None
    return None


def _finite(name: str, state: State) -> tuple[str, State] | None:
    return (name, state) if np.isfinite(state).all() else None
