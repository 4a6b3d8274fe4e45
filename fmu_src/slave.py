"""The damped pendulum as an FMI 2.0 co-simulation slave: its variables and its model, joined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite, nan
from operator import attrgetter
from typing import Any, ClassVar

from damped_pendulum.integration import Integration
from damped_pendulum.interface import INTERFACE
from damped_pendulum.model import Pendulum
from damped_pendulum.solvers import SolverMethod
from fmi.shell import INTEGER_MAX, CoSimulation, is_count, is_float


class DampedPendulum(CoSimulation):
    """The damped pendulum as an FMI 2.0 co-simulation slave."""

    interface = INTERFACE
    entries: ClassVar = {"phi": is_float, "w": is_float, "nfev": is_count}
    outputs: ClassVar = {
        "phi": attrgetter("phi"),
        "w": attrgetter("w"),
        "a": lambda self: self.computed("a", self.acceleration),
        "E": lambda self: self.computed("E", self.energy),
        "solver.nfev": lambda self: min(self.nfev, INTEGER_MAX),
    }

    def begin(self) -> None:
        """Take the state from the start values; they may be wrong before initialization ends."""
        self.phi, self.w, self.nfev = self["phi_start"], self["w_start"], 0
        self.pendulum = Pendulum(*(self[name] for name in Pendulum._fields))

    @classmethod
    def problems(cls, values: Mapping[str, Any]) -> list[str]:
        """Return what the model cannot compute with although each parameter by itself is allowed."""
        return Pendulum(*(values[name] for name in Pendulum._fields)).out_of_range()

    def start(self) -> str | None:
        """Prepare the method; return a warning of an unstable step size."""
        method = SolverMethod(self["solver.method"])
        motion = self.pendulum.motion()
        self.integration = Integration(method, self["solver.stepSize"], motion, "pendulum", "torque")
        return self.integration.warning()

    def hold(self) -> None:
        """Take over the torque for the steps to come."""
        self.integration.hold(self.pendulum.motion(self["tau"]))

    def advance(self, time: float, duration: float) -> None:
        """Advance the state from `time` over `duration` [s], or raise OverflowError with the reason."""
        phi, w, nfev = self.integration.advance(self.phi, self.w, time, duration)
        self.phi, self.w, self.nfev = phi, w, self.nfev + nfev

    def save(self) -> dict[str, Any]:
        """Return what belongs to the state besides the values of the variables."""
        return {"phi": self.phi, "w": self.w, "nfev": min(self.nfev, INTEGER_MAX)}

    def restore(self, entries: Mapping[str, Any]) -> None:
        """Take over what `save` returned."""
        self.phi, self.w, self.nfev = entries["phi"], entries["w"], entries["nfev"]

    def acceleration(self) -> float:
        """Return der(w) [rad/s2]."""
        return self.pendulum.motion(self["tau"]).acceleration()(self.phi, self.w)

    def energy(self) -> float:
        """Return the mechanical energy [J]."""
        return self.pendulum.energy(self.phi, self.w)

    def computed(self, name: str, compute: Callable[[], float]) -> float:
        """Return the value of an output, or fail where it is not finite."""
        try:
            value = compute()
        except (ValueError, ZeroDivisionError):  # math.sin(inf), m = 0 before the parameters are checked
            value = nan
        if not isfinite(value):
            self.fail(
                f"{name} is out of the range of a double at phi = {self.phi!r} rad, w = {self.w!r} rad/s, "
                f"tau = {self['tau']!r} N.m"
            )
        return value + 0.0  # -0.0 becomes 0.0
