"""Experiments, clocks and the status of the steps of the native FMU."""

from ctypes import byref, c_double, c_int
from math import inf, pi

import pytest
from fmpy.fmi2 import fmi2DoStepStatus, fmi2LastSuccessfulTime, fmi2Terminated

from damped_pendulum.model import Pendulum
from tests.driver import DISCARD, OK, Instance, Log

OUTPUTS = ("phi", "w", "a", "E")
H = 0.01


def test_outputs_are_right_before_the_first_step(instance: Instance) -> None:
    assert instance.set_up(0.0) == OK
    assert instance.call("fmi2EnterInitializationMode") == OK
    for name, value in {"m": 2.0, "L": 0.5, "gamma": 0.1, "g": 9.0, "tau": 0.25, "phi_start": pi / 3}.items():
        assert instance.set(name, value) == OK
    pendulum = Pendulum(2.0, 0.5, 0.1, 9.0)
    expected = (pi / 3, 0.0, pendulum.motion(0.25).acceleration()(pi / 3, 0.0), pendulum.energy(pi / 3, 0.0))
    assert instance.get(*OUTPUTS) == expected
    assert instance.call("fmi2ExitInitializationMode") == OK
    assert instance.get(*OUTPUTS) == expected


def test_a_second_setup_replaces_all_of_the_first(instance: Instance) -> None:
    assert instance.set_up(0.0, stop=1.0) == OK
    assert instance.initialize(time=0.5) == OK
    assert instance.step(1.0, H) == OK


@pytest.mark.parametrize(
    ("start", "stop", "step", "slack"),
    [
        (0.0, 1.0, 0.1, 1e-9),  # that of FMPy
        (-2.0, 1.0, 0.1, 2e-9),
        (0.0, 1e9, 1.5, 0.15),  # a tenth of the step where it is more
        (0.0, 1.0, 1e-12, 1e-13),
        (0.0, 1e9, 1e-6, 4 * 2.0**-52 * 1e9),  # the rounding of the clock at least
    ],
)
def test_a_step_may_end_beyond_the_stop_time_by_what_the_clock_of_a_host_is_off(
    instance: Instance, start: float, stop: float, step: float, slack: float
) -> None:
    """Of the slack 1e-3 is left to the rounding of the time, and no less than two units in its last place."""
    margin = max(1e-3 * slack, 2 * (stop + step) * 2.0**-52)
    assert margin < slack / 1.9
    # The substeps are longer than the clock is coarse.
    instance.start({"solver.stepSize": 2.0}, time=start, stop=stop)
    assert instance.step(stop + slack - margin - step, step) == OK
    begin = stop + slack + margin - step
    assert instance.refusal(instance.step(begin, step)) == (
        f"pendulum: no step from t = {begin!r} s over {step!r} s: it must end at a finite time, "
        f"not beyond the stop time ({stop!r} s)"
    )


def test_a_clock_that_is_coarser_than_a_substep_is_refused(instance: Instance) -> None:
    instance.start({"solver.stepSize": 1e-3})
    assert instance.step(1e12, 1.0) == OK  # rounded to 0.9 ms
    time = 1.2e12
    assert instance.refusal(instance.step(time, 1.0)) == (
        f"pendulum: no step from t = {time!r} s over 1.0 s: its times are rounded to "
        f"{4 * 2.0**-52 * (time + 1.0)!r} s, which is more than the longest substep (0.001 s)"
    )
    assert "would need" in instance.refusal(instance.step(1e15, 1e12))  # the first of two reasons


def test_a_reset_instance_is_a_new_one(instance: Instance) -> None:
    fresh = instance.serialize(instance.save())
    instance.start({"m": 2.0, "solver.method": 1, "tau": 1.0})
    assert instance.step(0.0, H) == OK
    assert instance.reset() == OK
    assert instance.serialize(instance.save()) == fresh


def last_successful_time(instance: Instance) -> float:
    time = c_double()
    assert instance.call("fmi2GetRealStatus", fmi2LastSuccessfulTime, byref(time)) == OK
    return time.value


def test_status_of_steps(instance: Instance) -> None:
    instance.start(stop=1.0)
    assert instance.step(0.0, H) == OK
    ended = c_int(1)
    assert instance.call("fmi2GetBooleanStatus", fmi2Terminated, byref(ended)) == OK
    assert (last_successful_time(instance), ended.value) == (H, 0)
    instance.refusal(instance.step(2.0, H))
    assert last_successful_time(instance) == H
    # It is for steps that were pending.
    assert instance.call("fmi2GetStatus", fmi2DoStepStatus, byref(c_int())) == DISCARD
    assert instance.log == [
        Log(DISCARD, "logStatusDiscard", "pendulum: there is no status of kind 0: no step is pending")
    ]


def test_before_the_first_step_the_last_successful_time_is_the_start_time(instance: Instance) -> None:
    assert instance.initialize(time=2.5) == OK
    assert last_successful_time(instance) == 2.5


def test_of_a_refused_read_nothing_is_written(instance: Instance) -> None:
    assert instance.set("phi_start", inf) == OK
    message = instance.unwritten(2, "fmi2GetReal", instance.references("phi", "E"), 2)
    assert message.startswith("pendulum: E is out of the range of a double at phi = inf rad")
