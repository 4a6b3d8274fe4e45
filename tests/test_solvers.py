from collections.abc import Callable
from fractions import Fraction
from math import cos, inf, isinf, sin, sqrt, ulp
from sys import float_info

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import mp, mpc, mpf

from damped_pendulum.model import Motion, Pendulum, solve_kepler
from methods.solvers import (
    MAX_SUBSTEPS,
    METHODS,
    SolverMethod,
    stability_limit,
    substeps,
)
from tests.twin import longest_substep

W02 = 9.80665
HALF, SIXTH, THIRD = Fraction(1, 2), Fraction(1, 6), Fraction(1, 3)

# Butcher tableaux (A, b): Hairer, Norsett, Wanner I, table II.1.2.
TABLEAUX = {
    SolverMethod.ExplicitEuler: (((),), (Fraction(1),)),
    SolverMethod.ExplicitMidPoint2: (((), (HALF,)), (Fraction(0), Fraction(1))),
    SolverMethod.ExplicitRungeKutta4: (
        ((), (HALF,), (Fraction(0), HALF), (Fraction(0), Fraction(0), Fraction(1))),
        (SIXTH, THIRD, THIRD, SIXTH),
    ),
}


class RationalMotion:
    """A motion whose acceleration is a polynomial, so that a step is exact in fractions."""

    def acceleration(self) -> Callable[[Fraction, Fraction], Fraction]:
        return lambda phi, w: Fraction(2, 7) - w / 5 - phi * phi * 3 / 4


def tableau_step(method: SolverMethod, phi: Fraction, w: Fraction, h: Fraction) -> tuple[Fraction, Fraction]:
    A, b = TABLEAUX[method]
    acceleration = RationalMotion().acceleration()
    slopes: list[tuple[Fraction, Fraction]] = []
    for row in A:
        phi_i = phi + h * sum(a * k[0] for a, k in zip(row, slopes, strict=True))
        w_i = w + h * sum(a * k[1] for a, k in zip(row, slopes, strict=True))
        slopes.append((w_i, acceleration(phi_i, w_i)))
    return (
        phi + h * sum(weight * k[0] for weight, k in zip(b, slopes, strict=True)),
        w + h * sum(weight * k[1] for weight, k in zip(b, slopes, strict=True)),
    )


@pytest.mark.parametrize("method", TABLEAUX)
def test_a_step_is_that_of_the_butcher_tableau_exactly(method: SolverMethod) -> None:
    phi, w, h = Fraction(3, 5), Fraction(-4, 3), Fraction(1, 10)
    expected = tableau_step(method, *tableau_step(method, phi, w, h), h)
    stages = len(TABLEAUX[method][1])
    assert METHODS[method].solver(RationalMotion(), phi, w, h, 2) == (*expected, 2 * stages)
    assert METHODS[method].stages == stages


@given(
    s=st.floats(-1, 1, exclude_min=True, exclude_max=True),
    c=st.one_of(st.floats(-10, 10), st.floats(-1e6, 1e6)),
)
@example(s=0.999999, c=3.14159)
@example(s=-0.9999, c=1e-9)
@example(s=1e-5, c=1e-300)
def test_newton_finds_the_root_to_the_last_bit(s: float, c: float) -> None:
    x, _ = solve_kepler(s, c)
    # Half an ulp for the result, a quarter for stopping, and the roundings of s*sin(x) through the slope: two relative
    # ones, or one of the smallest subnormal number.
    slope = 1 + s * cos(x)
    with mp.workdps(60):
        rounding = 2 * mpf(float_info.epsilon) * abs(s * sin(x)) + mpf(ulp(0.0))
        bound = mpf(0.75) * ulp(x) + rounding / slope
        below, above = (y + mpf(s) * mp.sin(y) - mpf(c) for y in (x - bound, x + bound))
    assert below <= 0 <= above  # the left side increases


@given(
    phi=st.floats(-4, 4),
    w=st.floats(-20, 20),
    damping_rate=st.floats(0, 1e9),
    drive=st.floats(-100, 100),
    h=st.floats(1e-6, 0.3),
)
def test_implicit_euler_satisfies_its_equations(
    phi: float, w: float, damping_rate: float, drive: float, h: float
) -> None:
    motion = Motion(damping_rate, W02, drive)
    new_phi, new_w, _ = METHODS[SolverMethod.ImplicitEuler].solver(motion, phi, w, h, 1)
    scale = abs(phi) + abs(w) + h * (abs(drive) + W02) + abs(new_w)
    # A few roundings of the terms in each equation, through 1/(1 + s*cos(x)) < 1/(1 - 0.3^2*w02).
    bound = 8 * float_info.epsilon / (1 - 0.09 * W02) * scale
    assert abs(new_phi - phi - h * new_w) <= bound
    acceleration = drive - damping_rate * new_w - W02 * sin(new_phi)
    assert abs(new_w - w - h * acceleration) <= bound * (1 + h * damping_rate)


def growth_factor(method: SolverMethod, h: float, damping_rate: float) -> mpf:
    order = METHODS[method].order
    with mp.workdps(40):
        root = mp.sqrt(mpc(damping_rate) ** 2 - 4 * mpf(W02))
        return max(
            abs(
                sum(
                    (mpf(h) * (-damping_rate + sign * root) / 2) ** k / mp.factorial(k)
                    for k in range(order + 1)
                )
            )
            for sign in (1, -1)
        )


