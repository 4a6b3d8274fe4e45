"""The checks of a communication step cost next to nothing."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import pytest

from damped_pendulum.solvers import substeps
from slave import TAU, DampedPendulum

H = 1e-3
CALLS = 2000


class Bare:
    """What remains of `DampedPendulum.do_step` without its checks: the torque, the substeps, the state."""

    def __init__(self, slave: DampedPendulum) -> None:
        self.__dict__.update(vars(slave))

    def do_step(self, current_time: float, step_size: float) -> bool:
        if self._values[TAU] == self._tau_of_motion:
            n = substeps(current_time, step_size, self._max_step)
            self._phi, self._w, nfev = self._solve(self._motion, self._phi, self._w, step_size / n, n)
            self._nfev += nfev
        return True


def seconds(do_step: Callable[[float, float], bool]) -> float:
    begin = perf_counter()
    for _ in range(CALLS):
        do_step(0.0, H)
    return perf_counter() - begin


@pytest.mark.pythonfmu_only
@pytest.mark.slow
def test_the_checks_cost_less_than_a_microsecond_per_communication_step() -> None:
    slave = DampedPendulum(instance_name="pendulum")
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    slave.do_step(0.0, H)
    bare = Bare(slave)
    # The minima of interleaved runs: what disturbs a run can only make it longer.
    times = [(seconds(slave.do_step), seconds(bare.do_step)) for _ in range(200)]
    checked, unchecked = (min(column) / CALLS for column in zip(*times, strict=True))
    assert checked - unchecked < 1e-6
    assert slave.get_real([9]) == [bare._phi]  # both took the same steps
