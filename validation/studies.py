"""The studies by name, in the order of the report.

A study is a module with TITLE, FORMULA (with its source), SCENES (data with `name` and `slow`) and
run(fmu, scene), which yields the results of a scene. It may have RACES: scenes whose rows are about run times, which
depend on what else the machine does. The command judges them, too, but no test does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any, Protocol, cast

from .fmu import Fmu
from .results import Result

NAMES = (
    "elliptic_period",
    "impulse_response",
    "trajectory",
    "crawford",
    "grillo",
    "errata",
    "work_precision",
    "stability",
    "stiff_extreme",
)


class Scene(Protocol):
    """What all scenes have: a name, and whether it takes more than a few seconds."""

    @property
    def name(self) -> str: ...  # noqa: D102  # described by the class

    @property
    def slow(self) -> bool: ...  # noqa: D102  # described by the class


class Study(Protocol):
    """The interface of a study's module."""

    TITLE: str
    FORMULA: str
    SCENES: Sequence[Scene]

    def run(self, fmu: Fmu, scene: Any) -> Iterator[Result]: ...  # noqa: D102  # described by the module


def races(study: Study) -> Sequence[Scene]:
    """Return the scenes of `study` that are about run times."""
    return cast(Sequence[Scene], getattr(study, "RACES", ()))


def load(name: str) -> Study:
    """Return the study `name`, one of `NAMES`; the others are not imported."""
    return cast(Study, import_module(f".{name}", __package__))
