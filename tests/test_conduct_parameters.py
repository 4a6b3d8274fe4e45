"""Parameters are checked when initialization ends."""

from __future__ import annotations

import re
from math import inf, isnan, nan

import pytest

from tests.driver import OK, Fmu, is_error
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


def test_only_finite_outputs_are_read_during_initialization(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        instance.set("m", 0.0)
        for name in ("a", "E"):
            status, _ = instance.get_references("Real", [fmu.reference[name]])
            # With m = 0 the acceleration is undefined, and the energy is 0.
            assert is_error(status) == (name == "a")
        assert any("a is out of the range" in message for message in instance.errors)
