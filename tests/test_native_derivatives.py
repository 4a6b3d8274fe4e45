"""Output derivatives and directional derivatives of the native FMU."""

from math import nan
from typing import Any

import mpmath
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.driver import OK, Instance, integers, reals

OUTPUTS = ("phi", "w", "a", "E")
H = 0.01


def refused_derivative(instance: Instance, name: str, order: int) -> str:
    return instance.unwritten(
        1, "fmi2GetRealOutputDerivatives", instance.references(name), 1, integers([order])
    )


def test_output_derivatives_are_of_outputs_alone(instance: Instance) -> None:
    instance.start()
    for name in ("m", "tau"):
        assert refused_derivative(instance, name, 1) == f"pendulum: {name} is not an output"
    for order in (0, 2):
        assert "of a (allowed: 1..1)" in refused_derivative(instance, "a", order)


def test_output_derivatives_that_are_not_finite_are_refused_and_none_is_written(
    instance: Instance,
) -> None:
    instance.start({"w_start": 1e308})
    message = instance.unwritten(  # der(a) has a term w02*cos(phi)*w
        2, "fmi2GetRealOutputDerivatives", instance.references("phi", "a"), 2, integers([1, 1])
    )
    assert message == "pendulum: derivative of order 1 of a is out of the range of a double"


