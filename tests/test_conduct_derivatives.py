"""Derivatives are those of the outputs: what a model's C file says of its equation a second time, held against it.

A difference over 2*d, d = 1e-5 of the value, has the error d^2/6*f''' of the truncation, 1e-10 of the derivative for a
function that changes over its value, and eps*|f|/d of the rounding: 2e-11*|f|/|value|.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from random import Random

import pytest

from tests.driver import OK, Fmu, Instance
from tests.plants import Plant

D = 1e-5
POINTS = 20


pytestmark = pytest.mark.native_only


@pytest.fixture
def instance(fmu: Fmu) -> Iterator[Instance]:
    with fmu.instance() as instance:
        yield instance


def any_point(plant: Plant, random: Random) -> dict[str, float]:
    """Return values of the parameters of the equation, the state and the input: none is zero, and all are allowed."""
    point = {}
    for name in (*plant.slave.model._fields, plant.x_start, plant.v_start, plant.input):
        variable = plant.variables[name]
        size = (variable.start or 1.0) * random.uniform(0.5, 1.5)
        point[name] = -size if variable.allows(-size) and random.random() < 0.5 else size
    return point


def initializing(instance: Instance, point: dict[str, float]) -> None:
    assert instance.reset() == OK
    for name, value in point.items():
        assert instance.set(name, value) == OK
    assert instance.call("fmi2EnterInitializationMode") == OK


def is_close(found: float, high: float, low: float, width: float) -> bool:
    """Return whether a derivative is that of the outputs `high` and `low`, with a hundred times the errors above."""
    expected = (high - low) / width
    return abs(found - expected) <= 1e-8 * abs(expected) + 2e-9 * D * (abs(high) + abs(low)) / abs(width)


def differences(
    instance: Instance, outputs: Sequence[str], point: dict[str, float], name: str
) -> list[tuple[float, float, float]]:
    """Return of each output its values above and below `point`, and how far from each other that is."""
    values = []
    for factor in (1.0 + D, 1.0 - D):
        shifted = point[name] * factor
        initializing(instance, point | {name: shifted})
        values.append((shifted, instance.get(*outputs)))
    (right, high), (left, low) = values
    return [(above, below, right - left) for above, below in zip(high, low, strict=True)]


def test_partial_derivatives_are_those_of_the_outputs(instance: Instance, plant: Plant) -> None:
    outputs = (*plant.state, plant.a, plant.energy)
    for seed in range(POINTS):
        point = any_point(plant, Random(seed))
        expected = {name: differences(instance, outputs, point, name) for name in point}
        initializing(instance, point)
        wrong = [
            (output, known)
            for known, of in expected.items()
            for output, difference in zip(outputs, of, strict=True)
            if not is_close(instance.partial(output, known), *difference)
        ]
        assert wrong == [], point
        before = {(output, known): instance.partial(output, known) for output in outputs for known in point}
        assert instance.call("fmi2ExitInitializationMode") == OK
        for known, start in ((plant.x, plant.x_start), (plant.v, plant.v_start), (plant.input, plant.input)):
            for output in outputs:
                assert instance.partial(output, known) == before[output, start]


def test_output_derivatives_are_those_of_the_motion(instance: Instance, plant: Plant) -> None:
    """The chain rule: der(f) = f_x*v + f_v*a + f_u*der(u), each term rounded to some units in the last place."""
    for seed in range(POINTS):
        random = Random(seed)
        point = any_point(plant, random)
        rate = point[plant.input] * random.uniform(-2.0, 2.0)
        initializing(instance, point)
        assert instance.call("fmi2ExitInitializationMode") == OK
        assert instance.input_derivatives({1: rate}) == OK
        v, a = instance.get(plant.v, plant.a)
        for output in (*plant.state, plant.a, plant.energy):
            partials = (instance.partial(output, known) for known in (*plant.state, plant.input))
            terms = [p * by for p, by in zip(partials, (v, a, rate), strict=True)]
            bound = 1e-13 * sum(map(abs, terms))
            assert instance.output_derivative(output) == pytest.approx(sum(terms), abs=bound), (output, point)
