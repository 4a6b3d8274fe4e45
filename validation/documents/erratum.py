"""What a mistake of a document is: what is printed, what is right, and the numbers that show it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial

from ..checks import About, Check, Plot, Result, Table
from ..fmu import Fmu
from ..metrics import UNIT
from ..studies.scene import Scene


@dataclass(frozen=True)
class Number:
    """A number that shows a mistake: what it is, its digits, and how the program finds it.

    `expected` comes from 40-digit arithmetic, and half a unit of its last digit is the bound. Where the digits do not
    bound the difference, `bound` and `reason` do.
    """

    name: str
    expected: str
    compute: Callable[[Fmu], float]
    unit: str = ""
    bound: float = 0.0
    reason: str = ""
    about: About = About.FORMULAS

    def check(self, value: float) -> Check:
        """Return the row that holds `value` against the expected digits."""
        exponent = Decimal(self.expected).as_tuple().exponent
        unit_in_last_place = float(Decimal(1).scaleb(int(exponent)))
        return Check(
            f"{self.name} = {self.expected}",
            abs(value - float(self.expected)),
            self.bound or unit_in_last_place / 2 + 3 * UNIT * abs(float(self.expected)),
            self.reason or "half a unit of the last digit, and three roundings",
            self.unit,
            about=self.about,
        )


Measured = partial(Number, about=About.FMU)


@dataclass(frozen=True)
class Erratum:
    """A mistake: where it stands, what is printed, what is right, and the numbers that show it."""

    where: str
    printed: str
    right: str
    numbers: Sequence[Number] = ()


@dataclass(frozen=True)
class Document(Scene):
    """The errata of a document, and pictures of what they do."""

    TITLE = "{0.title}"

    title: str
    errata: Sequence[Erratum]
    pictures: Sequence[Callable[[], Plot]] = ()

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows of a document and the table of its errata."""
        rows = []
        for erratum in self.errata:
            values = [number.compute(fmu) for number in erratum.numbers]
            for number, value in zip(erratum.numbers, values, strict=True):
                check = number.check(value)
                yield replace(check, name=f"{erratum.where}: {check.name}")
            shown = "; ".join(
                f"{number.name}: {value:.{_digits(number)}g} {number.unit}".strip()
                for number, value in zip(erratum.numbers, values, strict=True)
            )
            rows.append((erratum.where, erratum.printed, erratum.right, shown))
        yield Table(self.name, ("where", "printed", "right", "what shows it, computed for this report"), rows)
        for picture in self.pictures:
            yield picture()


def _digits(number: Number) -> int:
    return min(12, max(2, len(Decimal(number.expected).as_tuple().digits)))
