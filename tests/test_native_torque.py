"""The torque of a step as a polynomial: what the input derivatives of the native FMU do."""

import sys
from collections.abc import Callable
from fractions import Fraction
from math import log2, nan, sqrt

import mpmath
import numpy as np
import pytest

from methods.solvers import METHODS, SolverMethod
from tests.driver import OK, Instance

OUTPUTS = ("phi", "w", "a", "E")
H = 0.01


def driven(t: mpmath.mpf) -> mpmath.mpf:
    """Return the torque of the default pendulum with gamma = 0.5 under which phi(t) is `driven_angle`."""
    phi = driven_angle
    return mpmath.diff(phi, t, 2) + 0.5 * mpmath.diff(phi, t) + 9.80665 * mpmath.sin(phi(t))


def driven_angle(t: mpmath.mpf) -> mpmath.mpf:
    return 0.5 + 0.4 * mpmath.sin(1.3 * t)


@pytest.fixture(scope="module")
def torque() -> Callable[[float], list[float]]:
    """Return tau [N.m] and its derivatives of order 1 to 3 at a time, each computed once."""
    known: dict[float, list[float]] = {}

    def at(t: float) -> list[float]:
        if t not in known:
            with mpmath.workdps(30):
                known[t] = [float(c * mpmath.factorial(k)) for k, c in enumerate(mpmath.taylor(driven, t, 3))]
        return known[t]

    return at


def driven_error(
    instance: Instance, method: int, steps: int, torque: Callable[[float], list[float]], orders: int
) -> float:
    """Return |phi - exact| after 1 s of `steps` communication steps, one substep each."""
    step = 1.0 / steps
    start = {"gamma": 0.5, "phi_start": 0.5, "w_start": 0.4 * 1.3}
    instance.start(start | {"solver.method": method, "solver.stepSize": step})
    for i in range(steps):
        tau, *derivatives = torque(i * step)
        assert instance.set("tau", tau) == OK
        assert instance.input_derivatives(dict(enumerate(derivatives[:orders], start=1))) == OK
        assert instance.step(i * step, step) == OK
    return abs(instance.get("phi")[0] - float(driven_angle(mpmath.mpf(1))))


@pytest.mark.parametrize("method", SolverMethod)
def test_with_input_derivatives_a_driven_run_has_the_order_of_the_method_up_to_theirs(
    instance: Instance, method: SolverMethod, torque: Callable[[float], list[float]]
) -> None:
    coarse, fine = (driven_error(instance, method, steps, torque, 3) for steps in (32, 64))
    # The torque is known up to the order 3 of its derivatives, which costs a step O(H^5).
    order = min(METHODS[method].order, 4)
    # The next term of the error changes the observed order by O(H), H = 1/32.
    assert log2(coarse / fine) == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize(
    ("method", "nodes"),
    [
        (1, {0.0: 1.0}),  # weights of the quadrature over a substep, by place in it
        (2, {0.5: 1.0}),
        (3, {0.0: 1 / 6, 0.5: 4 / 6, 1.0: 1 / 6}),
        (4, {1.0: 1.0}),
        (5, {0.0: 1 / 2, 1.0: 1 / 2}),
        (6, {0.0: sqrt(2) / 4, 2 - sqrt(2): sqrt(2) / 4, 1.0: 1 - sqrt(2) / 2}),
        (7, {1 / 4: 25 / 24, 3 / 4: -49 / 48, 11 / 20: 125 / 16, 1 / 2: -85 / 12, 1.0: 1 / 4}),
        (8, {0.0: 1 / 6, 0.5: 4 / 6, 1.0: 1 / 6}),  # exact for the series of a cubic torque
    ],
)
def test_a_free_mass_shows_at_which_times_a_method_takes_the_torque(
    instance: Instance, method: int, nodes: dict[float, float]
) -> None:
    """Without gravity and damping J*w is the sum of the torques at the nodes of the substeps."""
    n, h = 4, 0.25
    instance.start(
        {"m": 2.0, "gamma": 0.0, "g": 0.0, "solver.method": method, "solver.stepSize": h, "tau": 1.0}
    )
    assert instance.input_derivatives({1: 2.0, 2: -6.0, 3: 24.0}) == OK
    assert instance.step(0.0, n * h) == OK
    torques = [
        weight * (1 + 2 * t - 3 * t**2 + 4 * t**3)
        for i in range(n)
        for place, weight in nodes.items()
        for t in ((i + place) * h,)
    ]
    size = h * sum(map(abs, torques)) / 2.0
    assert instance.get("w")[0] == pytest.approx(
        h * sum(torques) / 2.0, rel=0, abs=1e-15 * len(torques) * size
    )


