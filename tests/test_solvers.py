from collections.abc import Callable
from fractions import Fraction
from math import cos, inf, isinf, nextafter, sin, sqrt, ulp
from sys import float_info

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import mp, mpc, mpf

from damped_pendulum.model import Motion, Pendulum
from methods.implicit import MAX_EVALUATIONS, newton_stage
from methods.integration import BLOCK
from methods.solvers import (
    MAX_SUBSTEPS,
    METHODS,
    SolverMethod,
    stability_limit,
    substeps,
)
from methods.taylor import convolution, total
from tests.twin import integration

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


def tr_bdf2() -> tuple[tuple[mpf, ...], ...]:
    """Trapezoid over gamma*h, then Gear's formula of order 2 over the whole, gamma = 2 - sqrt(2).

    Bank et al., IEEE Transactions on Electron Devices 32 (1985), 1992, eqs. (27), (28):
    y = y1/(gamma*(2 - gamma)) - y0*(1 - gamma)^2/(gamma*(2 - gamma)) + h*(1 - gamma)/(2 - gamma)*f(y).
    """
    gamma = 2 - mp.sqrt(2)
    trapezoid = gamma / 2
    share = 1 / (gamma * (2 - gamma))  # of y1, whose slopes enter the last stage with it
    return (
        (mpf(0),),
        (trapezoid, trapezoid),
        (share * trapezoid, share * trapezoid, (1 - gamma) / (2 - gamma)),
    )


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


# Rows of A of the implicit methods; the last one holds the weights, too.
with mp.workdps(50):
    IMPLICIT = {
        SolverMethod.ImplicitEuler: ((mpf(1),),),  # Hairer, Wanner II, eq. (IV.3.3)
        SolverMethod.ImplicitTrapezoid: ((mpf(0),), (mpf(1) / 2, mpf(1) / 2)),
        SolverMethod.TRBDF2: tr_bdf2(),
        SolverMethod.SDIRK4: (  # eq. (IV.6.16)
            (mpf(1) / 4,),
            (mpf(1) / 2, mpf(1) / 4),
            (mpf(17) / 50, mpf(-1) / 25, mpf(1) / 4),
            (mpf(371) / 1360, mpf(-137) / 2720, mpf(15) / 544, mpf(1) / 4),
            (mpf(25) / 24, mpf(-49) / 48, mpf(125) / 16, mpf(-85) / 12, mpf(1) / 4),
        ),
    }


def implicit_step(method: SolverMethod, motion: Motion, phi: float, w: float, h: float) -> tuple[mpf, mpf]:
    """Return a substep in 40 digits, each stage solved for its rate by a secant method."""
    rows = IMPLICIT[method]
    rates: list[mpf] = []
    accelerations: list[mpf] = []
    with mp.workdps(40):
        drive, damping_rate, w02 = mpf(motion.drive), mpf(motion.damping_rate), mpf(motion.w02)

        def a(x: mpf, v: mpf) -> mpf:
            return drive - damping_rate * v - w02 * mp.sin(x)

        for row in rows:
            *known, diagonal = row
            x_known = phi + h * sum(c * v for c, v in zip(known, rates, strict=True))
            v_known = w + h * sum(c * k for c, k in zip(known, accelerations, strict=True))
            b = h * diagonal

            def residual(v: mpf, x: mpf = x_known, v_known: mpf = v_known, b: mpf = b) -> mpf:
                return v - v_known - b * a(x + b * v, v)

            v = mp.findroot(residual, v_known) if b else v_known
            rates.append(v)
            accelerations.append(a(x_known + b * v, v))
        return x_known + b * v, v


@pytest.mark.parametrize("method", IMPLICIT)
@pytest.mark.parametrize("damping_rate", [0.0, 0.5, 1e6])
@pytest.mark.parametrize(("phi", "w", "h"), [(0.7, 0.0, 0.1), (-2.9, 3.0, 0.25), (1e3, -4.0, 1e-3)])
def test_a_step_of_an_implicit_method_is_that_of_its_tableau(
    method: SolverMethod, damping_rate: float, phi: float, w: float, h: float
) -> None:
    motion = Motion(damping_rate, W02, 0.3)
    found = METHODS[method].solver(motion, phi, w, h, 1)
    exact = implicit_step(method, motion, phi, w, h)
    # SDIRK4's coefficients A_ij/A_ii, 31 and less, make of the roundings of five stages what their sum of 80 says.
    bound = 100 * float_info.epsilon
    assert abs(found[0] - exact[0]) <= bound * (abs(phi) + h * (abs(w) + h * 10))
    assert abs(found[1] - exact[1]) <= bound * (abs(w) + h * 10 + 10 * h * abs(phi) * float_info.epsilon)


