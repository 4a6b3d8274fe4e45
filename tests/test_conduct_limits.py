"""Where a double ends: stop times, clocks, zeros; and what is said of it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import product
from math import inf, nan, nextafter
from sys import float_info

import pytest

from methods.solvers import SolverMethod
from tests.driver import ERROR, OK, Fmu, Instance, is_error
from tests.plants import Plant
from tests.test_conduct_reports import FAULTS
from tests.twin import Twin

EPS = float_info.epsilon
TINY = 5e-324


def bits(*values: float) -> bytes:
    return struct.pack(f"{len(values)}d", *values)


def drifting(plant: Plant) -> dict[str, float]:
    """Return start values of a motion that no step is too long for."""
    return plant.pull(0.0) | {"solver.stepSize": 1e4, plant.drag: 0.0}


def setup(instance: Instance, start: float, stop: float | None) -> int:
    return instance.call("fmi2SetupExperiment", 0, 0.0, start, stop is not None, stop or 0.0)


def begin(instance: Instance) -> None:
    for call in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"):
        assert instance.call(call) == OK, instance.errors


# The stop time: start [s], stop [s], communication step [s]
EXPERIMENTS = {
    "default": (0.0, 10.0, 0.01),
    "from far to zero": (-1e6, 0.0, 0.1),
    "from far to zero, short steps": (-1e6, 0.0, 1e-3),
    "far from zero": (1e6, 1e6 + 1.0, 0.1),
    "negative": (-1e6, -1e6 + 1.0, 0.1),
    "from far to near": (-1e9, 1.0, 0.1),
    "1e9 s, 1 s": (0.0, 1e9, 1.0),
    "1e9 s, 10 s": (0.0, 1e9, 10.0),
    "1e9 s, 2.5 s": (0.0, 1e9, 2.5),
    "1e9 s, 1000 s": (0.0, 1e9, 1e3),
    "1e12 s": (0.0, 1e12, 1.0),
    "milliseconds": (-1e-3, 0.0, 1e-4),
    "steps near the rounding of the clock": (0.0, 1e6, 1e-9),
}
each_experiment = pytest.mark.parametrize(
    ("start", "stop", "duration"), EXPERIMENTS.values(), ids=EXPERIMENTS
)


def slack(start: float, stop: float, duration: float) -> Fraction:
    """Return by how much [s] a step may end beyond the stop time.

    A clock that adds up its steps drifts with the times that it has passed, and FMPy takes a relative 1e-9 for
    equal; but never a tenth of a step, unless the times themselves are rounded to more.
    """
    largest = Fraction(max(abs(start), abs(stop)))
    return max(4 * Fraction(EPS) * largest, min(largest / 10**9, Fraction(duration) / 10))


def step_that_ends(instance: Instance, end: Fraction, duration: float, unit: Fraction) -> int:
    """Step over `duration` to `end`, which the rounding of the two times moves by a quarter of `unit` at most."""
    time = float(end - Fraction(duration))
    assert abs(Fraction(time + duration) - end) <= unit / 4
    return instance.step(time, duration)


@each_experiment
def test_a_step_ends_beyond_the_stop_time_by_no_more_than_rounding(
    fmu: Fmu, start: float, stop: float, duration: float
) -> None:
    unit = slack(start, stop, duration)
    with fmu.instance() as instance:
        assert instance.initialize(drifting(fmu.plant), time=start, stop=stop) == OK
        for allowed in (-1.0, 0.0, 0.5, 0.7):
            assert step_that_ends(instance, stop + Fraction(allowed) * unit, duration, unit) == OK
        before = instance.get(*fmu.plant.calculated)
        for refused in (1.3, 2.0, 10.0):
            assert is_error(step_that_ends(instance, stop + Fraction(refused) * unit, duration, unit))
        assert is_error(instance.step(stop, duration))
        assert instance.get(*fmu.plant.calculated) == before
        assert len(instance.errors) == 4
        assert step_that_ends(instance, Fraction(stop), duration, unit) == OK


@pytest.mark.parametrize("duration", [1.0, 10.0, 2.5, 1e3])
def test_a_billion_seconds_end_within_their_rounding(fmu: Fmu, duration: float) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(drifting(fmu.plant), stop=1e9) == OK
        assert is_error(instance.step(1e9 - duration + 1.5, duration))
        assert instance.step(1e9 - duration + 2.0**-22, duration) == OK  # two units in the last place of 1e9
        assert instance.step(1e9 - duration, duration) == OK


@pytest.mark.parametrize("time", [0.0, -3.0, 1e6])
def test_an_experiment_without_length_has_no_step(fmu: Fmu, time: float) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(time=time, stop=time) == OK
        for duration in (1e-3, 1.0, 1e9):
            assert is_error(instance.step(time, duration))


def test_the_refusal_names_the_stop_time(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(time=-1.0, stop=0.1) == OK
        assert is_error(instance.step(0.0, 0.3))
        assert instance.errors == [
            f"{fmu.plant.system}: no step from t = 0.0 s over 0.3 s: "
            "it must end at a finite time, not beyond the stop time (0.1 s)"
        ]


@pytest.mark.parametrize(
    ("first", "second", "end", "status"),
    [
        ((0.0, 1.0), (0.0, None), 1e6, OK),
        ((0.0, None), (0.0, 1.0), 2.0, ERROR),
        ((0.0, 1.0), (0.0, 2.0), 2.0, OK),
        ((0.0, 2.0), (0.0, 1.0), 2.0, ERROR),
        ((-1e9, 1.0), (0.0, 1.0), 1.0 + 1e-3, ERROR),  # the first start time had left more to rounding
        ((0.0, 1.0), (-1e9, 1.0), 1.0 + 1e-3, OK),
        ((0.0, 1.0), (nan, None), 2.0, ERROR),  # what is refused replaces nothing
        ((0.0, 1.0), (nan, None), 1.0, OK),
        ((0.0, 1.0), (0.0, -1.0), 1.0, OK),
    ],
    ids=str,
)
def test_a_second_experiment_replaces_the_first(
    fmu: Fmu,
    first: tuple[float, float | None],
    second: tuple[float, float | None],
    end: float,
    status: int,
) -> None:
    with fmu.instance() as instance:
        assert setup(instance, *first) == OK
        refused = second[0] != second[0] or (second[1] is not None and second[1] < second[0])
        assert is_error(setup(instance, *second)) == refused
        begin(instance)
        assert is_error(instance.step(end - 0.1, 0.1)) == is_error(status)


def test_start_and_stop_time_are_saved_and_restored(fmu: Fmu) -> None:
    def saved(start: float, stop: float | None) -> bytes:
        with fmu.instance() as instance:
            assert instance.initialize(time=start, stop=stop) == OK
            state = instance.save()
            data = instance.serialize(state)
            instance.free_state(state)
            return data

    far, near, endless = saved(-1e9, 1.0), saved(0.0, 1.0), saved(0.0, None)
    with fmu.instance() as instance:
        assert instance.initialize(time=5.0, stop=5.5) == OK
        for data, end, allowed in (
            (far, 1.0 + 1e-3, True),
            (near, 1.0 + 1e-3, False),
            (endless, 1.0 + 1e-3, True),
            (near, 1.0, True),
            (far, 1.1, False),
            (endless, 1e6, True),
        ):
            assert instance.restore_bytes(data) == OK
            assert (instance.step(end - 0.1, 0.1) == OK) == allowed


# The clock: time, communication step, solver.stepSize, and the rounding of the times 4*eps*(|time| + step), all in s
COARSE = {
    "1e15 s": (1e15, 1.0, 1e-3, 4 * EPS * (1e15 + 1.0)),
    "1e14 s": (1e14, 1.0, 1e-3, 4 * EPS * (1e14 + 1.0)),
    "-1e14 s": (-1e14, 1.0, 1e-3, 4 * EPS * (1e14 + 1.0)),
    "1e20 s": (1e20, 1e3, 1e-3, 4 * EPS * 1e20),
    "-1.5e308 s": (-1.5e308, 1.0, 1e-3, 4 * EPS * 1.5e308),
    "a step shorter than the rounding": (1e6, 1e-12, 1e-12, 4 * EPS * (1e6 + 1e-12)),
}


@pytest.mark.parametrize(("time", "duration", "h", "rounding"), COARSE.values(), ids=COARSE)
def test_a_clock_too_coarse_for_the_substeps_is_refused(
    fmu: Fmu, time: float, duration: float, h: float, rounding: float
) -> None:
    twin = Twin(fmu.plant, {"solver.stepSize": h})
    with fmu.running({"solver.stepSize": h}) as instance:
        twin.step(0.0, h)
        assert instance.step(0.0, h) == OK
        assert is_error(instance.step(time, duration))
        assert instance.errors == [
            f"{fmu.plant.system}: no step from t = {time!r} s over {duration!r} s: "
            f"its times are rounded to {rounding!r} s, which is more than the longest substep ({h!r} s)"
        ]
        assert instance.get(*fmu.plant.calculated) == twin.calculated
        twin.step(h, h)
        assert instance.step(h, h) == OK
        assert instance.get(*fmu.plant.calculated) == twin.calculated


def test_a_clock_may_be_rounded_to_a_whole_substep(fmu: Fmu) -> None:
    time, duration = 2.0**50 - 1.0, 1.0  # 4*eps*(time + duration) is 1 s, without rounding
    for h, allowed in ((1.0, True), (nextafter(1.0, inf), True), (nextafter(1.0, 0.0), False)):
        with fmu.running(drifting(fmu.plant) | {"solver.stepSize": h}) as instance:
            assert (instance.step(time, duration) == OK) == allowed
            assert instance.get("solver.nfev") == (4 * allowed,)


@pytest.mark.parametrize("time", [1e12, -1e12])
def test_a_millisecond_at_a_trillion_seconds_is_taken(fmu: Fmu, time: float) -> None:
    with fmu.running() as instance:
        assert instance.step(time, 1.0) == OK  # its times are rounded to 0.9 ms
        assert instance.get("solver.nfev") == (4 * 1000,)


@pytest.mark.parametrize(
    ("time", "duration", "max_step", "expected"),
    [
        (1e12, 1.8e-3, 1e-3, 2),
        (1e12, 1.0, 1e-3, 1000),
        (1e9, 1.8e-6, 1e-6, 2),
        (3e14, 0.58, 1.0, 1),
        (1e9, 2.5, 1.0, 3),
    ],
)
def test_near_the_rounding_of_the_clock_a_substep_is_too_long_by_a_tenth_at_most(
    fmu: Fmu, time: float, duration: float, max_step: float, expected: int
) -> None:
    with fmu.running({"solver.stepSize": max_step}, time=time) as instance:
        assert instance.step(time, duration) == OK, instance.errors
        assert instance.get("solver.nfev") == (4 * expected,)


@pytest.mark.parametrize(("time", "duration"), [(1e15, 1e15), (-1.5e308, 1.5e308)])
def test_of_too_many_substeps_and_a_coarse_clock_the_first_is_told(
    fmu: Fmu, time: float, duration: float
) -> None:
    with fmu.running() as instance:
        assert is_error(instance.step(time, duration))
        assert "at most 2147483647 are allowed" in instance.errors[0]
        assert "rounded" not in instance.errors[0]


@pytest.mark.parametrize("duration", [TINY, 1e-300])
@pytest.mark.parametrize("time", [0.0, 1e6, -1e6])
def test_the_shortest_steps_stay_legal_where_the_clock_does_not_see_them(
    fmu: Fmu, time: float, duration: float
) -> None:
    with fmu.running(time=time) as instance:
        for count in (1, 2, 3):
            assert instance.step(time, duration) == OK
            assert instance.get("solver.nfev") == (4 * count,)


# Texts
HASHED, SHOWN, ON_STDERR = "plant#r0##%", "plant##r0####percent", "plant#r0##percent"


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_hash_is_doubled_in_the_log_where_it_would_name_a_variable(
    fmu: Fmu, fault: Callable[[Instance], int], capfd: pytest.CaptureFixture[str]
) -> None:
    with fmu.instance(HASHED) as instance:
        fault(instance)
        (text,) = instance.errors
    assert text.startswith(f"{SHOWN}: ")
    assert "#" not in text.removeprefix(SHOWN)
    with fmu.instance(HASHED, logging=False) as instance:
        fault(instance)
    lines = capfd.readouterr().err.splitlines()
    assert lines == ([] if fmu.native else [ON_STDERR + text.removeprefix(SHOWN)])


def test_a_state_of_another_interface_is_refused_by_its_name(fmu: Fmu) -> None:
    ours = fmu.plant.interface.state_format(fmu.name)
    theirs = ours[:-4] + "#%#0"
    with fmu.running({fmu.plant.input: 0.5}) as instance:
        state = instance.save()
        data = instance.serialize(state)
        instance.free_state(state)
        skipped = 4 if fmu.native else 8
        body = data[skipped:]
        assert body.count(ours.encode()) == 1
        body = body.replace(ours.encode(), theirs.encode())
        checksum = zlib.crc32(body)
        forged = (struct.pack("=I", checksum) if fmu.native else b"%08x" % checksum) + body
        assert is_error(instance.restore_bytes(forged))
        text = f"{fmu.plant.system}: cannot restore the state: it is of '{ours[:-4]}##percent##0', this is '{ours}'"
        assert instance.errors == [text]
        assert instance.restore_bytes(data) == OK


# Zeros
ZEROS = (0.0, -0.0)


def special_starts(plant: Plant) -> Iterator[dict[str, float]]:
    """Yield start values with zeros of both signs wherever zeros are allowed."""
    names = (plant.x_start, plant.v_start, plant.input, plant.drag)
    for values in product(ZEROS, ZEROS, ZEROS, (0.0, -0.0, 0.5)):
        for w02 in (0.0, -0.0, 9.81, -9.81):
            if plant.can_pull(w02):
                yield plant.pull(w02) | dict(zip(names, values, strict=True))


def test_zeros_have_the_same_sign_on_both_carriers(carriers: list[Fmu], plant: Plant) -> None:
    for values in special_starts(plant):
        found = set()
        for fmu in carriers:
            with fmu.running(values) as instance:
                assert bits(*instance.get(*values)) == bits(*values.values()), values  # what was set is kept
                # +0.0 whatever the signs of what it is made of
                assert bits(*instance.get(plant.a)) == bits(0.0), values
                found.add(bits(*instance.get(*plant.state, plant.a, plant.energy)))
        assert len(found) == 1, values


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
def test_after_a_step_zeros_have_the_same_sign_on_both_carriers(
    carriers: list[Fmu], plant: Plant, method: SolverMethod
) -> None:
    for values in special_starts(plant):
        found = set()
        for fmu in carriers:
            with fmu.running(values | {"solver.method": method}) as instance:
                instance.run([0.0, 0.01, 0.02])
                found.add(bits(*instance.get(*plant.state, plant.a, plant.energy)))
        assert len(found) == 1, values
