"""The models that the tests of conduct run on, and what each calls its variables."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from runpy import run_path

from fmi.second_order import SecondOrder
from fmi.tables import Variable
from slave import DampedPendulum

SECOND_MODEL = Path(__file__).resolve().parent / "second_model"


class Plant:
    """A model of second order: what its slave's tables say, and which parameters do what in its equation.

    Attributes
    ----------
    mass, drag : der(v) has the term -drag/mass*v
    stiffness : the parameter that is proportional to the squared angular frequency of small swings, and equal to it
        while the others have their start values, but for those of `linear`
    linear : parameters without which der(v) is 0 where drag, stiffness and input are
    """

    def __init__(
        self, slave: type[SecondOrder], mass: str, drag: str, stiffness: str, linear: Mapping[str, float]
    ) -> None:
        self.slave, self.interface = slave, slave.interface
        self.name = self.interface.model_name
        self.mass, self.drag, self.stiffness, self.linear = mass, drag, stiffness, linear
        names = slave.names
        self.x, self.v, self.a, self.energy, self.input = names[:5]
        self.system, self.quantity = names.system, names.quantity
        self.x_start, self.v_start = f"{names.x}_start", f"{names.v}_start"
        self.state = (self.x, self.v)
        self.calculated = (*self.state, self.a, self.energy, "solver.nfev")
        self.reference = self.interface.references()
        self.variables = {variable.name: variable for variable in self.interface.variables}
        self.parameters = [v for v in self.interface.variables if v.causality == "parameter"]
        self.defaults = {name: v.start for name, v in self.variables.items() if v.start is not None}

    def pull(self, w02: float) -> dict[str, float]:
        """Return start values with which x is pulled back with -w02*x [x/s2] while it is small."""
        return {self.stiffness: w02, **self.linear}

    def unit(self, name: str) -> str:
        """Return the unit of a variable with the blank before it, "" where it has none."""
        unit = self.interface.unit_of(self.variables[name])
        return f" {unit}" if unit else ""

    def with_range(self, text: str) -> list[Variable]:
        """Return the parameters whose allowed values are called `text`."""
        return [v for v in self.parameters if v.range is not None and v.range.text == text]


PENDULUM = Plant(DampedPendulum, mass="m", drag="gamma", stiffness="g", linear={})
SPRING = Plant(
    run_path(str(SECOND_MODEL / "slave.py"))["SLAVE"], mass="m", drag="c", stiffness="k", linear={"k3": 0.0}
)
PLANTS = {plant.name: plant for plant in (PENDULUM, SPRING)}