def order_conditions(A: tuple[tuple[mpf, ...], ...]) -> dict[int, list[mpf]]:
    """Return the residuals of the order conditions of the orders 1 to 4: Hairer, Norsett, Wanner I, table II.2.1."""
    b = A[-1]
    c = [sum(row) for row in A]

    def times(vector: list[mpf]) -> list[mpf]:
        return [sum(a * v for a, v in zip(row, vector, strict=False)) for row in A]

    def product(*vectors: list[mpf]) -> mpf:
        return sum(mp.fprod(factors) for factors in zip(b, *vectors, strict=True))

    return {
        1: [product() - 1],
        2: [product(c) - mpf(1) / 2],
        3: [product(c, c) - mpf(1) / 3, product(times(c)) - mpf(1) / 6],
        4: [
            product(c, c, c) - mpf(1) / 4,
            product(c, times(c)) - mpf(1) / 8,
            product(times([x * x for x in c])) - mpf(1) / 12,
            product(times(times(c))) - mpf(1) / 24,
        ],
    }


def implicit_stability_function(A: tuple[tuple[mpf, ...], ...], z: mpc) -> mpc:
    """Return the last stage for der(y) = lambda*y from 1, z = h*lambda."""
    stages: list[mpc] = []
    for row in A:
        *known, diagonal = row
        stages.append((1 + z * sum(a * y for a, y in zip(known, stages, strict=True))) / (1 - z * diagonal))
    return stages[-1]


@pytest.mark.parametrize("method", IMPLICIT)
def test_an_implicit_method_has_its_order_and_is_stable_in_the_left_half_plane(method: SolverMethod) -> None:
    A = METHODS[method].tableau
    assert tuple(tuple(map(float, row)) for row in IMPLICIT[method]) == A
    with mp.workdps(40):
        for order, residuals in order_conditions(IMPLICIT[method]).items():
            holds = all(abs(residual) < mpf(10) ** -38 for residual in residuals)
            assert holds == (order <= METHODS[method].order)
        # |R| is largest on the boundary, the imaginary axis, for R has its poles at 1/A_ii > 0.
        for k in range(-60, 61):
            assert (
                abs(implicit_stability_function(IMPLICIT[method], mpc(0, 10 ** (mpf(k) / 10))))
                <= 1 + mpf(10) ** -38
            )
        at_infinity = abs(implicit_stability_function(IMPLICIT[method], mpc(-(mpf(10) ** 30))))
        assert at_infinity == pytest.approx(float(method is SolverMethod.ImplicitTrapezoid), rel=0, abs=1e-28)


def taylor_by_iteration(motion: Motion, phi: float, w: float, order: int) -> tuple[list[mpf], list[mpf]]:
    """Return the Taylor coefficients of phi and w by Picard's iteration, sin(phi) from its derivatives at the start."""

    def multiplied(p: list[mpf], q: list[mpf]) -> list[mpf]:
        return [sum(p[j] * q[k - j] for j in range(k + 1)) for k in range(order + 1)]

    def integrated(start: float, p: list[mpf]) -> list[mpf]:
        return [mpf(start), *(p[k] / (k + 1) for k in range(order))]

    zeros = [mpf(0)] * order
    x, v = [mpf(phi), *zeros], [mpf(w), *zeros]
    for _ in range(order + 1):
        power, sine = [mpf(1), *zeros], [mpf(0), *zeros]
        for n in range(order + 1):
            derivative = mp.sin(mpf(phi) + n * mp.pi / 2) / mp.factorial(n)
            sine = [s + derivative * p for s, p in zip(sine, power, strict=True)]
            power = multiplied(power, [mpf(0), *x[1:]])
        a = [-motion.damping_rate * rate - mpf(motion.w02) * s for rate, s in zip(v, sine, strict=True)]
        a[0] += motion.drive
        x, v = integrated(phi, v), integrated(w, a)
    return x, v


@pytest.mark.parametrize("motion", [Motion(0.0, W02, 0.0), Motion(3.0, -2.0, 0.7), Motion(0.5, 0.0, -0.2)])
@pytest.mark.parametrize(("phi", "w", "h"), [(1.2, 0.3, 0.4), (-2.0, 5.0, 0.1), (50.0, 0.0, 0.25)])
def test_a_taylor_step_is_the_sum_of_the_series(motion: Motion, phi: float, w: float, h: float) -> None:
    order = METHODS[SolverMethod.TaylorSeries].order
    found_phi, found_w, nfev = METHODS[SolverMethod.TaylorSeries].solver(motion, phi, w, h, 1)
    with mp.workdps(40):
        series = taylor_by_iteration(motion, phi, w, order)
        exact_phi, exact_w = (sum(c * mpf(h) ** k for k, c in enumerate(p)) for p in series)
        sizes = [sum(abs(c) * mpf(h) ** k for k, c in enumerate(p)) for p in series]
    # A term k is rounded in k recursions of a few operations; the terms fall off from the first ones on.
    bound = 8 * float_info.epsilon
    assert abs(found_phi - exact_phi) <= bound * sizes[0]
    assert abs(found_w - exact_w) <= bound * (sizes[1] + h * abs(motion.w02))
    assert nfev == order


