"""What the report is about: studies that were run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from ..checks import Check, Note, Plot, Result, Table

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
    """Return how many checks hold."""
    checks = [check for section in sections for check in section.checks]
    holding = sum(check.holds for check in checks)
    return f"{holding} of {len(checks)} checks hold"