def test_the_derivative_of_the_energy_is_the_power_of_torque_and_drag(instance: Instance) -> None:
    """der(E) = (tau - gamma*L^2*w)*w."""
    m, L, gamma, g, phi, w, tau = 2.0, 0.7, 0.5, 9.0, 0.9, -1.2, 0.3
    instance.start({"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau})
    assert instance.output_derivative("E") == pytest.approx((tau - gamma * L**2 * w) * w, rel=1e-14, abs=0)


def test_output_derivatives_are_those_of_the_trajectory(instance: Instance) -> None:
    """Central differences of steps of h have an error of h^2/6 times a derivative of order 100."""
    h, rate, curvature = 1e-3, 2.0, -7.0  # of tau
    instance.start({"gamma": 0.5, "solver.stepSize": h, "tau": 0.3})
    samples, derivatives = [instance.get(*OUTPUTS)], []
    for i in range(2):
        t = i * h
        assert instance.set("tau", 0.3 + rate * t + curvature * t * t / 2) == OK
        assert instance.input_derivatives({1: rate + curvature * t, 2: curvature}) == OK
        derivatives = [instance.output_derivative(name) for name in OUTPUTS]
        assert instance.step(t, h) == OK
        t = (i + 1) * h
        assert instance.set("tau", 0.3 + rate * t + curvature * t * t / 2) == OK
        samples.append(instance.get(*OUTPUTS))
    for i in range(len(OUTPUTS)):
        before, _, after = (sample[i] for sample in samples)
        assert derivatives[i] == pytest.approx((after - before) / (2 * h), abs=100 * h * h)


def refused_partial(instance: Instance, unknown: str, known: str) -> str:
    return instance.unwritten(1, *instance.directional([unknown], [known], [1.0]))


def test_directional_derivatives_may_take_the_place_of_the_direction(instance: Instance) -> None:
    instance.start({"gamma": 0.5, "phi_start": 0.9, "w_start": -1.2})
    expected = instance.directional_derivative(["a", "phi"], ["phi", "w"], [1.0, 2.0])
    values = reals([1.0, 2.0])
    knowns, unknowns = instance.references("phi", "w"), instance.references("a", "phi")
    assert instance.call("fmi2GetDirectionalDerivative", unknowns, 2, knowns, 2, values, values) == OK
    assert list(values) == expected


def test_directional_derivatives_are_those_of_the_outputs(instance: Instance) -> None:
    """Central differences with d = 1e-5 have an error of d^2 times a derivative and of 1e-16/d: below 1e-8."""
    d = 1e-5
    base = {"m": 2.0, "L": 0.7, "gamma": 0.5, "phi_start": 0.9, "w_start": -1.2, "tau": 0.3}

    def outputs(known: str, shift: float) -> tuple[float, ...]:
        instance.start(base | {known: base[known] + shift})
        return instance.get(*OUTPUTS)

    for known, varied in (("phi", "phi_start"), ("w", "w_start"), ("tau", "tau")):
        pairs = zip(outputs(varied, d), outputs(varied, -d), strict=True)
        expected = [(high - low) / (2 * d) for high, low in pairs]
        instance.start(base)
        found = instance.directional_derivative(OUTPUTS, [known], [1.0])
        assert found == pytest.approx(expected, abs=1e-7)
    together = instance.directional_derivative(["a"], ["phi", "tau"], [2.0, -3.0])
    singly = [instance.partial("a", name) for name in ("phi", "tau")]
    assert together == [pytest.approx(2 * singly[0] - 3 * singly[1], rel=1e-15, abs=0)]
    assert "phi, w, tau" in refused_partial(instance, "a", "m")
    assert "phi, w, tau" in refused_partial(instance, "tau", "phi")
    assert instance.reset() == OK
    assert "in mode instantiated" in refused_partial(instance, "a", "tau")


def test_directional_derivatives_outlive_the_run(instance: Instance) -> None:
    instance.start({"m": 2.0, "tau": 0.3})
    assert instance.step(0.0, H) == OK
    arguments = OUTPUTS, ("phi", "w", "tau"), (2.0, 3.0, 5.0)
    before = instance.directional_derivative(*arguments)
    assert instance.call("fmi2Terminate") == OK
    assert instance.directional_derivative(*arguments) == before
    assert "phi, w, tau" in refused_partial(instance, "a", "m")


def readable(lowest: float, highest: float) -> Any:
    """Return a strategy of numbers with few digits, at which mpmath's differences are exact to many."""
    return st.floats(lowest, highest).map(lambda value: round(value, 6))


KNOWNS = ("m", "L", "gamma", "g", "phi_start", "w_start", "solver.stepSize", "tau")


def exact_outputs(m: Any, L: Any, gamma: Any, g: Any, phi: Any, w: Any, h: Any, tau: Any) -> list[Any]:
    """Return phi, w, a, E of the parameters `KNOWNS` at the beginning."""
    a = tau / (m * L**2) - gamma / m * w - g / L * mpmath.sin(phi)
    return [phi, w, a, m * L**2 * w**2 / 2 + m * g * L * (1 - mpmath.cos(phi)) + 0 * h]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    m=st.floats(1e-3, 1e3),
    L=st.floats(1e-2, 1e2),
    gamma=readable(0.0, 10.0),
    g=readable(-20.0, 20.0),
    phi=readable(-4.0, 4.0),
    w=readable(-5.0, 5.0),
    tau=readable(-10.0, 10.0),
)
def test_in_initialization_mode_directional_derivatives_are_by_the_parameters(
    shared: Instance, m: float, L: float, gamma: float, g: float, phi: float, w: float, tau: float
) -> None:
    """A partial has three terms at most, each rounded to a few 1e-16 of itself."""
    point = (m, L, gamma, g, phi, w, 1e-3, tau)
    assert shared.reset() == OK
    for name, value in zip(KNOWNS, point, strict=True):
        assert shared.set(name, value) == OK
    assert shared.call("fmi2EnterInitializationMode") == OK
    with mpmath.workdps(40):
        for i, known in enumerate(KNOWNS):
            for j, unknown in enumerate(OUTPUTS):

                def along(x: Any, i: int = i, j: int = j) -> Any:
                    return exact_outputs(*(x if k == i else mpmath.mpf(v) for k, v in enumerate(point)))[j]

                expected = float(mpmath.diff(along, mpmath.mpf(point[i])))
                terms = (
                    abs(tau / (m * L * L))
                    + abs(gamma / m * w)
                    + abs(g / L)
                    + m * (L * w) ** 2
                    + m * abs(g) * L
                )
                bound = 1e-14 * terms * (1 + 1 / m + 1 / L)
                assert shared.partial(unknown, known) == pytest.approx(expected, rel=1e-14, abs=bound)
    assert "by Real parameters, tau" in refused_partial(shared, "a", "phi")
    assert "not of type Real" in refused_partial(shared, "a", "solver.method")


def test_directional_derivatives_replace_what_the_host_had(instance: Instance) -> None:
    instance.start()
    values = reals([7.0])
    for knowns, expected in ((["phi"], 1.0), ([], 0.0)):
        call = instance.directional(["phi"], knowns, [1.0] * len(knowns))
        assert instance.call(*call, values) == OK
        assert list(values) == [expected]


@pytest.mark.parametrize(
    ("unknowns", "knowns", "direction", "words"),
    [
        (["phi", "a"], ["phi"], 1.7e308, "directional derivative of a is out of the range of a double"),
        (["phi", "a"], ["phi"], nan, "directional derivative of phi is out of the range of a double"),
        (
            ["phi", "m"],
            ["phi"],
            1.0,
            "no derivative of m with respect to phi (allowed: of outputs by phi, w, tau)",
        ),
        (["phi"] * 257, ["phi"] * 256, 1.0, "257 unknowns by 256 knowns in one call (allowed: at most 65536"),
        (["phi"] * 65536, ["w"] * 65536, 1.0, "65536 unknowns by 65536 knowns in one call"),
    ],
)
def test_of_refused_directional_derivatives_none_is_written(
    instance: Instance, unknowns: list[str], knowns: list[str], direction: float, words: str
) -> None:
    instance.start({"phi_start": 0.1})
    call = instance.directional(unknowns, knowns, [direction] * len(knowns))
    message = instance.unwritten(len(unknowns), *call)
    assert message.startswith(f"pendulum: {words}")