@pytest.mark.parametrize("b", [1.02, 1.1])
def test_newtons_method_ends_where_there_is_more_than_one_solution(b: float) -> None:
    """A b beyond the longest implicit stage, by which it would go around for ever."""
    for x, v in ((3.128151460538353, 0.0), (0.0, 2.9917913376116285)):
        *_, evaluations = newton_stage(lambda x, _: -sin(x), lambda x, _: (-cos(x), 0.0), b, x, v)
        assert evaluations <= MAX_EVALUATIONS


@given(
    s=st.floats(-1, 1, exclude_min=True, exclude_max=True),
    c=st.one_of(st.floats(-10, 10), st.floats(-1e6, 1e6)),
)
@example(s=0.999999, c=3.14159)
@example(s=-0.9999, c=1e-9)
@example(s=1e-5, c=1e-300)
def test_newton_finds_the_root_to_the_last_bit(s: float, c: float) -> None:
    x, *_ = Motion(damping_rate=0.0, w02=s, drive=0.0).implicit_stage(1.0)(c, 0.0)
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


def test_terms_of_a_series() -> None:
    terms = [1.0, 2.0, 3.0, 5.0]
    assert [convolution(terms, terms, k) for k in range(4)] == [1.0, 4.0, 10.0, 22.0]
    assert total([1.0, 1e-16, 1e-16, 1e-16]) == 1.0 + 3e-16  # the small ones first


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
@pytest.mark.parametrize("method", [*TABLEAUX, SolverMethod.TaylorSeries])
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
    # RK4: |R(iy)|^2 - 1 = y^6*(y^2 - 8)/576; TaylorSeries: the smallest root of the like polynomial, whose coefficients
    # are sums that cancel. Six digits of a limit are told.
    taylor = 3.3248131185385144200 / sqrt(W02)
    exact = [
        0.0,
        0.0,
        pytest.approx(sqrt(8 / W02), rel=1e-15, abs=0),
        *[inf] * 4,
        pytest.approx(taylor, rel=1e-8, abs=0),
    ]
    assert limits == exact


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


@pytest.mark.parametrize("method", SolverMethod)
@pytest.mark.parametrize("w02", [W02, 0.0, -W02])
def test_the_length_of_a_substep_is_limited_by_its_roots_in_the_implicit_methods_alone(
    method: SolverMethod, w02: float
) -> None:
    pendulum = Pendulum(1.0, 1.0, 0.1, w02)
    longest = integration(method, inf, pendulum).max_step
    if method not in IMPLICIT or w02 == 0.0:
        assert longest == inf
    else:
        diagonal = max(float(row[-1]) for row in IMPLICIT[method])
        assert longest * diagonal == pytest.approx(
            pendulum.motion().longest_implicit_stage(), rel=2 * float_info.epsilon, abs=0
        )


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


def test_the_noise_of_a_clock_is_not_forgiven_beyond_the_longest_substep() -> None:
    duration = 0.1 + 5e-7  # at 1e9 s the noise is 4*eps*1e9 = 8.9e-7 s
    for longest, expected in ((inf, 1), (duration, 1), (nextafter(duration, 0.0), 2)):
        assert substeps(1e9, duration, 0.1, longest) == expected


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
    if method in IMPLICIT:
        implicit = sum(row[-1] != 0 for row in IMPLICIT[method])
        explicit = len(IMPLICIT[method]) - implicit
        assert calls == explicit  # an explicit stage is the last one of the substep before
        assert nfev >= 7 * 2 * implicit + explicit  # Newton evaluates at least twice where it has to move
    elif method is SolverMethod.TaylorSeries:
        assert nfev == 7 * METHODS[method].order
    else:
        assert nfev == calls == 7 * (METHODS[method].stages or 0)


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
@pytest.mark.parametrize("more", [0, 1, BLOCK, BLOCK + 7])
def test_many_substeps_give_the_bits_of_one_loop(method: SolverMethod, more: int) -> None:
    n, h, pendulum = BLOCK + more, 2.0**-10, Pendulum(1.0, 1.0, 0.5, 0.0)
    steps = integration(method, h, pendulum)
    steps.hold(pendulum.motion(0.25))
    expected = METHODS[method].solver(pendulum.motion(0.25), 0.5, 1.0, h, n)
    assert steps.advance(0.5, 1.0, 0.0, n * h) == expected
