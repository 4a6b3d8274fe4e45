"""Parameters are checked when initialization ends."""

from __future__ import annotations

import re
import struct
from math import inf, isnan, nan

import pytest

from tests.driver import OK, WARNING, Fmu, is_error
from tests.twin import OUTPUTS, Twin

POSITIVE, NOT_NEGATIVE, FINITE = (0.0, -1.0, nan, inf), (-1e-9, nan, inf), (nan, inf, -inf)
REFUSED = {
    ("m", " kg", "> 0"): POSITIVE,
    ("L", " m", "> 0"): POSITIVE,
    ("solver.stepSize", " s", "> 0"): POSITIVE,
    ("gamma", " N.s/m", ">= 0"): NOT_NEGATIVE,
    ("g", " m/s2", "finite"): FINITE,
    ("phi_start", " rad", "finite"): FINITE,
    ("w_start", " rad/s", "finite"): FINITE,
    ("solver.method", "", "1..4"): (0, 5, -1, 2**31 - 1),
}
CASES = [(*what, value) for what, values in REFUSED.items() for value in values]


def names(message: str, name: str, unit: str, allowed: str, value: float) -> bool:
    """Return whether `message` names the variable, the value, its unit and what is allowed."""
    pattern = rf"(?<![\w.]){re.escape(name)} = (\S+){re.escape(unit)} \(allowed: {re.escape(allowed)}\)"
    found = re.search(pattern, message)
    if found is None:
        return False
    shown = float(found[1])
    return shown == value or (isnan(shown) and isnan(value))


@pytest.mark.parametrize(("name", "unit", "allowed", "value"), CASES)
def test_a_bad_parameter_is_named_with_value_unit_and_what_is_allowed(
    fmu: Fmu, name: str, unit: str, allowed: str, value: float
) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.initialize({name: value}))
        message = instance.errors[0]
    assert message.startswith("pendulum: cannot initialize: ")
    assert names(message, name, unit, allowed, value)
    assert message.count("allowed") == 1


def test_all_bad_parameters_are_in_one_message(fmu: Fmu) -> None:
    bad = {what: values[0] for what, values in REFUSED.items()}
    with fmu.instance() as instance:
        assert is_error(instance.initialize({name: value for (name, *_), value in bad.items()}))
        told = [message for message in instance.errors if "allowed" in message]
    assert len(told) == 1
    assert all(names(told[0], *what, value) for what, value in bad.items())


@pytest.mark.parametrize(
    ("start", "told"),
    [
        ({"m": 1e-200, "L": 1e-100}, "J = m*L^2 = 0"),
        ({"m": 1e200, "L": 1e100}, "J = m*L^2 = inf"),
        ({"m": 1e-200, "gamma": 1e200}, "gamma/m = inf"),
        ({"L": 1e-150, "m": 1e10, "g": 1e200}, "g/L = inf"),
    ],
)
def test_parameters_that_cannot_be_computed_with_are_refused(
    fmu: Fmu, start: dict[str, float], told: str
) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.initialize(start))
        assert told in instance.errors[0]


@pytest.mark.parametrize(
    "start",
    [{"gamma": 0.0}, {"g": 0.0}, {"g": -9.81}, {"m": 1e-300, "gamma": 0.0}, {"L": 1e100}]
    + [{"solver.method": method} for method in (2, 3, 4)],
)
def test_the_ends_of_the_ranges_are_accepted(fmu: Fmu, start: dict[str, float]) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(start) == OK
        assert instance.step(0.0, 0.01) == OK


SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # positive doubles
# The first and last values of each range, with what the other parameters must be for the pendulum to have a motion.
ALLOWED: list[tuple[str, float, dict[str, float]]] = [
    ("m", SMALLEST, {"gamma": 0.0}),
    ("m", LARGEST, {}),
    ("L", 1e-150, {"m": 1e10}),
    ("L", LARGEST, {"m": SMALLEST, "gamma": 0.0}),
    ("gamma", 0.0, {}),
    ("gamma", -0.0, {}),
    ("gamma", SMALLEST, {}),
    ("gamma", LARGEST, {}),
    *((name, value, {}) for name in ("g", "phi_start", "w_start") for value in (-LARGEST, -0.0, LARGEST)),
    ("solver.method", 1, {}),
    ("solver.method", 4, {}),
    ("solver.stepSize", SMALLEST, {}),
    ("solver.stepSize", LARGEST, {}),
]
# The neighbours of these values outside the range.
BEYOND = [
    *((name, value) for name in ("m", "L", "solver.stepSize") for value in (0.0, -0.0, -SMALLEST, inf)),
    *(("gamma", value) for value in (-SMALLEST, inf)),
    *((name, value) for name in ("g", "phi_start", "w_start") for value in (-inf, inf)),
    *(("solver.method", value) for value in (0, 5)),
]


@pytest.mark.parametrize(("name", "value", "others"), ALLOWED)
def test_the_first_and_the_last_value_of_a_range_are_accepted(
    fmu: Fmu, name: str, value: float, others: dict[str, float]
) -> None:
    with fmu.instance() as instance:
        assert instance.initialize({name: value} | others) <= WARNING, instance.errors
        assert struct.pack("d", *instance.get(name)) == struct.pack("d", value)


def test_the_shortest_rod_is_refused_for_its_inertia_and_not_for_its_range(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.initialize({"L": SMALLEST, "m": LARGEST, "g": 0.0}))
        assert "J = m*L^2 = 0.0 kg.m2 is out of the range" in instance.errors[0]
        assert "allowed" not in instance.errors[0]


@pytest.mark.parametrize(("name", "value"), BEYOND)
def test_the_first_value_beyond_a_range_is_refused(fmu: Fmu, name: str, value: float) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.initialize({name: value}))
        assert f" {name} = {value!r}" in instance.errors[0]


@pytest.mark.parametrize("tau", [-LARGEST, -SMALLEST, SMALLEST, LARGEST])
def test_the_largest_and_the_smallest_torques_are_accepted(fmu: Fmu, tau: float) -> None:
    with fmu.running({"m": 1e10, "tau": tau}) as instance:  # heavy enough for the rate to stay a double
        assert instance.step(0.0, 0.01) == OK
        assert instance.get("tau") == (tau,)


@pytest.mark.parametrize("way", ["reset", "correct"])
def test_a_refused_initialization_can_be_tried_again(fmu: Fmu, way: str) -> None:
    twin = Twin(m=2.0)
    twin.step(0.0, 0.01)
    with fmu.instance() as instance:
        assert is_error(instance.initialize({"m": -2.0}))
        if way == "reset":
            assert instance.reset() == OK
            assert instance.initialize({"m": 2.0}) == OK
        else:
            assert instance.set("m", 2.0) == OK
            assert instance.call("fmi2ExitInitializationMode") == OK
        assert instance.step(0.0, 0.01) == OK
        assert instance.get(*OUTPUTS) == twin.outputs


def test_without_a_mass_what_was_set_can_be_read_before_it_is_checked(fmu: Fmu) -> None:
    values = {"m": 0.0, "L": 2.0, "gamma": 0.0, "phi_start": 0.25, "w_start": -0.5, "tau": 0.75}
    with fmu.instance() as instance:
        for name, value in values.items():
            assert instance.set(name, value) == OK
        assert instance.get(*values) == tuple(values.values())
        assert instance.get("phi", "w", "solver.nfev") == (0.25, -0.5, 0)


def test_only_finite_outputs_are_read_during_initialization(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        instance.set("m", 0.0)
        for name in ("a", "E"):
            status, _ = instance.get_references("Real", [fmu.reference[name]])
            # With m = 0 the acceleration is undefined, and the energy is 0.
            assert is_error(status) == (name == "a")
        assert any("a is out of the range" in message for message in instance.errors)
