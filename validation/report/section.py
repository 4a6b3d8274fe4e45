"""What the report is about: studies that were run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from ..checks import About, Check, Note, Plot, Result, Table

Kind = TypeVar("Kind", Check, Table, Plot, Note)


@dataclass(frozen=True)
class Section:
    """A study that was run."""

    name: str
    title: str
    formula: str
    results: Sequence[Result]

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the results of a kind."""
        return [result for result in self.results if isinstance(result, kind)]

    @property
    def checks(self) -> list[Check]:
        """The checks among the results."""
        return self.of(Check)


def summary(sections: Iterable[Section]) -> str:
    """Return how many rows hold, those about the FMU and those about formulas apart."""
    checks = [check for section in sections for check in section.checks]
    counts = []
    for about in About:
        rows = [check for check in checks if check.about is about]
        if rows:
            counts.append(f"{sum(row.holds for row in rows)} of {len(rows)} rows about {about.value} hold")
    return "; ".join(counts)
