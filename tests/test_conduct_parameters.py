"""Parameters are checked when initialization ends."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from math import inf, isnan, nan

import pytest

from methods.solvers import SolverMethod
from tests.driver import OK, WARNING, Fmu, is_error
from tests.plants import LARGEST, SMALLEST, Plant
from tests.twin import Twin

METHODS = f"1..{len(SolverMethod)}"
# Of each range its first and last values, their neighbours outside, and other values that are wrong.
ENDS: dict[str, tuple[float, ...]] = {
    "> 0": (SMALLEST, LARGEST),
    ">= 0": (0.0, -0.0, SMALLEST, LARGEST),
    "finite": (-LARGEST, -0.0, LARGEST),
    METHODS: (1, len(SolverMethod)),
}
BEYOND: dict[str, tuple[float, ...]] = {
    "> 0": (0.0, -0.0, -SMALLEST, inf),
    ">= 0": (-SMALLEST, inf),
    "finite": (-inf, inf),
    METHODS: (0, len(SolverMethod) + 1),
}
WRONG: dict[str, tuple[float, ...]] = {
    "> 0": (-1.0, nan),
    ">= 0": (-1e-9, nan),
    "finite": (nan,),
    METHODS: (-1, 2**31 - 1),
}
each_range = pytest.mark.parametrize("allowed", ENDS)


def test_every_parameter_has_one_of_these_ranges(plant: Plant) -> None:
    found = [parameter for allowed in ENDS for parameter in plant.with_range(allowed)]
    assert sorted(found) == sorted(plant.parameters)
    assert all(plant.with_range(allowed) for allowed in ENDS)


def names(message: str, name: str, unit: str, allowed: str, value: float) -> bool:
    """Return whether `message` names the variable, the value, its unit and what is allowed."""
    pattern = rf"(?<![\w.]){re.escape(name)} = (\S+){re.escape(unit)} \(allowed: {re.escape(allowed)}\)"
    found = re.search(pattern, message)
    if found is None:
        return False
    shown = float(found[1])
    return shown == value or (isnan(shown) and isnan(value))


@each_range
def test_a_bad_parameter_is_named_with_value_unit_and_what_is_allowed(fmu: Fmu, allowed: str) -> None:
    for name in (parameter.name for parameter in fmu.plant.with_range(allowed)):
        for value in (*BEYOND[allowed], *WRONG[allowed]):
            with fmu.instance() as instance:
                assert is_error(instance.initialize({name: value}))
                message = instance.errors[0]
            assert message.startswith(f"{fmu.plant.system}: cannot initialize: ")
            assert names(message, name, fmu.plant.unit(name), allowed, value)
            assert message.count("allowed") == 1


def test_all_bad_parameters_are_in_one_message(fmu: Fmu) -> None:
    bad = {
        parameter.name: (allowed, values[0])
        for allowed, values in WRONG.items()
        for parameter in fmu.plant.with_range(allowed)
    }
    with fmu.instance() as instance:
        assert is_error(instance.initialize({name: value for name, (_, value) in bad.items()}))
        told = [message for message in instance.errors if "allowed" in message]
    assert len(told) == 1
    for name, (allowed, value) in bad.items():
        assert names(told[0], name, fmu.plant.unit(name), allowed, value)


def test_parameters_that_cannot_be_computed_with_are_refused(fmu: Fmu) -> None:
    for start, told in fmu.plant.out_of_range:
        with fmu.instance() as instance:
            assert is_error(instance.initialize(start))
            assert told in instance.errors[0]


START_VALUES: dict[str, Callable[[Plant], dict[str, float]]] = {
    "without drag": lambda plant: {plant.drag: 0.0},
    "free": lambda plant: plant.pull(0.0),
    "heavy": lambda plant: {plant.mass: 1e100},
    **{method.name: (lambda _, method=method: {"solver.method": method}) for method in SolverMethod},
}


@pytest.mark.parametrize("start_of", START_VALUES.values(), ids=START_VALUES)
def test_what_is_allowed_is_accepted_and_makes_its_steps(
    fmu: Fmu, start_of: Callable[[Plant], dict[str, float]]
) -> None:
    with fmu.instance() as instance:
        # Every method is stable with this step.
        assert instance.initialize({"solver.stepSize": 1e-4} | start_of(fmu.plant)) == OK
        assert instance.step(0.0, 0.01) == OK


@each_range
def test_the_first_and_the_last_value_of_a_range_are_accepted(fmu: Fmu, allowed: str) -> None:
    for name in (parameter.name for parameter in fmu.plant.with_range(allowed)):
        for value in ENDS[allowed]:
            others = fmu.plant.others.get((name, value), {})
            if others is None:
                continue
            with fmu.instance() as instance:
                assert instance.initialize({name: value} | others) <= WARNING, instance.errors
                assert struct.pack("d", *instance.get(name)) == struct.pack("d", value)


@pytest.mark.parametrize("drive", [-LARGEST, -SMALLEST, SMALLEST, LARGEST])
def test_the_largest_and_the_smallest_drives_are_accepted(fmu: Fmu, drive: float) -> None:
    # Heavy enough for the rate to stay a double, and with a pull that cannot be more than the drive.
    start = fmu.plant.pull(1.0) | {fmu.plant.mass: 1e10, fmu.plant.input: drive}
    with fmu.running(start) as instance:
        assert instance.step(0.0, 0.01) == OK
        assert instance.get(fmu.plant.input) == (drive,)


@pytest.mark.parametrize("way", ["reset", "correct"])
def test_a_refused_initialization_can_be_tried_again(fmu: Fmu, way: str) -> None:
    mass = fmu.plant.mass
    twin = Twin(fmu.plant, {mass: 2.0})
    twin.step(0.0, 0.01)
    with fmu.instance() as instance:
        assert is_error(instance.initialize({mass: -2.0}))
        if way == "reset":
            assert instance.reset() == OK
            assert instance.initialize({mass: 2.0}) == OK
        else:
            assert instance.set(mass, 2.0) == OK
            assert instance.call("fmi2ExitInitializationMode") == OK
        assert instance.step(0.0, 0.01) == OK
        assert instance.get(*fmu.plant.calculated) == twin.calculated


def test_without_a_mass_what_was_set_can_be_read_before_it_is_checked(fmu: Fmu) -> None:
    plant = fmu.plant
    values = {plant.mass: 0.0, plant.drag: 0.0, plant.x_start: 0.25, plant.v_start: -0.5, plant.input: 0.75}
    with fmu.instance() as instance:
        for name, value in values.items():
            assert instance.set(name, value) == OK
        assert instance.get(*values) == tuple(values.values())
        assert instance.get(*plant.state, "solver.nfev") == (0.25, -0.5, 0)


def test_only_finite_outputs_are_read_during_initialization(fmu: Fmu) -> None:
    plant = fmu.plant
    with fmu.instance() as instance:
        instance.set(plant.mass, 0.0)
        for name in (plant.a, plant.energy):
            status, _ = instance.get_references("Real", [fmu.reference[name]])
            # Without a mass the acceleration is undefined, and the energy is a double.
            assert is_error(status) == (name == plant.a)
        assert any(f"{plant.a} is out of the range" in message for message in instance.errors)
