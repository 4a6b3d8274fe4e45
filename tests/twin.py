"""The pendulum in plain Python: what the FMU must return, bit for bit."""

from __future__ import annotations

from copy import copy

from damped_pendulum.interface import DEFAULTS, VARIABLES
from damped_pendulum.model import Pendulum
from methods.integration import Integration
from methods.solvers import METHODS, SolverMethod, substeps


def longest_substep(method: SolverMethod, step_size: float, pendulum: Pendulum) -> float:
    """Return the upper bound of the substeps [s]."""
    return Integration(method, step_size, pendulum.motion(), "pendulum", "torque").max_step


class Twin:
    """The kernel without the FMI shell."""

    def __init__(self, **start: float) -> None:
        values = DEFAULTS | {name.replace("solver_", "solver."): value for name, value in start.items()}
        self.pendulum = Pendulum(*(values[name] for name in ("m", "L", "gamma", "g")))
        self.phi, self.w, self.nfev = values["phi_start"], values["w_start"], 0
        self.tau = values["tau"]
        method = SolverMethod(values["solver.method"])
        self.solve = METHODS[method].solver
        self.max_step = longest_substep(method, values["solver.stepSize"], self.pendulum)

    def step(self, time: float, duration: float) -> None:
        n = substeps(time, duration, self.max_step)
        motion = self.pendulum.motion(self.tau)
        self.phi, self.w, nfev = self.solve(motion, self.phi, self.w, duration / n, n)
        self.nfev += nfev

    def save(self) -> Twin:
        return copy(self)

    @property
    def outputs(self) -> tuple[float, ...]:
        """phi, w, a, E, solver.nfev."""
        a = self.pendulum.motion(self.tau).acceleration()(self.phi, self.w)
        return self.phi, self.w, a, self.pendulum.energy(self.phi, self.w), self.nfev


VR = {variable.name: vr for vr, variable in enumerate(VARIABLES)}
OUTPUTS = ("phi", "w", "a", "E", "solver.nfev")