def test_without_input_derivatives_the_torque_is_held(
    instance: Instance, torque: Callable[[float], list[float]]
) -> None:
    coarse, fine = (driven_error(instance, 3, steps, torque, 0) for steps in (32, 64))
    assert log2(coarse / fine) == pytest.approx(1.0, abs=0.25)


def test_input_derivatives_hold_for_one_step(instance: Instance) -> None:
    def after(second: dict[int, float]) -> tuple[float, ...]:
        instance.start({"tau": 0.5})
        assert instance.input_derivatives({1: 3.0}) == OK
        assert instance.step(0.0, H) == OK
        assert instance.input_derivatives(second) == OK
        assert instance.step(H, H) == OK
        return instance.get(*OUTPUTS)

    assert after({}) == after({1: 0.0}) != after({1: 3.0})


RAMP = {"gamma": 0.0, "g": 0.0, "phi_start": 0.0, "tau": 1.0}


def derivatives(instance: Instance) -> list[float]:
    """Return der(phi), der(w), der(a), der(E)."""
    return [instance.output_derivative(name) for name in OUTPUTS]


def seen(instance: Instance) -> list[float]:
    return [*instance.get(*OUTPUTS), *derivatives(instance)]


def test_what_is_read_after_a_step_belongs_to_its_end(instance: Instance) -> None:
    """tau = 1 + 3*t on J = 1 alone: w = t + 1.5*t^2, E = w^2/2; every number is exact in binary."""
    instance.start(RAMP)
    assert instance.input_derivatives({1: 3.0}) == OK
    assert derivatives(instance) == [0.0, 1.0, 3.0, 0.0]
    assert instance.step(0.0, 0.5) == OK
    assert instance.get("w", "a", "tau") == (pytest.approx(0.875, rel=1e-13, abs=0), 2.5, 1.0)
    expected = [0.875, 2.5, 3.0, 2.1875]
    assert derivatives(instance) == pytest.approx(expected, rel=1e-13, abs=0)
    assert instance.call("fmi2Terminate") == OK
    assert derivatives(instance) == pytest.approx(expected, rel=1e-13, abs=0)
    assert instance.get("a") == (2.5,)


def test_all_coefficients_of_the_torque_count_at_the_end_of_a_step(instance: Instance) -> None:
    """tau = 1 + 2*t - 3*t^2 + 4*t^3 on J = 2: 1.75 at t = 0.5 with the derivative 2."""
    instance.start(RAMP | {"m": 2.0})
    assert instance.input_derivatives({1: 2.0, 2: -6.0, 3: 24.0}) == OK
    assert instance.step(0.0, 0.5) == OK
    assert instance.get("a") == (1.75 / 2,)
    assert instance.output_derivative("a") == 1.0


def test_the_torque_goes_on_until_it_is_set_anew(instance: Instance) -> None:
    def after_a_step() -> None:
        instance.start(RAMP)
        assert instance.input_derivatives({1: 3.0, 2: 1.0}) == OK
        assert instance.step(0.0, 0.5) == OK

    after_a_step()
    assert instance.set("tau", 4.0) == OK
    assert instance.get("a") == (4.0,)
    assert instance.output_derivative("a") == 0.0
    after_a_step()
    assert instance.input_derivatives({1: 7.0}) == OK
    assert instance.get("a") == (1.0,)
    assert instance.output_derivative("a") == 7.0
    after_a_step()
    assert instance.step(0.5, 0.5) == OK  # nothing is set: tau is held as it was set
    assert instance.get("a", "tau") == (1.0, 1.0)
    assert instance.get("w")[0] == pytest.approx(0.875 + 0.5**3 / 6 + 0.5, rel=1e-13, abs=0)


def test_tau_and_its_derivatives_may_be_set_in_any_order(instance: Instance) -> None:
    def after(*orders: int) -> tuple[float, ...]:
        instance.start(RAMP | {"g": 9.8})
        assert instance.input_derivatives({2: 5.0}) == OK
        assert instance.step(0.0, H) == OK
        for order in orders:
            if order == 0:
                assert instance.set("tau", 4.0) == OK
            else:
                assert instance.input_derivatives({order: 10.0 * order}) == OK
        assert instance.step(H, H) == OK
        return instance.get(*OUTPUTS)

    assert after(0, 1, 3) == after(1, 0, 3) == after(3, 1, 0) != after(0, 1)


