"""States of the native FMU: in memory, as bytes, and forged."""

import struct
import zlib
from ctypes import byref, c_char, create_string_buffer
from math import inf, nan

import pytest
from fmpy.fmi2 import fmi2FMUstate

from damped_pendulum.interface import INTERFACE, VARIABLES
from native import build as native
from tests.driver import OK, Instance
from tests.plants import PENDULUM

H = 0.01


def run_on(instance: Instance, steps: int) -> tuple[float, ...]:
    for i in range(steps):
        assert instance.step(1.0 + i * H, H) == OK
    return instance.get(*PENDULUM.calculated, "tau")


def test_a_restored_state_has_the_same_future(instance: Instance) -> None:
    instance.start({"gamma": 0.3, "solver.method": 4, "tau": 0.7}, stop=100.0)
    run_on(instance, 3)
    assert instance.input_derivatives({1: 2.0, 3: -5.0}) == OK
    state = instance.save()
    data = instance.serialize(state)
    future = run_on(instance, 5)
    assert instance.restore(state) == OK
    assert run_on(instance, 5) == future
    instance.free_state(state)
    assert state.value is None
    with instance.fmu.instance() as other:
        assert other.restore_bytes(data) == OK
        assert run_on(other, 5) == future
        assert "fixed parameter" in other.refusal(other.set("m", 1.0))  # the mode is part of the state


def test_a_state_from_bytes_is_a_new_one_whatever_the_variable_held(instance: Instance) -> None:
    instance.start()
    data = instance.serialize(instance.save())
    assert instance.step(0.0, H) == OK
    live = instance.save()
    later = instance.serialize(live)
    buffer = (c_char * len(data)).from_buffer_copy(data)
    for held in (0xDEAD, live.value):
        state = fmi2FMUstate(held)
        assert instance.call("fmi2DeSerializeFMUstate", buffer, len(data), byref(state)) == OK
        assert state.value not in (held, None)
        assert instance.serialize(state) == data
        instance.free_state(state)
    assert instance.serialize(live) == later
    wrong = fmi2FMUstate(0xDEAD)
    buffer[9] = b"?"
    instance.refusal(instance.call("fmi2DeSerializeFMUstate", buffer, len(data), byref(wrong)))
    assert wrong.value == 0xDEAD


def test_a_state_that_is_pointed_to_is_used_again(instance: Instance) -> None:
    instance.start()
    state = instance.save()
    place, before = state.value, instance.serialize(state)
    assert instance.step(0.0, H) == OK
    assert instance.call("fmi2GetFMUstate", byref(state)) == OK
    assert state.value == place
    assert instance.serialize(state) != before


def test_bytes_of_a_state_may_have_more_room_than_they_need(instance: Instance) -> None:
    state = instance.save()
    data = instance.serialize(state)
    for room in (len(data), len(data) + 3):
        buffer = create_string_buffer(b"?" * (len(data) + 8), len(data) + 8)
        assert instance.call("fmi2SerializeFMUstate", state, buffer, room) == OK
        assert buffer.raw == data + b"?" * 8
    assert f"a state needs {len(data)} bytes, there are {len(data) - 1}" in instance.refusal(
        instance.call("fmi2SerializeFMUstate", state, buffer, len(data) - 1)
    )


def test_a_damaged_state_is_refused(instance: Instance) -> None:
    data = instance.serialize(instance.save())
    for i in range(len(data)):
        for bit in (0x01, 0x80):
            damaged = data[:i] + bytes([data[i] ^ bit]) + data[i + 1 :]
            message = instance.refusal(instance.deserialize(damaged)[0])
            assert message == "pendulum: cannot restore the state: the bytes are damaged (wrong checksum)"
    for wrong in (data[:-1], data + b"\0", b""):
        assert f"the bytes are damaged ({len(wrong)}, not {len(data)})" in instance.refusal(
            instance.deserialize(wrong)[0]
        )


def refusal_of_forged(instance: Instance, at: int, patch: bytes) -> str:
    """Return with what the state of an instance is refused that is patched and has the right checksum."""
    forged = bytearray(instance.serialize(instance.save()))
    start = at % len(forged)
    forged[start : start + len(patch)] = patch
    forged[:4] = struct.pack("=I", zlib.crc32(forged[4:]))
    return instance.refusal(instance.deserialize(bytes(forged))[0])


@pytest.mark.parametrize(
    ("at", "patch", "words"),
    [
        (
            4,
            b"DampedPendulumNative 0.0.0\0",
            f"of 'DampedPendulumNative 0.0.0', this is '{INTERFACE.state_format(native.MODEL_NAME)}'",
        ),
        (-8, struct.pack("=q", 9), "no instance can be in it"),  # the mode
        (64 + 8 * PENDULUM.reference["solver.nfev"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * PENDULUM.reference["phi"], struct.pack("=d", inf), "no instance can be in it"),
        (64 + 8 * PENDULUM.reference["m"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * PENDULUM.reference["solver.method"], struct.pack("=d", nan), "no instance can be in it"),
        (64 + 8 * PENDULUM.reference["solver.method"], struct.pack("=d", 2.5), "no instance can be in it"),
        (64 + 8 * PENDULUM.reference["solver.nfev"], struct.pack("=d", 0.5), "no instance can be in it"),
        (64 + 8 * len(VARIABLES) + 8, struct.pack("=d", nan), "no instance can be in it"),  # der2(tau)
        (64 + 8 * len(VARIABLES) + 24, struct.pack("=d", -H), "no instance can be in it"),  # the time since
        (-32, struct.pack("=d", nan), "no instance can be in it"),  # the time
        (-24, struct.pack("=d", inf), "no instance can be in it"),  # the start time
        (-16, struct.pack("=d", -1.0), "no instance can be in it"),  # the stop time
    ],
)
def test_a_state_with_the_right_checksum_is_refused_too(
    instance: Instance, at: int, patch: bytes, words: str
) -> None:
    instance.start()
    assert words in refusal_of_forged(instance, at, patch)


@pytest.mark.parametrize(
    ("name", "value"), [("phi", 9.0), ("w", -0.0), ("w", nan), ("phi_start", 9.0), ("solver.nfev", 4.0)]
)
def test_before_the_first_step_a_state_is_that_of_the_start_values(
    instance: Instance, name: str, value: float
) -> None:
    patch = struct.pack("=d", value)
    assert "no instance can be in it" in refusal_of_forged(instance, 64 + 8 * PENDULUM.reference[name], patch)


def test_start_values_that_are_wrong_are_saved_and_restored(instance: Instance) -> None:
    assert instance.set("phi_start", nan) == OK
    state = instance.save()
    assert instance.restore(state) == OK
    assert instance.restore_bytes(instance.serialize(state)) == OK
    instance.free_state(state)


def test_a_state_before_the_first_step_has_no_step_behind_it(instance: Instance) -> None:
    forged = refusal_of_forged(instance, 64 + 8 * len(VARIABLES) + 24, struct.pack("=d", H))
    assert "no instance can be in it" in forged
