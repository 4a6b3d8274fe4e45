"""The discrete motions of the methods, against what the methods are known for."""

from itertools import pairwise
from math import cos, exp, pi, radians, sin, sqrt

import mpmath as mp
import numpy as np
import pytest

from validation import references
from validation.metrics import observed_order, state_error
from validation.references import discrete
from validation.references.methods import METHODS, linear_radius, rk4_lag

W02 = 9.80665
W0 = sqrt(W02)
RUNGE_KUTTA = [name for name, method in METHODS.items() if method.tableau is not None]


@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_the_errors_fall_with_the_order_of_the_method(name: str) -> None:
    amplitude = radians(30)
    T = references.period(amplitude, W02)
    t = np.linspace(0, T, 21)
    exact = references.libration(t, amplitude, W02)
    n = 2000 if METHODS[name].order == 1 else 400
    errors = [
        state_error(*discrete.motion(name, t.tolist(), amplitude, 0.0, 0.0, W02, T / steps), exact)
        for steps in (n, 2 * n)
    ]
    # The next term is a relative pi*h*w0 at most, 0.01 and 0.05; the order shows half of it over ln 2.
    assert abs(observed_order(*errors) - METHODS[name].order) < 0.05


def test_the_taylor_series_of_order_16_is_exact_to_rounding() -> None:
    t = np.linspace(0, 2.0, 21)
    phi, w = discrete.motion("TaylorSeries", t.tolist(), 1.5, 0.0, 0.0, W02, 0.05)
    # A step is in error by (h/radius)^17 = (0.05/0.59)^17 = 6e-19; 40 steps round by a few units of 1e-16.
    assert state_error(phi, w, references.libration(t, 1.5, W02)) < 1e-14


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("k2", [0.0, 1.0, 50.0])
def test_a_small_step_multiplies_by_the_stability_function(name: str, k2: float) -> None:
    h, small = 0.03, 1e-9
    columns = []
    for phi0, rate0 in ((small, 0.0), (0.0, small * W0)):
        phi, w = discrete.motion(name, [0.0, h], phi0, rate0, k2, W02, h)
        columns.append((phi[-1] / small, w[-1] / (small * W0)))
    radius = np.max(np.abs(np.linalg.eigvals(np.array(columns).T)))
    # SDIRK4's coefficients A_ij/A_ii, 31 and less, make some 100 roundings of those of its stages; sin(x) is x.
    assert radius == pytest.approx(linear_radius(METHODS[name], k2, W02, h), rel=1e-13, abs=0)


@pytest.mark.parametrize(
    ("name", "at_minus_infinity"),
    [("ImplicitEuler", 0.0), ("ImplicitTrapezoid", 1.0), ("TRBDF2", 0.0), ("SDIRK4", 0.0)],
)
def test_implicit_methods_damp_as_they_are_known_to(name: str, at_minus_infinity: float) -> None:
    # The next term of R is b/z with |b| < 10.
    assert abs(METHODS[name].stability(-1e9)) == pytest.approx(at_minus_infinity, rel=0, abs=1e-8)
    for z in (-0.1, -3.0, 2j, -1 + 50j):
        assert abs(METHODS[name].stability(z)) <= 1 + 1e-15  # on the imaginary axis it can be 1, rounded


def test_explicit_stability_functions_are_taylor_polynomials() -> None:
    z = -0.4 + 0.3j
    assert METHODS["ExplicitEuler"].stability(z) == pytest.approx(1 + z, rel=1e-15, abs=0)
    rk4 = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24
    assert METHODS["ExplicitRungeKutta4"].stability(z) == pytest.approx(rk4, rel=1e-15, abs=0)
    # 1/17! = 3e-15 is left out.
    assert METHODS["TaylorSeries"].stability(-1.0).real == pytest.approx(exp(-1), rel=1e-14, abs=0)


@pytest.mark.parametrize("name", RUNGE_KUTTA)
def test_the_weights_of_a_tableau_sum_to_one(name: str) -> None:
    tableau = METHODS[name].tableau
    assert tableau is not None
    assert sum(tableau.b) == pytest.approx(1.0, rel=1e-14, abs=0)  # roundings of SDIRK4's weights, 8 and less


def test_a_communication_step_is_divided_into_the_fewest_steps() -> None:
    whole = discrete.motion("ExplicitEuler", [0.0, 0.3], 1.0, 0.0, 0.0, W02, 0.1)
    steps = discrete.motion("ExplicitEuler", [0.0, 0.1, 0.2, 0.3], 1.0, 0.0, 0.0, W02, 0.1)
    # 0.3/3 and 0.1 are different doubles.
    assert whole[0][-1] == pytest.approx(steps[0][-1], rel=1e-14, abs=0)
    coarse = discrete.motion("ExplicitEuler", [0.0, 0.3], 1.0, 0.0, 0.0, W02, 0.31)
    assert coarse[0][-1] == 1.0


def test_a_drive_is_held() -> None:
    t = [0.0, 0.5, 1.0]
    phi, w = discrete.motion("TaylorSeries", t, 1e-9, 0.0, 0.5, W02, 0.01, [1e-9, -2e-9])
    free = references.free_evolution(np.array(t), 1.0, 0.0, 0.5, W02)
    held = references.polynomial_response([[1.0], [-2.0]], 0.5, 0.5, W02)
    # A hundred steps, each rounded by 1e-16; the rate is w0 times as large.
    assert np.abs(phi * 1e9 - free[0] - held[0]).max() < 1e-14
    assert np.abs(w * 1e9 - free[1] - held[1]).max() < 4e-14


