"""What is no number keeps no bound of the validation."""

from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from validation.checks import Check
from validation.fmu import W02, Experiment, Fmu, SolverMethod
from validation.metrics import largest
from validation.references.methods import METHODS, linear_radius
from validation.studies import grillo, stability, work_precision
from validation.studies.work_precision import Point, WorkScene


@pytest.mark.parametrize("number", [nan, inf, -inf])
def test_what_is_no_number_keeps_no_bound(number: float) -> None:
    for low in (False, True):
        assert not Check("", number, 1.0, "", at_least=low).holds
        assert not Check("", 1.0, number, "", at_least=low).holds


def test_the_largest_of_numbers_with_nan_is_nan() -> None:
    assert largest((1.0, 3.0, 2.0)) == 3.0
    for numbers in ((nan, 1.0), (1.0, nan), (1.0, nan, 2.0)):
        assert isnan(largest(numbers))


def test_a_run_that_fails_ends_without_a_number(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        run = fmu.run(Experiment(1.0, 0.1, {"gamma": 1e6}, record=("phi", "w")))
        assert run.failure
        assert len(run.t) == len(run["phi"]) == 2
        assert np.isnan([run["phi"][-1], run["w"][-1]]).all()
        assert not Check("stays in the well", float(np.max(np.abs(run["phi"]))), 2.0, "").holds


def test_an_output_that_cannot_be_read_is_no_number(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        run = fmu.run(Experiment(0.2, 0.1, {"w_start": 1e200, "g": 0.0, "gamma": 0.0}, record=("E",)))
        assert "E is out of the range of a double" in run.failure
        assert np.isnan(run["E"]).tolist() == [True, True, True]


def test_a_torque_that_is_refused_ends_the_run(native_path: Path) -> None:
    with Fmu(native_path) as fmu:
        run = fmu.run(Experiment(0.2, 0.1, inputs=np.array([[0.0, 1.0], [0.0, inf]])))
        assert "derivative of order 1 of tau = inf" in run.failure
        assert np.isnan(run["phi"]).tolist() == [False, False, True]


def test_a_stability_map_counts_what_is_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    rk4 = SolverMethod.ExplicitRungeKutta4

    def measured(_: Any, __: int, k2: float, h: float) -> float:
        radius = linear_radius(METHODS[rk4.name], k2, W02, h)
        return radius if radius > 1 else nan

    monkeypatch.setattr(stability, "measured_radius", measured)
    monkeypatch.setattr(stability, "_warned_limit", lambda *_: nan)
    (row,) = (r for r in stability.MapScene(rk4).run(None) if isinstance(r, Check))  # type: ignore[arg-type]
    assert row.measured > 0
    assert not row.holds


def test_a_run_that_ends_without_a_number_is_on_the_wrong_side() -> None:
    scene = next(s for s in work_precision.SCENES if isinstance(s, WorkScene) and s.data.k2 == 1e3)
    stable = Point(1e-4, 1e-6)
    lost = Point(1.0, inf)
    nowhere = Point(1e-4, nan)
    assert scene.divergence(SolverMethod.ExplicitRungeKutta4, [stable, lost]).holds
    assert scene.divergence(SolverMethod.ExplicitRungeKutta4, [stable, lost, nowhere]).measured == 1


def test_the_worst_frequency_is_the_one_without_a_number(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = next(s for s in grillo.SCENES if isinstance(s, grillo.FrequencyScene))
    right = 1.0 + 0j
    answers = iter([(right, right, 1.0), *[(complex(nan), right, 1.0)] * (len(scene.frequencies) - 1)])
    monkeypatch.setattr(grillo, "measured_response", lambda *_: next(answers))
    rows = [result for result in scene.run(None) if isinstance(result, Check)]  # type: ignore[arg-type]
    assert len(scene.frequencies) > 1
    assert np.isnan(rows[-1].measured)
    assert not rows[-1].holds
