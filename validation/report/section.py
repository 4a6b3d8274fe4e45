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

    @property
    def short_title(self) -> str:
        """The title up to its colon."""
        return self.title.split(":")[0]

    def of(self, kind: type[Kind]) -> list[Kind]:
        """Return the results of a kind."""
        return [result for result in self.results if isinstance(result, kind)]

    @property
    def checks(self) -> list[Check]:
        """The checks among the results."""
        return self.of(Check)


@dataclass(frozen=True)
class Count:
    """How many rows of a kind hold."""

    about: str
    holding: int
    rows: int

    def __str__(self) -> str:
        return f"{self.holding} of {self.rows} rows about {self.about} hold"


def counts(sections: Iterable[Section]) -> list[Count]:
    """Return how many rows of each kind hold."""
    checks = [check for section in sections for check in section.checks]
    by_kind = {about: [check.holds for check in checks if check.about is about] for about in About}
    return [Count(about.value, sum(holds), len(holds)) for about, holds in by_kind.items() if holds]


def summary(sections: Iterable[Section]) -> str:
    """Return the counts as a line."""
    return "; ".join(map(str, counts(sections)))