def test_a_drive_may_be_a_polynomial_in_each_step() -> None:
    rows, H, small = [[1.0, -2.0, 3.0, 5.0], [-2.0, 0.5, 4.0, -7.0]], 0.5, 1e-9
    exact = references.polynomial_response(rows, H, 0.5, W02)
    for name, n in (("TaylorSeries", 10), ("SDIRK4", 40)):
        errors = []
        for h in (H / n, H / (2 * n)):
            drive = [[small * x for x in row] for row in rows]
            phi, w = discrete.motion(name, [0.0, H, 2 * H], 0.0, 0.0, 0.5, W02, h, drive)
            errors.append(float(np.max(np.hypot(phi / small - exact[0], (w / small - exact[1]) / W0))))
        if name == "TaylorSeries":  # the 17th derivative, (h*w0)^17, is below rounding
            assert max(errors) <= 4 * n * 2.0**-52
        else:
            assert observed_order(*errors) == pytest.approx(4, abs=4 * W0 * H / n)


def test_implicit_stages_solve_their_equation() -> None:
    h = 0.2
    phi, w = discrete.motion("ImplicitEuler", [0.0, h], 1.0, 0.5, 0.3, W02, h, 0.7)
    assert phi[-1] == pytest.approx(1.0 + h * w[-1], rel=1e-15, abs=0)
    assert w[-1] == pytest.approx(0.5 + h * (0.7 - 0.3 * w[-1] - W02 * sin(phi[-1])), rel=1e-14, abs=0)


def test_rk4_error_of_a_linear_motion_is_that_of_its_discrete_motion() -> None:
    h, stop, k2 = 0.02, 5.0, 0.5
    phi, _ = discrete.motion("ExplicitRungeKutta4", [0.0, stop], 1e-9, 0.0, k2, W02, h)
    exact = references.free_evolution(stop, 1.0, 0.0, k2, W02)
    (error, _), (neglected, _) = references.rk4_error(stop, exact, k2, W02, h)
    measured = phi[-1] * 1e9 - float(exact[0])
    # The next term is a relative h*w0 = 0.06 of the last, and the error itself squared is below it.
    assert abs(measured - float(error)) <= 2 * abs(float(neglected)) + 1e-14
    assert abs(measured) > 10 * abs(float(neglected))


@pytest.mark.parametrize(
    "name", ["ExplicitEuler", "ImplicitEuler", "ExplicitMidPoint2", "ExplicitRungeKutta4"]
)
def test_the_drift_of_the_energy_is_that_of_the_modified_equation(name: str) -> None:
    amplitude = radians(60)
    T = references.period(amplitude, W02)
    orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
    n = 4000 if METHODS[name].order == 1 else 200
    h = T / n
    phi, w = discrete.motion(name, [0.0, T], amplitude, 0.0, 0.0, W02, h)
    gained = w[-1] ** 2 / 2 - W02 * (cos(phi[-1]) - cos(amplitude))
    assert gained == pytest.approx(T * METHODS[name].energy_drift(h, orbit, W02), rel=2 * pi * h * W0, abs=0)


def test_an_unknown_drift_is_refused() -> None:
    with pytest.raises(ValueError, match="is not given"):
        METHODS["SDIRK4"].energy_drift(0.1, (np.zeros(1), np.zeros(1)), W02)


def rk4_lag_in_30_digits(amplitude: mp.mpf, n: int) -> mp.mpf:
    """Return the relative growth of RK4's period over h^4, h = T/n, at w0 = 1."""
    T = 4 * mp.ellipk(mp.sin(amplitude / 2) ** 2)
    h, q, p = T / n, amplitude, mp.mpf(0)
    for _ in range(n):
        slopes = [(p, -mp.sin(q))]
        for share in (h / 2, h / 2, h):
            u, v = slopes[-1]
            slopes.append((p + share * v, -mp.sin(q + share * u)))
        du, dv = (
            sum(weight * x for weight, x in zip((1, 2, 2, 1), of, strict=True))
            for of in zip(*slopes, strict=True)
        )
        q, p = q + h / 6 * du, p + h / 6 * dv
    # The time to the turning point is of the order h^4, so that its square is nil.
    return p / mp.sin(q) / T / h**4


@pytest.mark.parametrize("angle", [1, 30, 90, 120])
def test_the_lag_of_rk4_is_that_of_its_runs_for_ever_shorter_steps(angle: int) -> None:
    counts = (32, 64, 128, 256, 512)
    with mp.workdps(30):
        table = [rk4_lag_in_30_digits(mp.radians(angle), n) for n in counts]
        for j in range(1, len(counts)):  # Richardson: the error is a series in h
            table = [(2**j * fine - coarse) / (2**j - 1) for coarse, fine in pairwise(table)]
    # Any other integer in the formula shows by 1e-4 or more at one of these angles.
    assert rk4_lag(radians(angle)) == pytest.approx(float(table[0]), rel=1e-5, abs=0)
