"""Communication steps: a method, its substeps, and what to say where they go wrong."""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NoReturn

from .inline import inlined
from .motion import Motion, Solver
from .solvers import MAX_SUBSTEPS, METHODS, SolverMethod, stability_limit, substeps

# Substeps of an explicit method between two looks at the state, which cost as much as a few of them.
BLOCK = 2**16


class Integration:
    """The communication steps of a method with substeps of at most `step_size` [s].

    Parameters
    ----------
    method : the method
    step_size : upper bound of the substeps [s], > 0
    motion : the motion without drive, which knows the rates that limit the substeps
    system, quantity : what moves and what the input is, for messages

    Attributes
    ----------
    max_step : upper bound of the substeps [s], with which every implicit stage has a single solution, too
    """

    def __init__(
        self, method: SolverMethod, step_size: float, motion: Motion, system: str, quantity: str
    ) -> None:
        self.method, self.system, self.quantity = method, system, quantity
        self._free = motion
        self.limit = stability_limit(method, motion.damping_rate, motion.w02)
        diagonal = METHODS[method].diagonal
        longest = motion.longest_implicit_stage() / diagonal if diagonal else inf
        self.max_step = min(step_size, longest)
        # The noise of a clock may take an implicit stage to half of the margin of its length.
        self._longest = longest * (1.0 + 5e-10)
        # The implicit methods look at the state themselves, and a second call would evaluate their first stage anew.
        self._block = MAX_SUBSTEPS if diagonal else BLOCK
        self._motion: Motion
        self._solve: Solver

    def warning(self) -> str | None:
        """Return how to mend an unstable step size, None where it is none; shorter communication steps mend it, too."""
        if self.max_step <= self.limit:
            return None
        return f"substeps of solver.stepSize = {self.max_step!r} s would be unstable: {self._advice(self.max_step)}"

    def hold(self, motion: Motion) -> None:
        """Take `motion`, with its drive, for the steps to come."""
        self._motion, self._solve = motion, inlined(METHODS[self.method].solver, motion)

    def substeps(self, time: float, duration: float) -> int:
        """Return the number of substeps of a step from `time` over `duration` [s]; see `solvers.substeps`."""
        return substeps(time, duration, self.max_step, self._longest)

    def advance(self, x: float, v: float, time: float, duration: float) -> tuple[float, float, int]:
        """Return the state after a step from `time` over `duration` [s], and its evaluations.

        Raises
        ------
        OverflowError : the substeps would be too many or too short, or leave the range of a double
        """
        n = self.substeps(time, duration)
        h = duration / n
        try:
            solve = self._solve if n <= self._block else self._solve_in_blocks
            x_then, v_then, nfev = solve(self._motion, x, v, h, n)
        except ValueError:  # math.sin(inf)
            self._report_divergence(x, v, time, h, n)
        if not (isfinite(x_then) and isfinite(v_then)):
            self._report_divergence(x, v, time, h, n)
        # The sign of a zero depends on the terms that are left out: -0.0 becomes 0.0.
        return x_then + 0.0, v_then + 0.0, nfev

    def _solve_in_blocks(
        self, motion: Motion, x: float, v: float, h: float, n: int
    ) -> tuple[float, float, int]:
        """Do what the method does, but end with the block in which the state leaves the range of a double."""
        nfev = 0
        for first in range(0, n, self._block):
            x, v, more = self._solve(motion, x, v, h, min(self._block, n - first))
            nfev += more
            if not (isfinite(x) and isfinite(v)):
                break
        return x, v, nfev

    def _report_divergence(self, x: float, v: float, time: float, h: float, n: int) -> NoReturn:
        """Raise with the substep that left the range of a double, found by taking the `n` one by one."""
        count = 0
        try:
            while isfinite(x) and isfinite(v) and count < n:
                count += 1
                x, v, _ = self._solve(self._motion, x, v, h, 1)
        except ValueError:  # math.sin(inf)
            pass
        raise OverflowError(
            f"diverged at t = {time + count * h!r} s: substep {count} of {h!r} s with "
            f"{self.method.name} left the range of a double; {self._advice(h)}"
        )

    def _advice(self, h: float) -> str:
        """Say what to do about substeps of `h` [s] that went wrong or will."""
        method, limit = self.method.name, f"{self.limit:.6g} s"
        mend = f"check the {self.quantity} and the start values, or use a smaller solver.stepSize"
        if self.limit == inf:
            return f"{method} is stable at every step size for small swings of this {self.system}: {mend}"
        if h <= self.limit:
            within = f"{h!r} s is within the stability limit of {method}"
            return f"{within} for small swings of this {self.system} ({limit}): {mend}"
        better = self._better_method()
        if self.limit == 0.0:
            return f"{method} has no stable step size for this {self.system}: use {better}"
        return (
            f"the stability limit of {method} for this {self.system} is {limit}: "
            f"use {_stable_step(self.limit)}{better and f', or {better}'}"
        )

    def _better_method(self) -> str:
        """Return the setting of a method that allows longer substeps, "" where none is as accurate."""
        damping_rate, w02 = self._free.damping_rate, self._free.w02
        if damping_rate >= 2.0 * sqrt(abs(w02)):
            l_stable = (SolverMethod.TRBDF2, SolverMethod.SDIRK4)
            return "solver.method = " + " or ".join(f"{method.value} ({method.name})" for method in l_stable)
        rk4 = SolverMethod.ExplicitRungeKutta4
        limit = stability_limit(rk4, damping_rate, w02)
        return (
            f"solver.method = {rk4.value} ({rk4.name}) with {_stable_step(limit)}"
            if limit > self.limit
            else ""
        )


def _stable_step(limit: float) -> str:
    """Return the setting of a step size that stays below `limit` [s] when it is rounded to five digits."""
    return f"solver.stepSize = {0.9999 * limit:.5g} s or less"
