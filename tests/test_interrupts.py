"""An interrupt before any line of a call leaves the state before the call or that after it, and never one between."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import pytest

from fmi.shell import FmuError
from methods.solvers import SolverMethod
from slave import DampedPendulum
from tests.plants import PENDULUM


def interrupted(call: Callable[[], object], line: int) -> bool:
    """Make a call with Control-C before the line of that number; return whether there was one."""
    count = 0

    def trace(frame: FrameType, event: str, _: object) -> Callable[..., Any] | None:
        nonlocal count
        if "fmu_src" not in frame.f_code.co_filename:
            return None
        if event == "line":
            count += 1
            if count == line:
                sys.settrace(None)
                raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    except (KeyboardInterrupt, FmuError):
        return True
    finally:
        sys.settrace(before)
    return False


def new(**start: float) -> DampedPendulum:
    slave = DampedPendulum(instance_name="pendulum")
    for name, value in start.items():
        slave.set_real([PENDULUM.reference[name]], [value])
    return slave


def running(method: SolverMethod = SolverMethod.ExplicitRungeKutta4, **start: float) -> DampedPendulum:
    slave = new(**start)
    slave.set_integer([PENDULUM.reference["solver.method"]], [method])
    slave.setup_experiment(0.0, 10.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def initializing() -> DampedPendulum:
    slave = new(gamma=0.5)
    slave.enter_initialization_mode()
    return slave


def future(slave: DampedPendulum) -> list[Any]:
    """Return the state and, where there is one, the state after a step."""
    states = [slave._get_fmu_state()]
    if states[0]["mode"] == "stepping":
        slave.set_real([PENDULUM.reference["tau"]], [0.25])
        slave.do_step(0.0, 0.01)
        states.append(slave._get_fmu_state())
    return [repr(state) for state in states]


SAVED = running(SolverMethod.ImplicitEuler, m=2.0, phi_start=1.0, tau=0.5)._get_fmu_state()
CALLS: dict[str, tuple[Callable[[], DampedPendulum], Callable[[DampedPendulum], object]]] = {
    "restore": (running, lambda slave: slave._set_fmu_state(SAVED)),
    "exit": (initializing, lambda slave: slave.exit_initialization_mode()),
    "setup": (new, lambda slave: slave.setup_experiment(1.0, 2.0)),
    "set before": (
        new,
        lambda slave: slave.set_real(
            [PENDULUM.reference["phi_start"], PENDULUM.reference["w_start"]], [1.0, 2.0]
        ),
    ),
    "set torque": (running, lambda slave: slave.set_real([PENDULUM.reference["tau"]], [0.75])),
    "step": (lambda: running(tau=0.5), lambda slave: slave.do_step(0.0, 0.01)),
}


@pytest.mark.parametrize(("prepare", "call"), CALLS.values(), ids=CALLS)
def test_an_interrupt_leaves_no_state_between(
    prepare: Callable[[], DampedPendulum], call: Callable[[DampedPendulum], object]
) -> None:
    untouched, done = prepare(), prepare()
    call(done)
    possible = future(untouched), future(done)
    line = 1
    while True:
        slave = prepare()
        was_interrupted = interrupted(lambda slave=slave: call(slave), line)
        assert future(slave) in possible, line
        if not was_interrupted:
            break
        line += 1
    assert line > 3
