"""A model in plain Python, without the FMI shell: what its FMU must return, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

from methods.integration import Integration
from methods.solvers import METHODS, SolverMethod
from tests.plants import PENDULUM, Plant


def integration(method: SolverMethod, step_size: float, model: Any, plant: Plant = PENDULUM) -> Integration:
    """Return the communication steps of `model`."""
    return Integration(method, step_size, model.motion(0.0), plant.system, plant.quantity)


class Twin:
    """The kernel without the FMI shell."""

    def __init__(self, plant: Plant, start: Mapping[str, float] | None = None) -> None:
        values = plant.defaults | dict(start or {})
        model = plant.slave.model
        self.model = model(*(values[name] for name in model._fields))
        self.x, self.v, self.nfev = values[plant.x_start], values[plant.v_start], 0
        self.input = values[plant.input]
        method = SolverMethod(values["solver.method"])
        self.solve = METHODS[method].solver
        self.integration = integration(method, values["solver.stepSize"], self.model, plant)
        self.max_step = self.integration.max_step

    def step(self, time: float, duration: float) -> None:
        n = self.integration.substeps(time, duration)
        motion = self.model.motion(self.input)
        self.x, self.v, nfev = self.solve(motion, self.x, self.v, duration / n, n)
        self.nfev += nfev

    def save(self) -> Twin:
        return copy(self)

    @property
    def calculated(self) -> tuple[float, ...]:
        """The values of what the plant calculates."""
        a = self.model.motion(self.input).acceleration()(self.x, self.v)
        return self.x, self.v, a, self.model.energy(self.x, self.v), self.nfev
