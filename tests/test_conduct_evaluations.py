"""The count of evaluations ends where an fmi2Integer does, and the motion goes on."""

from __future__ import annotations

import struct
import zlib

import pytest

from tests.driver import OK, Fmu
from tests.twin import OUTPUTS

MOST = 2147483647  # evaluations that an fmi2Integer can count


def with_evaluations(fmu: Fmu, data: bytes, old: int, new: int) -> bytes:
    """Return the state `data` with another number of evaluations and the checksum that belongs to it."""
    if fmu.native:
        begin, count = 4, (struct.pack("=d", old), struct.pack("=d", new))
    else:
        begin, count = 8, (b'"nfev": %d' % old, b'"nfev": %d' % new)
    assert data.count(count[0]) == 1
    body = data[begin:].replace(*count)
    checksum = zlib.crc32(body)
    return (struct.pack("=I", checksum) if fmu.native else b"%08x" % checksum) + body


@pytest.mark.parametrize("missing", range(10))
def test_the_count_of_evaluations_stays_at_the_largest_that_can_be_read(fmu: Fmu, missing: int) -> None:
    with fmu.running({"solver.stepSize": 0.01}) as instance:
        for k in range(7):
            assert instance.step(0.01 * k, 0.01) == OK
        state = instance.save()
        data = instance.serialize(state)
        instance.free_state(state)
        assert instance.restore_bytes(with_evaluations(fmu, data, 28, MOST - missing)) == OK
        before = instance.get("phi", "w")
        assert instance.get("solver.nfev") == (MOST - missing,)
        for k in range(1, 5):
            assert instance.step(0.07, 0.01) == OK
            assert instance.get("solver.nfev") == (min(MOST - missing + 4 * k, MOST),)
        assert instance.get("phi", "w") != before  # the motion goes on
        # A full count can be saved and restored like any other.
        state = instance.save()
        data, now = instance.serialize(state), instance.get(*OUTPUTS)
        assert instance.restore(state) == OK
        instance.free_state(state)
    with fmu.instance() as other:
        assert other.restore_bytes(data) == OK
        assert other.get(*OUTPUTS) == now
        assert other.step(0.08, 1.0) == OK
        assert other.get("solver.nfev") == (MOST,)
