"""A scene of a study: a piece of it that is run, judged and tested on its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from ..checks import Result
from ..fmu import Fmu


@dataclass(frozen=True)
class Scene(ABC):
    """Data of a scene; subclasses say what is claimed of it.

    Attributes
    ----------
    TITLE : its name in tables and tests, a format of the scene
    slow : whether it takes more than a few seconds
    """

    TITLE: ClassVar[str]
    slow: bool = field(default=False, kw_only=True)

    @property
    def name(self) -> str:
        """The name in tables and tests."""
        return self.TITLE.format(self)

    @abstractmethod
    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Run the FMU and yield the rows, tables and pictures."""


@dataclass(frozen=True)
class Case(Scene):
    """A scene without data of its own: the function that runs it."""

    TITLE = "{0.title}"

    title: str
    yields: Callable[[Fmu], Iterator[Result]]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Run the function."""
        yield from self.yields(fmu)
