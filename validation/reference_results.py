"""The reference results that travel inside the FMUs, and the bounds that a correct importer meets.

`python -m validation.reference_results` writes them anew into fmu_src/reference_results, whose files the build packs
under the same names: CSVs with the exact motion, and what the layered standard fmi-ls-ref asks for.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, floor, fsum, log10, radians, ulp
from pathlib import Path
from sys import float_info
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from .command import Parser
from .fmu import DEFAULTS, SolverMethod
from .references import State, discrete, taylor

PURPOSE = "Write the reference results that travel inside the FMUs anew, into fmu_src/reference_results."
ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "fmu_src" / "reference_results"
NAME = "org.fmi-standard.fmi-ls-ref"
VERSION = "1.0.0-beta.1"
ABOUT = "Layered Standard providing information on related files included in an FMU."
MANIFEST_SPACE = "http://fmi-standard.org/fmi-ls-manifest"
PARAMETER_SPACE = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
STOP = 10.0  # of every experiment [s]
METHOD = "solver.method"


class Part(NamedTuple):
    """What makes an error, and how much at most: of phi [rad], of w [rad/s]."""

    cause: str
    phi: float
    w: float


@dataclass(frozen=True)
class ReferenceResult:
    """An experiment from 0 to 10 s and its exact motion.

    Attributes
    ----------
    name : of its files
    title : what it is, in a few words
    steps_per_second : the communication points are the multiples of its inverse
    start : start values that differ from the defaults
    torques : tau [N.m], each for an equal part of the experiment; none: tau stays 0
    """

    name: str
    title: str
    steps_per_second: int
    start: Mapping[str, float] = field(default_factory=dict)
    torques: Sequence[float] = ()

    @property
    def values(self) -> dict[str, float]:
        """All parameters; k2 = gamma/m, w02 = g/L and tau/(m*L^2) are exact in doubles."""
        return {**DEFAULTS, **self.start}

    @property
    def k2(self) -> float:
        """The damping rate [1/s]."""
        return self.values["gamma"] / self.values["m"]

    @property
    def w02(self) -> float:
        """The squared angular frequency of small swings [1/s2]."""
        return self.values["g"] / self.values["L"]

    @property
    def times(self) -> list[float]:
        """The communication points [s]."""
        return [i / self.steps_per_second for i in range(round(STOP * self.steps_per_second) + 1)]

    def torque(self, t: float) -> float:
        """Return tau [N.m] in the communication step from `t` [s]."""
        return self.torques[floor(t / STOP * len(self.torques))] if self.torques else 0.0

    @property
    def drives(self) -> list[float]:
        """The drive [1/s2] of each communication step."""
        return [self.torque(t) / (self.values["m"] * self.values["L"] ** 2) for t in self.times[:-1]]

    @cached_property
    def exact(self) -> State:
        """Phi [rad] and w [rad/s] at the communication points, right to the last digit of a double."""
        start = self.values["phi_start"], self.values["w_start"]
        return taylor.motion(self.times, *start, self.k2, self.w02, self.drives)

    def discrete(self, phi_shift: float = 0.0, w_shift: float = 0.0) -> State:
        """Return the motion that the method makes of the equation, the initial state shifted."""
        values = self.values
        return discrete.motion(
            SolverMethod(round(values[METHOD])).name,
            self.times,
            values["phi_start"] + phi_shift,
            values["w_start"] + w_shift,
            self.k2,
            self.w02,
            values["solver.stepSize"],
            self.drives,
        )

    @cached_property
    def parts(self) -> list[Part]:
        """What the errors of phi and w are made of, each at most as large as here."""
        phi, w = self.exact
        a = np.array([*self.drives, self.drives[-1]]) - self.k2 * w - self.w02 * np.sin(phi)
        sizes, rates = (_largest(phi), _largest(w)), (_largest(w), _largest(a))
        method = self.discrete()
        shift = 1e-6
        moved = self.discrete(phi_shift=shift), self.discrete(w_shift=shift)
        # Of phi and of w at any time, by phi and by w at the beginning.
        gains = [[_largest(there[i] - method[i]) / shift for there in moved] for i in (0, 1)]
        substep = min(self.values["solver.stepSize"], 1 / self.steps_per_second)
        rounding = STOP / substep * float_info.epsilon
        # Multiples of a power of 2 are the same numbers however a host forms them.
        exact_clock = self.steps_per_second & (self.steps_per_second - 1) == 0
        clock = 0.0 if exact_clock else STOP * self.steps_per_second * ulp(STOP)
        rounded = [rounding * (row[0] * sizes[0] + row[1] * sizes[1]) for row in gains]
        return [
            Part("the error of the method", _largest(method[0] - phi), _largest(method[1] - w)),
            Part("roundings of phi and w in every substep, all of one sign", *rounded),
            Part("a clock that is late by an ulp of 10 s in every step", clock * rates[0], clock * rates[1]),
        ]

    @property
    def bounds(self) -> dict[str, float]:
        """The largest errors of phi [rad] and w [rad/s] in a correct importer: the sum of the parts, rounded up."""
        return {
            "phi": _rounded_up(fsum(part.phi for part in self.parts)),
            "w": _rounded_up(fsum(part.w for part in self.parts)),
        }

    @property
    def reason(self) -> str:
        """The reason for the bounds, in words; what makes less than a twentieth of them is not named."""
        named = [
            f"{part.cause}: {_rounded_up(part.phi, 2):g} rad, {_rounded_up(part.w, 2):g} rad/s"
            for part in self.parts
            if part.phi > self.bounds["phi"] / 20
        ]
        return f"{'; '.join(named)}; their sum, rounded up to one digit"


RESULTS = (
    ReferenceResult("default", "The default experiment", 100),
    ReferenceResult(
        "large_swing",
        "An undamped swing from 170 deg",
        16,
        {
            "m": 2.0,
            "L": 0.5,
            "gamma": 0.0,
            "g": 9.75,
            "phi_start": radians(170),
            METHOD: SolverMethod.TaylorSeries,
            "solver.stepSize": 1 / 32,
        },
    ),
    ReferenceResult(
        "driven",
        "The default pendulum under a torque that changes at every second",
        16,
        torques=(1.0, -2.0, 3.0, 0.5, -1.5, 0.0, 2.5, -3.0, 1.25, -0.75),
    ),
    ReferenceResult(
        "stiff",
        "Strong drag, at a step size that no explicit Runge-Kutta method stands",
        8,
        {
            "m": 0.5,
            "gamma": 50.0,
            "phi_start": 2.5,
            METHOD: SolverMethod.SDIRK4,
            "solver.stepSize": 1 / 32,
        },
    ),
)


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))


def _rounded_up(value: float, digits: int = 1) -> float:
    """Return the smallest number of so many digits that is not below `value`."""
    power = floor(log10(value)) - digits + 1
    return float(f"{ceil(value / 10**power)}e{power}")


def csv(names: Sequence[str], rows: Sequence[Sequence[float]]) -> str:
    """Return a table in the form of the FMI cross-check rules; each number names its double."""
    lines = [",".join(f'"{name}"' for name in names)]
    lines += [",".join([repr(row[0]), *(f"{value:.17g}" for value in row[1:])]) for row in rows]
    return "\n".join(lines) + "\n"


def result_csv(result: ReferenceResult) -> str:
    """Return the exact motion."""
    phi, w = result.exact
    return csv(("time", "phi", "w"), list(zip(result.times, phi.tolist(), w.tolist(), strict=True)))


def input_csv(result: ReferenceResult) -> str:
    """Return the torque; two rows of the same time are a jump."""
    length = STOP / len(result.torques)
    rows = [(i * length, tau) for n, tau in enumerate(result.torques) for i in (n, n + 1)]
    return csv(("time", "tau"), rows)


def parameter_set(result: ReferenceResult) -> str:
    """Return the start values as a parameter set of SSP 1.0 (SSV)."""
    ElementTree.register_namespace("ssv", PARAMETER_SPACE)
    root = Element(f"{{{PARAMETER_SPACE}}}ParameterSet", version="1.0", name=result.name)
    parameters = SubElement(root, f"{{{PARAMETER_SPACE}}}Parameters")
    for name, value in result.start.items():
        parameter = SubElement(parameters, f"{{{PARAMETER_SPACE}}}Parameter", name=name)
        if name == METHOD:
            SubElement(parameter, f"{{{PARAMETER_SPACE}}}Enumeration", value=SolverMethod(round(value)).name)
        else:
            SubElement(parameter, f"{{{PARAMETER_SPACE}}}Real", value=repr(value))
    return _xml(root)


def _xml(root: Element) -> str:
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def experiments() -> str:
    """Return all experiments with files, bounds and reasons for programs."""
    rows = [
        {
            "name": result.name,
            "title": result.title,
            "start_values": dict(result.start),
            "stop_time": STOP,
            "communication_step": 1 / result.steps_per_second,
            "input": f"{result.name}_in.csv" if result.torques else None,
            "result": f"{result.name}.csv",
            "bounds": result.bounds,
            "reason": result.reason,
        }
        for result in RESULTS
    ]
    return json.dumps({"experiments": rows}, indent=2) + "\n"


def _related() -> Iterator[tuple[str, str, str, str]]:
    """Yield source, MIME type, role and description of every file."""
    yield (
        "experiments.json",
        "application/json",
        "testcase",
        "All experiments, with files, bounds and reasons",
    )
    for result in RESULTS:
        bounds = result.bounds
        yield (
            f"{result.name}.csv",
            "text/csv",
            "result",
            f"{result.title}: exact; error at most {bounds['phi']:g} rad in phi, {bounds['w']:g} rad/s in w",
        )
        if result.torques:
            yield f"{result.name}_in.csv", "text/csv", "testcase", f"{result.title}: the torque"
        if result.start:
            yield (
                f"{result.name}.ssv",
                "application/x-ssp-parameter-set",
                "parameter",
                f"{result.title}: start values",
            )


def manifest() -> str:
    """Return fmi-ls-manifest.xml."""
    ElementTree.register_namespace("fmi-ls", MANIFEST_SPACE)
    root = Element("fmiReferences")
    for name, value in (("name", NAME), ("version", VERSION), ("description", ABOUT)):
        root.set(f"{{{MANIFEST_SPACE}}}fmi-ls-{name}", value)
    for source, kind, role, description in _related():
        SubElement(root, "Related", type=kind, source=source, role=role, description=description)
    return _xml(root)


def explanation() -> str:
    """Return documentation/fmi-ls-ref.txt."""
    parts = [
        "Reference results (layered standard fmi-ls-ref), in extra/org.fmi-standard.fmi-ls-ref\n\n"
        "Each CSV has the exact phi [rad] and w [rad/s] at every communication point, by Taylor series of order 40\n"
        "in 50 digits, rounded to a double. A correct importer that steps from row to row is nowhere off by more than\n"
        "the bounds. experiments.json has the same for programs; the .ssv files are parameter sets of SSP 1.0.\n"
    ]
    for result in RESULTS:
        values = ", ".join(
            f"{name} = {SolverMethod(round(value)).name if name == METHOD else repr(value)}"
            for name, value in result.start.items()
        )
        bounds = result.bounds
        parts.append(
            f"{result.name}.csv: {result.title}\n"
            f"  start values   {values or 'the defaults'}\n"
            f"  torque         {f'{result.name}_in.csv; rows of the same time are a jump' if result.torques else '0'}\n"
            f"  steps          {1 / result.steps_per_second:g} s, to {STOP:g} s\n"
            f"  bounds         phi {bounds['phi']:g} rad, w {bounds['w']:g} rad/s\n"
            f"  reason         {result.reason}\n"
        )
    return "\n".join(parts)


def files() -> dict[str, str]:
    """Return the texts of all files by their names in the FMU."""
    texts = {"experiments.json": experiments(), "fmi-ls-manifest.xml": manifest()}
    for result in RESULTS:
        texts[f"{result.name}.csv"] = result_csv(result)
        if result.torques:
            texts[f"{result.name}_in.csv"] = input_csv(result)
        if result.start:
            texts[f"{result.name}.ssv"] = parameter_set(result)
    packed = {f"extra/{NAME}/{name}": text for name, text in texts.items()}
    return packed | {"documentation/fmi-ls-ref.txt": explanation()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = Parser(prog="python -m validation.reference_results", description=PURPOSE)
    parser.parse_args(arguments)
    with parser.interruptible():
        for name, text in files().items():
            path = TARGET / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
