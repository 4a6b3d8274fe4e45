"""The number of substeps is what it should be, and how the host cuts the time does not matter."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import accumulate, pairwise, repeat
from math import hypot, ulp
from pathlib import Path
from random import Random
from sys import float_info

import numpy as np
import pytest
from fmpy import simulate_fmu

from methods.solvers import METHODS, SolverMethod, substeps
from tests.driver import OK, Fmu
from tests.plants import Plant
from tests.twin import Twin

STARTS = (0.0, 1e6, -1e6, -3.0)
Points = Callable[[float, float, int], list[float]]  # start and interval [s], count


def multiples(start: float, interval: float, count: int) -> list[float]:
    """Return communication points as importers with a counter form them."""
    return [start + k * interval for k in range(count + 1)]


def sums(start: float, interval: float, count: int) -> list[float]:
    """Return communication points as importers without a counter form them."""
    return list(accumulate(repeat(interval, count), initial=start))


CLOCKS = {
    "60 Hz, 1 ms": (1 / 60, 1e-3, 17),
    "60 Hz, one substep": (1 / 60, 1 / 60, 1),
    "60 Hz, two": (1 / 60, 1 / 120, 2),
    "60 Hz, ten": (1 / 60, 1 / 600, 10),
    "H = 0.1, one": (0.1, 0.1, 1),
    "H = 0.1, ten": (0.1, 0.01, 10),
    "H = 0.1, 1 ms": (0.1, 1e-3, 100),
    "H = 1/3, one": (1 / 3, 1 / 3, 1),
    "H = 1/3, 1 ms": (1 / 3, 1e-3, 334),
    "H = 1/3, 0.1 s": (1 / 3, 0.1, 4),
    "does not divide": (0.01, 0.003, 4),
    "divides in decimals only": (0.3, 0.1, 3),
    "shorter than a substep": (1e-5, 1e-3, 1),
}
each_clock = pytest.mark.parametrize(("interval", "h", "expected"), CLOCKS.values(), ids=CLOCKS)
each_start = pytest.mark.parametrize("start", STARTS)
each_way = pytest.mark.parametrize("points", [multiples, sums], ids=lambda points: points.__name__)


@each_clock
@each_start
@each_way
def test_the_fmu_takes_the_expected_number_of_substeps(
    fmu: Fmu, interval: float, h: float, expected: int, start: float, points: Points
) -> None:
    with fmu.running({"solver.stepSize": h}, time=start) as instance:
        instance.run(points(start, interval, 20))
        assert instance.get("solver.nfev") == (4 * 20 * expected,)


@pytest.mark.parametrize("n", [1, 10])
@pytest.mark.parametrize("start", [*STARTS, 0.1, 1e9])
def test_a_step_that_is_over_the_rounding_of_its_times_takes_one_substep_more(
    fmu: Fmu, start: float, n: int
) -> None:
    # A communication point is a product and a sum at most, two roundings of eps/2 each; a step has two of them.
    h = 0.25
    rounding = 2 * Fraction(float_info.epsilon) * Fraction(abs(start) + n * h)
    assert 4 * rounding < h
    for units, expected in ((1, n), (4, n + 1)):
        duration = float(n * Fraction(h) + units * rounding)
        # What is left of the excess after it is rounded is still at most, or well over, the rounding of the times.
        assert abs((Fraction(duration) - n * Fraction(h)) / rounding - units) <= Fraction(1, 2)
        with fmu.running({"solver.stepSize": h}, time=start) as instance:
            assert instance.step(start, duration) == OK
            assert instance.get("solver.nfev") == (4 * expected,)


@each_way
@pytest.mark.parametrize(("h", "expected"), [(0.1, 1), (0.01, 10), (0.03, 4)])
def test_a_million_steps_of_a_tenth_never_take_a_substep_too_many(
    h: float, expected: int, points: Points
) -> None:
    clock = points(0.0, 0.1, 1_000_000)
    assert {substeps(time, end - time, h) for time, end in pairwise(clock)} == {expected}


@each_way
def test_the_last_of_a_million_steps_of_a_tenth_are_one_substep_each(fmu: Fmu, points: Points) -> None:
    clock = points(0.0, 0.1, 1_000_000)[-5001:]
    with fmu.running({"solver.stepSize": 0.1}) as instance:
        instance.run(clock)
        assert instance.get("solver.nfev") == (4 * 5000,)


@pytest.mark.parametrize("duration", [5e-324, 1e-300, 1e-12, 1e-9])
@each_start
def test_a_tiny_step_is_one_substep(fmu: Fmu, duration: float, start: float) -> None:
    with fmu.running(time=start) as instance:
        (before,) = instance.get(fmu.plant.x)
        for _ in range(3):
            assert instance.step(start, duration) == OK
        assert instance.get("solver.nfev") == (12,)
        # |v| stays below 10 a second, so x moves by less than that times the time, and by its rounding.
        assert abs(instance.get(fmu.plant.x)[0] - before) <= 30.0 * duration + 3 * ulp(1.0)


# The motion of the comparisons below, that of `plant.fastest`: damped enough for explicit Euler to be stable.
def scene(plant: Plant) -> dict[str, float]:
    return {plant.mass: 1.0, plant.drag: 0.5, plant.x_start: 1.0, plant.v_start: 0.5, plant.input: 0.7}


END = 3.0
H = 0.02


def random_cuts(end: float) -> list[float]:
    random = Random(4)
    return sorted({0.0, end, *(random.uniform(0.0, end) for _ in range(150))})


CUTS = {
    "one step": [0.0, END],
    "10 ms": multiples(0.0, 0.01, 300),
    "60 Hz": multiples(0.0, 1 / 60, 180),
    "H = 1/3": multiples(0.0, 1 / 3, 9),
    "H = 0.1 added up": [*sums(0.0, 0.1, 29), END],
    "7 ms": [*multiples(0.0, 0.007, 428), END],
    "0.47 s": [*multiples(0.0, 0.47, 6), END],
    "random": random_cuts(END),
    "tiny": multiples(0.0, 1e-3, 3000),
}


def end_of(plant: Plant, method: SolverMethod, h: float) -> tuple[float, float]:
    twin = Twin(plant, scene(plant) | {"solver.method": method, "solver.stepSize": h})
    twin.step(0.0, END)
    return twin.x, twin.v


def discretization_error(plant: Plant, method: SolverMethod) -> float:
    """Return the global error in x of a run with substeps of `H` by halving them.

    The error of a method of order p is c*H^p, so that of the halved substeps is 2^-p of it and the difference is
    the fraction 1 - 2^-p. x and v are taken together, because the error of one can pass through zero.
    """
    (x, v), (x2, v2) = end_of(plant, method, H), end_of(plant, method, H / 2)
    w0, _ = plant.fastest
    return hypot(x - x2, (v - v2) / w0) / (1.0 - 0.5 ** METHODS[method].order)


def rounding_error(plant: Plant, substeps: float, start: float = 0.0, end: float = END) -> float:
    """Return a bound of the round-off in x after `end` [s].

    Each substep adds a few units in the last place, 4*eps, to x and v; each of these grows at most like the drift of
    the phase, 1 + w0*T. The clock of the host resolves ulp(start), in which x moves by |v|*ulp.
    """
    w0, v = plant.fastest
    return 4.0 * float_info.epsilon * substeps * (1.0 + w0 * end) + v * ulp(abs(start) + end)


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
@pytest.mark.parametrize("cuts", CUTS.values(), ids=CUTS)
@each_start
def test_the_result_does_not_depend_on_how_the_time_is_cut(
    fmu: Fmu, method: SolverMethod, cuts: list[float], start: float
) -> None:
    plant = fmu.plant
    with fmu.running(scene(plant) | {"solver.method": method, "solver.stepSize": H}, time=start) as instance:
        instance.run([start + time for time in cuts])
        x, nfev = instance.get(plant.x, "solver.nfev")
    # No substep is longer than H, so the error of neither run exceeds that of substeps of H; they may differ in sign.
    bound = 2.0 * discretization_error(plant, method) + rounding_error(plant, nfev, start)
    assert abs(x - end_of(plant, method, H)[0]) <= bound


@pytest.mark.parametrize("interval", [H, 2 * H, 0.1, 0.5, 1.0, END])
@each_start
def test_cuts_between_the_same_substeps_change_round_off_only(
    fmu: Fmu, interval: float, start: float
) -> None:
    plant = fmu.plant
    with fmu.running(scene(plant) | {"solver.stepSize": H}, time=start) as instance:
        instance.run(multiples(start, interval, round(END / interval)))
        x, nfev = instance.get(plant.x, "solver.nfev")
    assert nfev == 4 * round(END / H)
    expected, _ = end_of(plant, SolverMethod.ExplicitRungeKutta4, H)
    assert abs(x - expected) <= rounding_error(plant, round(END / H), start)


def test_the_doubling_of_the_step_in_fmpy_changes_round_off_only(fmu_path: Path, plant: Plant) -> None:
    long, short = (
        simulate_fmu(
            str(fmu_path),
            stop_time=100.0,
            output_interval=interval,
            start_values={"solver.stepSize": 0.01},
            output=[plant.x, "solver.nfev"],
        )
        for interval in (None, 0.01)
    )
    assert len(long) == 626  # steps of 0.16 s
    assert len(short) == 10001
    np.testing.assert_array_equal(long["solver.nfev"], 4 * np.round(long["time"] / 0.01))
    difference = np.abs(long[plant.x] - short[plant.x][::16])
    # Both clocks resolve the times of the whole run.
    bound = [rounding_error(plant, time / 0.01, 100.0 - time, time) for time in long["time"]]
    assert np.all(difference <= bound)
