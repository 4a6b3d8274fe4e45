"""Which runs: the product of axes, or the rows of a CSV file."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path

from ..command import reason
from .errors import WrongUseError
from .interface import Interface, Variable

FORMS = "NAME=START:STOP:COUNT, NAME=log:START:STOP:COUNT or NAME=VALUE,VALUE,..., each with :UNIT behind it"
MOST_VALUES, MOST_RUNS = 10**6, 10**8  # of an axis, whose values are in memory, and of a sweep
Values = tuple[float, ...]  # of a run, in the order of the names
Runs = tuple[tuple[str, ...], int, Callable[[], Iterator[Values]]]  # names, count, and what yields the runs


@dataclass(frozen=True)
class Common:
    """What the runs of a sweep share.

    Attributes
    ----------
    names : of the variables that are set
    stop, interval : end and communication step [s]; the runs begin at 0
    record : outputs whose trajectories are kept
    series : whether the exact answer may be a Taylor series
    """

    interface: Interface
    names: tuple[str, ...]
    stop: float
    interval: float
    record: tuple[str, ...] = ()
    series: bool = False

    def parameters(self, values: Values) -> dict[str, float]:
        """Return all that can be set, in the units of the interface, as it is in a run."""
        start = {name: variable.start for name, variable in self.interface.variables.items()}
        return start | dict(zip(self.names, values, strict=True))

    def identity(self, values: Values) -> str:
        """Return what tells a run from others: a digest of what was asked for and of which FMU, 64 bits."""
        asked = sorted(self.parameters(values).items())
        known = [self.interface.guid, self.stop, self.interval, asked, self.series]
        return hashlib.sha256(json.dumps(known).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Plan:
    """The runs of a sweep: how many, and the values of each; no run stands twice."""

    common: Common
    count: int
    runs: Callable[[], Iterator[Values]]


@dataclass(frozen=True)
class Axis:
    """A variable and its values, in the unit of the interface; no value stands twice."""

    name: str
    values: Sequence[float]


def of_axes(axes: Sequence[Axis]) -> Runs:
    """Return names, count and runs of the product of axes; the last axis changes first.

    Raises
    ------
    WrongUseError : a name stands twice, or there are too many runs
    """
    names = tuple(axis.name for axis in axes)
    _refuse_repeated(names)
    count = prod(len(axis.values) for axis in axes)
    if count > MOST_RUNS:
        raise WrongUseError(f"the axes make {count} runs (allowed: up to {MOST_RUNS})")
    return names, count, lambda: product(*(axis.values for axis in axes))


def of_file(path: Path, interface: Interface) -> Runs:
    """Return names, count and runs of a CSV file: a column a variable, its name and, behind a colon, its unit.

    Raises
    ------
    WrongUseError : the file cannot be read, with its line
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeError, csv.Error) as error:
        raise WrongUseError(f"{path} cannot be read: {reason(error)}") from None
    if not any(map(_said, rows[1:])):
        raise WrongUseError(f"{path} has no runs: a line of names and a line a run are needed")
    heads = [head.strip().partition(":") for head in rows[0]]
    variables = [interface.variable(name) for name, _, _ in heads]
    names = tuple(variable.name for variable in variables)
    _refuse_repeated(names)
    runs: dict[Values, None] = {}
    for line, row in enumerate(rows[1:], start=2):
        if not _said(row):
            continue
        if len(row) != len(names):
            raise WrongUseError(f"{path}, line {line}: {len(row)} values for {len(names)} names")
        try:
            values = (
                variable.read(text.strip(), unit)
                for variable, text, (_, _, unit) in zip(variables, row, heads, strict=True)
            )
            runs[tuple(values)] = None
        except WrongUseError as error:
            raise WrongUseError(f"{path}, line {line}: {error}") from None
    return names, len(runs), lambda: iter(runs)


def _said(row: Sequence[str]) -> bool:
    """Return whether a line is more than blanks."""
    return len(row) > 1 or any(text.strip() for text in row)


def _refuse_repeated(names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise WrongUseError(f"{name} stands {names.count(name)} times (allowed: once)")


def axis(text: str, interface: Interface) -> Axis:
    """Return the axis that `text` says, in one of `FORMS`.

    Raises
    ------
    WrongUseError : it is in none of these forms, or the FMU does not know what it names
    """
    name, equals, rest = text.partition("=")
    if not equals:
        raise WrongUseError(f"{text!r} is no axis (allowed: {FORMS})")
    variable = interface.variable(name)
    logarithmic = rest.startswith("log:")
    parts = rest.removeprefix("log:").split(":")
    if len(parts) in (3, 4):
        numbers = _range(variable, parts[:3], logarithmic)
        values = [variable.value(number, *parts[3:]) for number in numbers]
    elif len(parts) in (1, 2) and not logarithmic:
        if not parts[0]:
            raise WrongUseError(f"{text}: the list is empty (allowed: {FORMS})")
        values = [variable.read(one, *parts[1:]) for one in parts[0].split(",")]
    else:
        raise WrongUseError(f"{text} is no axis (allowed: {FORMS})")
    return Axis(name, list(dict.fromkeys(values)))


def _range(variable: Variable, parts: Sequence[str], logarithmic: bool) -> list[float]:
    """Return equidistant numbers, or numbers of equal quotients, both ends among them."""
    start, stop = (variable.read(part) for part in parts[:2])
    try:
        count = int(parts[2])
    except ValueError:
        count = 0
    if not 1 <= count <= MOST_VALUES:
        allowed = f"a whole number from 1 to {MOST_VALUES}"
        raise WrongUseError(f"{variable.name}: the count is {parts[2]} (allowed: {allowed})")
    if logarithmic and not (start > 0 and stop > 0):
        raise WrongUseError(f"{variable.name}: log:{start:g}:{stop:g} has no logarithm (allowed: > 0)")
    if count == 1:
        return [start]
    shares = [i / (count - 1) for i in range(count - 1)]
    inner = [start * (stop / start) ** x if logarithmic else start + x * (stop - start) for x in shares]
    return [*inner, stop]