DAMPING_RATES = (0.002, 1.0, 6.26, 2 * sqrt(W02), 50.0, 1e3, 1e6)


@pytest.mark.parametrize("damping_rate", DAMPING_RATES)
@pytest.mark.parametrize("method", TABLEAUX)
def test_stability_limit_is_where_the_stability_function_leaves_the_unit_disc(
    method: SolverMethod, damping_rate: float
) -> None:
    limit = stability_limit(method, damping_rate, W02)
    assert growth_factor(method, limit * (1 - 1e-9), damping_rate) < 1
    assert growth_factor(method, limit * (1 + 1e-9), damping_rate) > 1
    for fraction in (0.01, 0.1, 0.3, 0.5, 0.7, 0.9):  # there is no unstable gap below
        assert growth_factor(method, limit * fraction, damping_rate) < 1


def test_stability_limits_of_the_undamped_pendulum() -> None:
    limits = [stability_limit(method, 0.0, W02) for method in SolverMethod]
    assert limits == [0.0, 0.0, pytest.approx(sqrt(8 / W02), rel=1e-15, abs=0), inf]


def test_without_gravity_and_damping_every_step_is_stable() -> None:
    assert all(isinf(stability_limit(method, 0.0, 0.0)) for method in SolverMethod)


def test_upside_down_gravity_has_the_limits_of_the_upright_equilibrium() -> None:
    for method in SolverMethod:
        assert stability_limit(method, 1.0, -W02) == stability_limit(method, 1.0, W02)


@pytest.mark.parametrize("w02", [W02, -W02, -1e-3, -1e6])
@pytest.mark.parametrize("damping_rate", [0.0, *DAMPING_RATES])
def test_a_substep_of_implicit_euler_has_one_root(damping_rate: float, w02: float) -> None:
    h = Motion(damping_rate, w02, 0.0).longest_implicit_stage()
    s = h * h * abs(w02) / (1 + h * damping_rate)
    assert 1 - 1e-8 < s < 1  # the limit is kept by a margin of 1e-9 in h, and s grows at most like h^2


@pytest.mark.parametrize("method", TABLEAUX)
@pytest.mark.parametrize("w02", [W02, 0.0, -W02])
def test_the_length_of_a_substep_is_limited_by_its_roots_in_the_implicit_method_alone(
    method: SolverMethod, w02: float
) -> None:
    pendulum = Pendulum(1.0, 1.0, 0.1, w02)
    assert longest_substep(method, inf, pendulum) == inf
    assert (longest_substep(SolverMethod.ImplicitEuler, inf, pendulum) == inf) == (w02 == 0.0)


@pytest.mark.parametrize(
    ("time", "duration", "max_step", "n"),
    [
        (0.0, 0.3, 0.1, 3),
        (0.0, 0.7, 0.1, 7),
        (0.0, 0.35, 0.001, 350),
        (0.0, 0.1, 0.03, 4),
        (0.0, 0.01, 0.03, 1),
        (0.0, 1 / 60, 1e-3, 17),
        (1e6, (1e6 + 0.01) - 1e6, 1e-3, 10),
        (-1e6, (-1e6 + 0.3) + 1e6, 0.1, 3),
        (0.0, 0.016666666666666677, 1 / 60, 1),
        (0.0, 0.1001, 0.1, 2),
        (0.0, 5e-324, 1.0, 1),
    ],
)
def test_number_of_substeps(time: float, duration: float, max_step: float, n: int) -> None:
    assert substeps(time, duration, max_step) == n


@pytest.mark.parametrize("time", [0.0, 0.1, -3.0, 1e6, -1e6, 1e9])
@pytest.mark.parametrize("n", [1, 2, 10, 1000])
def test_what_is_over_the_rounding_of_the_times_takes_one_substep_more(time: float, n: int) -> None:
    # A communication point is a product and a sum at most, two roundings of eps/2 each; a step has two of them.
    max_step = 0.25
    rounding = 2 * Fraction(float_info.epsilon) * Fraction(abs(time) + n * max_step)
    assert 4 * rounding < max_step
    for units, expected in ((-1, n), (0, n), (1, n), (4, n + 1)):
        duration = float(n * Fraction(max_step) + units * rounding)
        assert abs((Fraction(duration) - n * Fraction(max_step)) / rounding - units) <= Fraction(1, 2)
        assert substeps(time, duration, max_step) == expected


def test_an_endless_communication_step_is_refused() -> None:
    with pytest.raises(OverflowError, match=r"1e-300 s, at most 2147483647"):
        substeps(0.0, 1.0, 1e-300)
    assert substeps(0.0, 1.0, 1 / MAX_SUBSTEPS) == MAX_SUBSTEPS


@pytest.mark.parametrize("method", SolverMethod)
def test_evaluations_are_counted(method: SolverMethod) -> None:
    calls = 0
    motion = Pendulum(1.0, 1.0, 0.1, W02).motion(0.5)

    class Counting(Motion):
        def acceleration(self) -> Callable[[float, float], float]:
            inner = super().acceleration()

            def counted(phi: float, w: float) -> float:
                nonlocal calls
                calls += 1
                return inner(phi, w)

            return counted

    *_, nfev = METHODS[method].solver(Counting(*motion), 0.5, 0.0, 0.01, 7)
    if method is SolverMethod.ImplicitEuler:
        assert nfev >= 2 * 7  # Newton evaluates at least twice where it has to move
    else:
        assert nfev == calls == 7 * (METHODS[method].stages or 0)
