"""What a study yields: checks for the tables and pytest, tables and plots for the report. Data only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite

from numpy.typing import ArrayLike


class About(Enum):
    """What a check is about: a fault of the FMU can break a row of the first kind, and must not touch the second.

    Rows of the third kind depend on the machine, too.
    """

    FMU = "the FMU"
    FORMULAS = "the documents and formulas"
    TIMES = "run times on this machine"


@dataclass(frozen=True)
class Check:
    """A number, and the bound it must keep.

    Attributes
    ----------
    name : the claim
    measured : the number
    bound : what `measured` must not exceed, or, with `at_least`, not fall below
    reason : where the bound comes from
    unit : of both numbers, "" for a pure number
    at_least : whether `bound` is a lower one
    about : what the number comes from
    """

    name: str
    measured: float
    bound: float
    reason: str
    unit: str = ""
    at_least: bool = False
    about: About = About.FMU

    @property
    def holds(self) -> bool:
        """Whether the bound is kept; never so where one of the two numbers is none."""
        if not (isfinite(self.measured) and isfinite(self.bound)):
            return False
        return self.measured >= self.bound if self.at_least else self.measured <= self.bound

    @property
    def margin(self) -> float:
        """How often the measured number fits into the bound; above 1 it holds."""
        small, large = (self.bound, self.measured) if self.at_least else (self.measured, self.bound)
        return inf if small == 0 else large / small

    def __str__(self) -> str:
        relation = ">=" if self.at_least else "<="
        verdict = "holds" if self.holds else "FAILS"
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name}: {self.measured:.3g} {relation} {self.bound:.3g}{unit} {verdict} ({self.reason})"


def formula(
    name: str, measured: float, bound: float, reason: str, unit: str = "", at_least: bool = False
) -> Check:
    """Return a row about the documents and formulas."""
    return Check(name, measured, bound, reason, unit, at_least, About.FORMULAS)


@dataclass(frozen=True)
class Table:
    """A table of the report: headers with units, and cells that are shown as they are, numbers with six digits.

    Attributes
    ----------
    shown : whether it stands in the report, not only in its CSV file
    folded : whether it has to be opened in the report if it is long
    head : what stands before the headers in the CSV file, a name and a value a line
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    note: str = ""
    shown: bool = True
    folded: bool = True
    head: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True)
class Curve:
    """A line of a plot; the style is chosen so that black and white is enough.

    `like` is the label of another curve whose colour it has.
    """

    label: str
    x: ArrayLike
    y: ArrayLike
    line: str = "-"
    marker: str = ""
    like: str = ""


@dataclass(frozen=True, eq=False)
class Plot:
    """A picture of the report as data: curves, or a map of values 0..1 over a logarithmic plane with curves on it.

    `note` is its caption: what to see in it. `below` are curves of a second panel with the same abscissa.
    """

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    logarithmic: str = ""  # "x", "y" or "xy"
    note: str = ""
    headline: bool = False  # shown at the top of the report, too
    y_range: tuple[float, float] | None = None
    shade: tuple[ArrayLike, ArrayLike, ArrayLike] | None = field(default=None, repr=False)
    below: Sequence[Curve] = ()
    below_label: str = ""
    below_logarithmic: str = ""  # of the second panel


@dataclass(frozen=True)
class Map:
    """A panel of `Maps`: rows of values, and of a second quantity."""

    title: str
    values: ArrayLike
    others: ArrayLike


@dataclass(frozen=True, eq=False)
class Maps:
    """A picture of panels over the same plane: colours for positive values, and below for the second quantity.

    Attributes
    ----------
    x, y : the coordinates of the cells
    span_of_values, span_of_others : least and largest that has a colour; what is larger, or no number, is crossed out
    note : the caption: what to see in it
    """

    title: str
    x_label: str
    y_label: str
    x: Sequence[float]
    y: Sequence[float]
    panels: Sequence[Map]
    label_of_values: str
    span_of_values: tuple[float, float]
    label_of_others: str
    span_of_others: tuple[float, float]
    note: str = ""


@dataclass(frozen=True)
class Note:
    """A conclusion in plain words."""

    text: str
    headline: bool = False


Result = Check | Table | Plot | Maps | Note
