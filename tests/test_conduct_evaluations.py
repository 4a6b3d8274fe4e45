"""Evaluations are counted; the count ends where an fmi2Integer does, and the motion goes on."""

from __future__ import annotations

import struct
import zlib

import pytest

from methods.solvers import METHODS, SolverMethod
from tests.driver import OK, Fmu

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
    with fmu.running({fmu.plant.v_start: 0.5, "solver.stepSize": 0.01}) as instance:
        for k in range(7):
            assert instance.step(0.01 * k, 0.01) == OK
        state = instance.save()
        data = instance.serialize(state)
        instance.free_state(state)
        assert instance.restore_bytes(with_evaluations(fmu, data, 28, MOST - missing)) == OK
        before = instance.get(*fmu.plant.state)
        assert instance.get("solver.nfev") == (MOST - missing,)
        for k in range(1, 5):
            assert instance.step(0.07, 0.01) == OK
            assert instance.get("solver.nfev") == (min(MOST - missing + 4 * k, MOST),)
        assert instance.get(*fmu.plant.state) != before  # the motion goes on
        # A full count can be saved and restored like any other.
        state = instance.save()
        data, now = instance.serialize(state), instance.get(*fmu.plant.calculated)
        assert instance.restore(state) == OK
        instance.free_state(state)
    with fmu.instance() as other:
        assert other.restore_bytes(data) == OK
        assert other.get(*fmu.plant.calculated) == now
        assert other.step(0.08, 1.0) == OK
        assert other.get("solver.nfev") == (MOST,)


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
@pytest.mark.parametrize("w02", [0.0, 9.81])
def test_a_method_with_a_fixed_number_of_stages_evaluates_once_a_stage(
    fmu: Fmu, method: SolverMethod, w02: float
) -> None:
    start = fmu.plant.pull(w02) | {"solver.method": method, "solver.stepSize": 0.01}
    with fmu.running(start) as instance:
        for k in range(3):
            assert instance.step(0.07 * k, 0.07) == OK
            (nfev,) = instance.get("solver.nfev")
            substeps, stages = (k + 1) * 7, METHODS[method].stages
            # The others evaluate as often as their equations ask for, and at least once a substep.
            assert nfev == substeps * stages if stages is not None else nfev >= substeps
