"""Functions that the FMUs answer differently, as README's table "Where the two differ" says."""

from __future__ import annotations

from ctypes import byref, c_char_p, c_double, c_int, c_size_t, create_string_buffer
from math import isnan

import pytest
from fmpy.fmi2 import (
    fmi2DoStepStatus,
    fmi2LastSuccessfulTime,
    fmi2PendingStatus,
    fmi2Terminated,
)

from tests.driver import DISCARD, ERROR, OK, WARNING, Fmu, integers, reals
from tests.twin import Twin


def test_there_is_no_step_to_cancel(fmu: Fmu) -> None:
    with fmu.running() as instance:
        assert instance.call("fmi2CancelStep") == ERROR
        (entry,) = instance.log
    native = f"{fmu.plant.system}: there is no step to cancel"
    assert entry.text == (native if fmu.native else "FMI function not supported: fmi2CancelStep")


@pytest.mark.pythonfmu_only
def test_derivatives_are_an_error_that_pythonfmu_words(fmu: Fmu) -> None:
    with fmu.running() as instance:
        x, drive = instance.references(fmu.plant.x), instance.references(fmu.plant.input)
        calls = {
            "fmi2SetRealInputDerivatives": (drive, 1, integers([1]), reals([0.0])),
            "fmi2GetRealOutputDerivatives": (x, 1, integers([1]), reals([0.0])),
            "fmi2GetDirectionalDerivative": (x, 1, drive, 1, reals([1.0]), reals([0.0])),
        }
        for function, arguments in calls.items():
            instance.log.clear()
            assert instance.call(function, *arguments) == ERROR
            (entry,) = instance.log
            assert entry.text.startswith("FMI function not supported: fmi")


def test_what_has_no_status_is_discarded_but_by_one_function_of_pythonfmu(fmu: Fmu) -> None:
    with fmu.running() as instance:
        asked = {
            "fmi2GetStatus": (fmi2DoStepStatus, c_int()),
            "fmi2GetRealStatus": (fmi2DoStepStatus, c_double()),
            "fmi2GetIntegerStatus": (fmi2DoStepStatus, c_int()),
            "fmi2GetBooleanStatus": (fmi2DoStepStatus, c_int()),
            "fmi2GetStringStatus": (fmi2PendingStatus, c_char_p()),
        }
        for function, (kind, value) in asked.items():
            instance.log.clear()
            status = instance.call(function, kind, byref(value))
            assert status == (DISCARD if fmu.native or function != "fmi2GetStatus" else ERROR)
            assert len(instance.log) == 1


def test_the_end_of_the_last_step_is_known_once_there_is_one(fmu: Fmu) -> None:
    time, ended = c_double(), c_int(7)
    with fmu.running(time=2.0) as instance:
        assert instance.call("fmi2GetRealStatus", fmi2LastSuccessfulTime, byref(time)) == OK
        assert time.value == 2.0 if fmu.native else isnan(time.value)
        assert instance.step(2.0, 0.5) == OK
        assert instance.call("fmi2GetRealStatus", fmi2LastSuccessfulTime, byref(time)) == OK
        assert time.value == 2.5
        assert instance.call("fmi2GetBooleanStatus", fmi2Terminated, byref(ended)) == OK
        assert ended.value == 0


def test_an_unknown_log_category_is_refused_by_the_native_fmu_alone(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        status = instance.call("fmi2SetDebugLogging", 1, 1, (c_char_p * 1)(b"nonsense"))
        assert status == (ERROR if fmu.native else OK)
        assert len(instance.errors) == fmu.native


def test_a_state_that_is_freed_leaves_a_null_in_the_native_fmu_alone(fmu: Fmu) -> None:
    with fmu.running() as instance:
        state = instance.save()
        instance.free_state(state)
        assert (state.value is None) == fmu.native


def test_too_little_room_for_the_bytes_of_a_state_is_noticed_at_the_latest_when_it_is_restored(
    fmu: Fmu,
) -> None:
    with fmu.running() as instance:
        state = instance.save()
        bytes_ = create_string_buffer(10)
        status = instance.call("fmi2SerializeFMUstate", state, bytes_, c_size_t(10))
        assert status == (ERROR if fmu.native else OK)
        assert instance.restore_bytes(bytes_.raw) > WARNING
        instance.free_state(state)


@pytest.mark.parametrize("time", [0.5, -5.0, 0.0, 3.0])
def test_a_communication_point_that_does_not_follow_the_last_is_taken(fmu: Fmu, time: float) -> None:
    """README names it among the limits."""
    twin = Twin(fmu.plant)
    with fmu.running() as instance:
        for start in (0.0, time):
            assert instance.step(start, 0.25) == OK
            twin.step(start, 0.25)
        assert instance.get(*fmu.plant.calculated) == twin.calculated
        assert instance.log == []