def test_a_step_that_fails_leaves_the_torque_of_the_last_one(instance: Instance) -> None:
    instance.start(RAMP, stop=1.0)
    assert instance.input_derivatives({1: 3.0}) == OK
    assert instance.step(0.0, 0.5) == OK
    before = seen(instance)
    instance.refusal(instance.step(0.5, 1.0))
    instance.refusal(instance.step(0.5, -1.0))
    assert seen(instance) == before


def test_a_state_keeps_the_torque_of_the_last_step(instance: Instance) -> None:
    instance.start(RAMP | {"g": 9.8})
    assert instance.input_derivatives({1: 3.0, 2: -2.0, 3: 5.0}) == OK
    assert instance.step(0.0, 0.5) == OK
    expected = seen(instance)
    state = instance.save()
    data = instance.serialize(state)
    assert instance.step(0.5, 0.25) == OK
    assert instance.restore(state) == OK
    assert seen(instance) == expected
    assert instance.step(0.5, 0.25) == OK
    future = seen(instance)
    with instance.fmu.instance() as other:
        assert other.restore_bytes(data) == OK
        assert seen(other) == expected
        assert other.step(0.5, 0.25) == OK
        assert seen(other) == future


def sine_errors(instance: Instance, steps: int) -> list[float]:
    """Return the worst errors of w, a, der(a), der(E) at the ends of the steps of a second under tau = sin(3*t)."""
    step = 1.0 / steps
    instance.start(RAMP | {"solver.stepSize": step})
    worst = np.zeros(4)
    for i in range(steps):
        with mpmath.workdps(30):
            t, end = mpmath.mpf(i) / steps, mpmath.mpf(i + 1) / steps
            taus = [float(3**k * mpmath.sin(3 * t + k * mpmath.pi / 2)) for k in range(4)]
            w, tau = (1 - mpmath.cos(3 * end)) / 3, mpmath.sin(3 * end)
            exact = [float(value) for value in (w, tau, 3 * mpmath.cos(3 * end), w * tau)]
        assert instance.set("tau", taus[0]) == OK
        assert instance.input_derivatives(dict(enumerate(taus[1:], start=1))) == OK
        assert instance.step(i * step, step) == OK
        found = [*instance.get("w", "a"), *(instance.output_derivative(name) for name in ("a", "E"))]
        worst = np.maximum(worst, np.abs(np.subtract(found, exact)))  # NaN stays
    return [float(error) for error in worst]


def test_outputs_of_a_driven_run_are_as_exact_as_its_torque(instance: Instance) -> None:
    """The torque of a step is a Taylor polynomial of degree 3: its error is of order 4, that of its derivative 3."""
    coarse, fine = sine_errors(instance, 16), sine_errors(instance, 32)
    orders = [log2(c / f) for c, f in zip(coarse, fine, strict=True)]
    # The next term of the error changes the observed order by O(3*H), H = 1/16.
    assert orders == [pytest.approx(order, abs=0.25) for order in (4, 4, 3, 4)]
    # At most (3*H)^4/24 and 3*(3*H)^3/6 from the torque.
    assert fine[1] <= (3 / 32) ** 4 / 24
    assert fine[2] <= 3 * (3 / 32) ** 3 / 6


def test_the_time_of_a_divergence_is_that_under_the_torque_of_the_step(instance: Instance) -> None:
    """With tau = 1e307*(1 + t) the implicit method sums phi up to 1.797e308 in 3.9 s; held, the torque takes 6 s."""
    w = phi = Fraction(0)
    count = 0
    while phi * 10**307 <= Fraction(sys.float_info.max):
        count += 1
        w += Fraction(1, 10) * (1 + Fraction(count, 10))
        phi += Fraction(1, 10) * w
    assert count == 39
    instance.start(RAMP | {"solver.method": 4, "solver.stepSize": 0.1, "tau": 1e307})
    assert instance.input_derivatives({1: 1e307}) == OK
    message = instance.refusal(instance.step(0.0, 8.0))
    assert f"diverged at t = {39 * 0.1!r} s: substep 39 of 0.1 s " in message


@pytest.mark.parametrize(
    ("order", "value", "words"),
    [
        (0, 1.0, "(allowed: 1..3)"),
        (4, 1.0, "(allowed: 1..3)"),
        (2, nan, "order 2 of tau = nan (allowed: finite)"),
    ],
)
def test_wrong_input_derivatives_are_refused(
    instance: Instance, order: int, value: float, words: str
) -> None:
    assert words in instance.refusal(instance.input_derivatives({order: value}))
