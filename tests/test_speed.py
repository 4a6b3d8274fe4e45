"""Ratios of run times, each measured in one run; minima of interleaved repeats, because the machine is noisy."""

from collections.abc import Callable
from math import sin
from pathlib import Path
from time import perf_counter

import pytest

from validation.fmu import RK4, Experiment, Fmu

pytestmark = pytest.mark.slow

SUBSTEPS = 20_000
H = 1e-3


def hand_inlined(drive: float, drag: float, gravity: float, phi: float, w: float, h: float, n: int) -> float:
    """The arithmetic of the RK4 solver with the full acceleration, without a call in the loop but the sine."""
    half, sixth = h / 2, h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in range(n):
        middle = phi + half * w
        end = phi + h * w
        a1 = drive + drag * w + gravity * sin(phi)
        a2 = drive + drag * (w + half * a1) + gravity * sin(middle)
        a3 = drive + drag * (w + half * a2) + gravity * sin(middle + half_half * a1)
        a4 = drive + drag * (w + h * a3) + gravity * sin(end + half_h * a2)
        a23 = a2 + a3
        a123 = a1 + a23
        phi = end + sixth_h * a123
        w += sixth * (a123 + a23 + a4)
    return phi


def ratio(numerator: Callable[[], float], denominator: Callable[[], float], repeats: int = 30) -> float:
    times = [(numerator(), denominator()) for _ in range(repeats)]
    return min(a for a, _ in times) / min(b for _, b in times)


def test_a_substep_in_the_fmu_costs_at_most_1_4_of_a_hand_inlined_loop(fmu_path: Path) -> None:
    torque = 0.1
    experiment = Experiment(
        SUBSTEPS * H, SUBSTEPS * H, {"solver.method": RK4, "solver.stepSize": H}, torque=lambda t: torque
    )
    results = set()

    def inlined() -> float:
        begin = perf_counter()
        results.add(hand_inlined(torque, -0.002, -9.80665, 0.5235987755982988, 0.0, H, SUBSTEPS))
        return perf_counter() - begin

    with Fmu(fmu_path) as fmu:

        def in_fmu() -> float:
            run = fmu.run(experiment)
            results.add(float(run["phi"][-1]))
            return run.seconds

        assert ratio(in_fmu, inlined) <= 1.4
    assert len(results) == 1  # the same arithmetic, to the last bit
