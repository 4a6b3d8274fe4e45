"""The models that the tests of conduct run on: a row for each, with what the tests must know of its equation."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from math import sqrt
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest

from fmi.tables import Variable

SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # positive doubles
Start = Mapping[str, float]  # start values by name


class Plant:
    """A model of second order: what its slave's tables say, and which parameters do what in its equation.

    Attributes
    ----------
    folder : its files, laid out like those of fmu_src
    mass, drag : der(v) has the term -drag/mass*v, and no other with v
    stiffness : the parameter that x is pulled back in proportion to while x is small; None: der(v) is without x
    plain : parameters with which der(v) is input - drag*v - stiffness*x while x is small
    fastest : the square root of the largest slope of -a(x) [1/s] and the largest |v| of the motion from x = 1, v = 0.5
        with the mass 1, drag 0.5, input 0.7 and the other defaults, in 3 s, or more
    out_of_range : start values that are refused although each is allowed by itself, and what is said of them
    others : (parameter, first or last value of its range) -> what others must be for the model to have a motion; None:
        it has none
    """

    def __init__(
        self,
        folder: Path,
        *,
        mass: str,
        drag: str,
        stiffness: str | None,
        plain: Start,
        fastest: tuple[float, float],
        out_of_range: Sequence[tuple[Start, str]] = (),
        others: Mapping[tuple[str, float], Start | None],
    ) -> None:
        self.folder = folder
        self.slave = slave_in(folder)
        self.interface = self.slave.interface
        self.name = self.interface.model_name
        self.mass, self.drag, self.stiffness, self.plain = mass, drag, stiffness, plain
        self.fastest, self.out_of_range, self.others = fastest, out_of_range, others
        names = self.slave.names
        self.x, self.v, self.a, self.energy, self.input = names[:5]
        self.system, self.quantity = names.system, names.quantity
        self.x_start, self.v_start = f"{names.x}_start", f"{names.v}_start"
        self.state = (self.x, self.v)
        self.calculated = (*self.state, self.a, self.energy, "solver.nfev")
        self.reference = self.interface.references()
        self.variables = {variable.name: variable for variable in self.interface.variables}
        self.parameters = [v for v in self.interface.variables if v.causality == "parameter"]
        self.defaults = {name: v.start for name, v in self.variables.items() if v.start is not None}

    def can_pull(self, w02: float) -> bool:
        """Return whether x can be pulled back with -w02*x [x/s2]."""
        return w02 == 0.0 if self.stiffness is None else self.variables[self.stiffness].allows(w02)

    def pull(self, w02: float) -> dict[str, float]:
        """Return start values with which der(v) is input - drag*v - w02*x while x is small."""
        if not self.can_pull(w02):
            pytest.skip(f"no parameter of this model pulls x back with w02 = {w02!r}")
        return {**self.plain, **({} if self.stiffness is None else {self.stiffness: w02})}

    def unit(self, name: str) -> str:
        """Return the unit of a variable with the blank before it, "" where it has none."""
        unit = self.interface.unit_of(self.variables[name])
        return f" {unit}" if unit else ""

    def with_range(self, text: str) -> list[Variable]:
        """Return the parameters whose allowed values are called `text`."""
        return [v for v in self.parameters if v.range is not None and v.range.text == text]


def slave_in(folder: Path) -> Any:
    """Return the slave of a model, whose package is found from now on."""
    sys.path.append(str(folder))
    return run_path(str(folder / "slave.py"))["SLAVE"]


TESTS = Path(__file__).resolve().parent
PENDULUM = Plant(
    TESTS.parent / "fmu_src",
    mass="m",
    drag="gamma",
    stiffness="g",
    plain={"m": 1.0, "L": 1.0},
    # 0.5*w^2 <= 0.5*w_start^2 + 2*w02 + tau*6 by the energy, for swings below 6 rad; w02 = 9.80665
    fastest=(sqrt(9.80665), 7.0),
    out_of_range=(
        ({"m": 1e-200, "L": 1e-100}, "J = m*L^2 = 0"),
        ({"m": 1e200, "L": 1e100}, "J = m*L^2 = inf"),
        ({"m": 1e-200, "gamma": 1e200}, "gamma/m = inf 1/s"),
        ({"L": 1e-150, "m": 1e10, "g": 1e200}, "g/L = inf 1/s2"),
    ),
    others={
        ("m", SMALLEST): {"gamma": 0.0},
        ("L", SMALLEST): None,  # J = m*L^2 is 0
        ("L", LARGEST): {"m": SMALLEST, "gamma": 0.0},
    },
)
SPRING = Plant(
    TESTS / "second_model",
    mass="m",
    drag="c",
    stiffness="k",
    plain={"m": 1.0, "k3": 0.0},
    # Drag aside, v^2/2 + 5*x^2 + 1.25*x^4 - 0.7*x is 5.675: |x| < 1.1 and v^2/2 < 5.7; the slope is 10 + 15*x^2.
    fastest=(sqrt(28.2), 4.0),
    out_of_range=(
        ({"m": 1e-200, "c": 1e200}, "c/m = inf 1/s"),
        ({"m": 1e-200, "k": 1e200}, "k/m = inf 1/s2"),
        ({"m": 1e-200, "k3": 1e200}, "k3/m = inf 1/(m2.s2)"),
    ),
    others={("m", SMALLEST): {"c": 0.0, "k": 0.0, "k3": 0.0}},
)
PLANTS = {plant.name: plant for plant in (PENDULUM, SPRING)}
