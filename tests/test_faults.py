"""Rows about the FMU break when it does: faults at the border between validation and FMU, and what they break."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from validation import faults, studies
from validation.checks import About, Check, Table
from validation.fmu import Experiment, Fmu

NAMES = {fault.name for fault in faults.FAULTS}
DRAG = {"gamma x (1 + 1e-3)", "m x (1 + 1e-3)"}
TORQUE = {"tau x (1 + 1e-6)", "tau late by a step"}
MESSAGES = {"messages lost"}
COUNTS = {"an evaluation more"}
# What a study does not use: faults of it change nothing there.
UNUSED = {
    "elliptic_period": {*COUNTS, *DRAG, *TORQUE, *MESSAGES, "NaN in E"},
    "impulse_response": {*COUNTS, *MESSAGES, "NaN in w", "NaN in a", "NaN in E"},
    "trajectory": {*COUNTS, *DRAG, *TORQUE, *MESSAGES, "NaN in a", "NaN in E"},
    "crawford": {*COUNTS, "gamma x (1 + 1e-3)", *TORQUE, *MESSAGES, "substep x 1.1", "NaN in w", "NaN in a"},
    "grillo": {*COUNTS, *MESSAGES, "NaN in a", "NaN in E"},
    "inputs": {*COUNTS, *MESSAGES, "NaN in w", "NaN in a", "NaN in E"},
    "errata": {*COUNTS, *TORQUE, *MESSAGES, "NaN in a"},
    "work_precision": {*COUNTS, "NaN in a", "NaN in E"},
    "methods": {*MESSAGES, "NaN in a"},
    "stability": {*COUNTS, *TORQUE, "substep x 2", "substep x 1.1", "NaN in a", "NaN in E"},  # single steps
    "traps": {*COUNTS, *TORQUE, *MESSAGES, "NaN in a", "NaN in E"},
    "atlas": {*COUNTS, *DRAG, *TORQUE, *MESSAGES},
    "stiff_extreme": set(),
}
RK4_ROWS = ("elliptic_period", "trajectory", "crawford")


@pytest.fixture(scope="module")
def native(native_path: Path) -> Iterator[Fmu]:
    with Fmu(native_path) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def injected() -> dict[str, list[faults.Injected]]:
    """Return what was done to the studies so far; each is put to the test once."""
    return {}


def done(native: Fmu, injected: dict[str, list[faults.Injected]], name: str) -> list[faults.Injected]:
    if name not in injected:
        injected[name] = [faults.inject(native, scene) for scene in studies.load(name).scenes]
    return injected[name]


def test_every_study_is_put_to_the_test() -> None:
    assert set(UNUSED) == set(studies.NAMES)
    assert set().union(*UNUSED.values()) <= NAMES


@pytest.mark.slow
@pytest.mark.parametrize("name", studies.NAMES)
def test_every_row_about_the_fmu_breaks_and_no_other(
    native: Fmu, injected: dict[str, list[faults.Injected]], name: str
) -> None:
    scenes = done(native, injected, name)
    assert sum(len(scene.rows) for scene in scenes) > 0
    assert [row for scene in scenes for row in scene.unbroken] == []
    assert [row for scene in scenes for row in scene.moved] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", studies.NAMES)
def test_every_fault_breaks_rows_of_every_study_it_can_reach(
    native: Fmu, injected: dict[str, list[faults.Injected]], name: str
) -> None:
    scenes = done(native, injected, name)
    noticed = {fault for scene in scenes for fault, rows in scene.broken.items() if rows}
    assert noticed >= NAMES - UNUSED[name]


@pytest.mark.slow
@pytest.mark.parametrize("name", studies.NAMES)
def test_what_is_no_number_breaks_every_row_that_reads_it(
    native: Fmu, injected: dict[str, list[faults.Injected]], name: str
) -> None:
    for scene in done(native, injected, name):
        read = {row for fault, rows in scene.broken.items() if fault.startswith("NaN") for row in rows}
        # Messages and counts are no numbers that can be NaN.
        heard = {row for fault in (*MESSAGES, *COUNTS) for row in scene.broken[fault]}
        assert set(scene.rows) - read <= heard


@pytest.mark.slow
@pytest.mark.parametrize("name", RK4_ROWS)
def test_no_row_of_rk4_survives_twice_the_substep(
    native: Fmu, injected: dict[str, list[faults.Injected]], name: str
) -> None:
    for scene in done(native, injected, name):
        assert set(scene.broken["substep x 2"]) == set(scene.rows)


@pytest.mark.slow
def test_the_report_says_what_was_found(
    native: Fmu, injected: dict[str, list[faults.Injected]], native_path: Path
) -> None:
    """Its faults are put into the scenes in other processes."""
    with faults.study(["errata"], native_path) as study:
        results = [result for scene in study.scenes for result in scene.run(native)]
    rows = [result for result in results if isinstance(result, Check)]
    assert len(rows) == 2
    assert all(row.holds and row.about is About.FORMULAS for row in rows)
    overview = results[-1]
    assert isinstance(overview, Table)
    scenes = done(native, injected, "errata")
    assert overview.rows[0] == (faults.ROWS, *2 * [sum(len(scene.rows) for scene in scenes)])
    assert {str(name): count for name, _, count in overview.rows[1:]} == {
        name: sum(len(scene.broken[name]) for scene in scenes) for name in NAMES
    }


def test_the_faulty_fmu_is_the_fmu_without_a_fault(native: Fmu) -> None:
    experiment = Experiment(1.0, 0.1, {"phi_start": 1.0}, torque=lambda t: t, record=("phi", "w"))
    run = faults.Faulty(native, faults.Fault("none"), {}).run(experiment)
    again = native.run(experiment)
    assert run["phi"].tobytes() == again["phi"].tobytes()
    assert run["w"].tobytes() == again["w"].tobytes()


def test_a_late_torque_is_that_of_the_step_before() -> None:
    late = faults.late_torque(Experiment(0.3, 0.1, torque=lambda t: 1.0 + t)).torque
    assert late is not None
    assert [late(t) for t in (0.0, 0.1, 0.2)] == [0.0, 1.0, 1.1]


def test_an_interpolated_torque_is_scaled_and_late_like_a_held_one() -> None:
    inputs = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    experiment = Experiment(0.3, 0.1, inputs=inputs)
    late, scaled = faults.late_torque(experiment).inputs, faults.scaled_torque(2.0)(experiment).inputs
    assert late is not None
    assert scaled is not None
    assert late.tolist() == [[0.0, 0.0], [1.0, 2.0], [3.0, 4.0]]
    assert (scaled == 2 * inputs).all()
    assert faults._key(experiment) != faults._key(faults.late_torque(experiment))


def test_a_dropped_step_repeats_the_output_before_it(native: Fmu) -> None:
    healthy = native.run(Experiment(0.4, 0.1))["phi"].tolist()
    fault = next(fault for fault in faults.FAULTS if fault.name == "one step dropped")
    faulty = faults.Faulty(native, fault, {}).run(Experiment(0.4, 0.1))["phi"].tolist()
    assert faulty == [*healthy[:2], *healthy[1:4]]


def test_every_study_has_rows_about_the_fmu(native: Fmu) -> None:
    scene = studies.load("trajectory").scenes[0]
    assert {row.about for row in faults._rows(native, scene).values()} == {About.FMU}
