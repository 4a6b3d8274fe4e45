"""The studies by name, in the order of the report.

A study is a module with TITLE, FORMULA (with its source) and SCENES; each scene has a `name`, says whether it is
`slow`, and yields its results from run(fmu). It may have RACES: scenes about run times, which depend on what else the
machine does. The command runs them, too, while nothing else runs, but no test does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol

from ..checks import Result
from ..fmu import Fmu

NAMES = (
    "elliptic_period",
    "trajectory",
    "impulse_response",
    "methods",
    "stability",
    "traps",
    "inputs",
    "stiff_extreme",
    "work_precision",
    "atlas",
    "crawford",
    "grillo",
    "errata",
)


class Scene(Protocol):
    """What is asked of a scene."""

    @property
    def name(self) -> str: ...  # noqa: D102  # described by the module

    @property
    def slow(self) -> bool: ...  # noqa: D102  # described by the module

    def run(self, fmu: Fmu) -> Iterator[Result]: ...  # noqa: D102  # described by the module


@dataclass(frozen=True)
class Study:
    """A study that is loaded."""

    name: str
    title: str
    formula: str
    scenes: Sequence[Scene]
    races: Sequence[Scene]


def load(name: str) -> Study:
    """Return the study `name`, one of `NAMES`; the others are not imported."""
    module = import_module(f".{name}", __package__)
    return Study(name, module.TITLE, module.FORMULA, module.SCENES, getattr(module, "RACES", ()))
