"""The closed forms of validation.references against 30-digit arithmetic that shares nothing with them.

Bounds are in units of EPS, the spacing of doubles at 1; each says how many roundings, and through what, it allows.
"""

from math import factorial, pi, radians, sin, sqrt

import mpmath as mp
import numpy as np
import pytest

from validation import references
from validation.references import discrete
from validation.references import taylor as series

EPS = 2.2e-16
W02 = 9.80665
W0 = sqrt(W02)


@pytest.fixture(autouse=True)
def thirty_digits():
    with mp.workdps(30):
        yield


# Periods [s] at g = 9.80665 and 9.81 m/s2, L = 1 m: 40-digit AGM, quadrature of (10) and (14), and (17), which agree.
PERIODS = {
    1: ("2.0064474924570667707", "2.0061048740557132728"),
    5: ("2.0073646894897996801", "2.0070219144690568074"),
    10: ("2.0102358926023058888", "2.0098926272986006829"),
    20: ("2.0217964972023012568", "2.0214512578245763615"),
    30: ("2.0413384658583683343", "2.0409898895191304105"),
    45: ("2.086612179834958617", "2.086255872614367302"),
    60: ("2.1532423517838427274", "2.1528746668805157034"),
    90: ("2.3682463462860098842", "2.3678419475762374493"),
    120: ("2.7545601940549516653", "2.754089828887825677"),
    150: ("3.5357019383113999228", "3.5350981863815234739"),
    170: ("4.8943600287489555139", "4.893524274105486164"),
    175: ("5.7737708121190853404", "5.7727848904177368278"),
    179: ("7.8271333888000171349", "7.825796837537682703"),
    179.9: ("10.768132039640137461", "10.76629328721882842"),
    179.99: ("13.709267688812921991", "13.706926711838978701"),
    179.999: ("16.650405256753912025", "16.647562054899688087"),
}


@pytest.mark.parametrize("amplitude", PERIODS)
def test_period_has_the_digits_of_40_digit_arithmetic(amplitude):
    angle = radians(amplitude)
    # The double nearest to the angle differs from it by up to ulp/2, which moves the period by its slope.
    moved = references.period_slope(angle, W02) * np.spacing(angle) / 2
    for g, digits in zip((9.80665, 9.81), PERIODS[amplitude], strict=True):
        exact = float(digits)
        assert abs(references.period(angle, g) - exact) <= 4 * EPS * exact + 1.5 * moved
        assert abs(references.period_by_ellipkm1(angle, g) - exact) <= 4 * EPS * exact + 1.5 * moved


@pytest.mark.parametrize("degrees", [90.0, -90.0, np.nan])
@pytest.mark.parametrize(
    ("name", "reference"),
    [
        ("amplitude", lambda angle: references.period(angle, W02)),
        ("amplitude", lambda angle: references.libration(1.0, angle, W02)),
        ("phi0", lambda angle: references.overdamped_fall(1.0, angle, 1e3, W02)),
    ],
)
def test_an_angle_in_degrees_is_refused(name, reference, degrees):
    with pytest.raises(ValueError, match=rf"{name} = {degrees} rad \(allowed: .* of degrees"):
        reference(degrees)


@pytest.mark.parametrize("turns", [8, 200_000])
def test_upright_after_any_number_of_turns_is_an_amplitude(turns):
    upright = (2 * turns + 1) * pi  # less its turns it is more than pi, by rounding
    assert references.motion(0.0, upright, 0.0, W02)[0] == pytest.approx(upright, rel=1e-12, abs=0)


@pytest.mark.parametrize("amplitude", [1e-8, 0.5, 2.0, 3.1, 3.1415, pi - 1e-8])
def test_period_slope_is_the_derivative(amplitude):
    a = mp.mpf(amplitude)
    with mp.workdps(60):
        exact = mp.diff(lambda x: 2 * mp.pi / (mp.sqrt(W02) * mp.agm(1, mp.cos(x / 2))), a, h=mp.mpf("1e-25"))
    # E - k'^2*K loses the digits of k^2 against 1.
    lost = EPS / sin(amplitude / 2) ** 2
    assert abs(references.period_slope(amplitude, W02) / float(exact) - 1) <= 20 * lost


# The elliptic integral of the first kind


MODULI = [(0.5236, 0.5), (1.0, 0.5), (1.0, 0.9), (0.5, 0.99), (1.0, 0.99), (1.5, 0.999), (1.57, 0.999999)]


@pytest.mark.parametrize(("angle", "k"), MODULI)
def test_incomplete_integral_by_descent_and_by_carlson(angle, k):
    exact = float(mp.ellipf(mp.mpf(angle), mp.mpf(k) ** 2))
    # Six descents of three roundings at most; (1 - k)*(1 + k) is good to two.
    assert abs(references.incomplete_by_descent(angle, k) / exact - 1) <= 20 * EPS
    assert abs(references.incomplete(angle, (1 - k) * (1 + k)) / exact - 1) <= 6 * EPS


@pytest.mark.parametrize(
    ("angle", "k", "errors"),
    [
        (1.0, 0.5, (-6.7e-4, -2.2e-7, -2.3e-14)),
        (1.0, 0.9, (-1.6e-2, -1.6e-4, -1.8e-8)),
        (1.0, 0.99, (-4.1e-2, -2.2e-3, -6.0e-6, -4.4e-11)),
        (1.5, 0.999, (-0.24, -3.2e-2, -4.1e-4, -6.2e-8, -1.5e-15)),
        (1.57, 0.999999, (-0.58, -0.25, -2.5e-2, -1.8e-4, -8.7e-9)),
    ],
)
def test_descent_converges_as_in_40_digits(angle, k, errors):
    exact = mp.ellipf(mp.mpf(angle), mp.mpf(k) ** 2)
    for n, expected in enumerate(errors, 1):
        error = float(references.incomplete_by_descent(angle, k, n) / exact - 1)
        # Two digits are known: half a unit of the second is 5 % of a first digit 1 at most. And the roundings.
        assert abs(error - expected) <= 0.05 * abs(expected) + 20 * EPS


@pytest.mark.parametrize("k", [0.0087, 0.2588, 0.7071, 0.9659])
def test_complete_integral_by_agm(k):
    exact = float(mp.ellipk(mp.mpf(k) ** 2))
    assert abs(references.complete_by_agm(k) / exact - 1) <= 8 * EPS  # 1 - k is exact for k > 1/2


def test_incomplete_integral_continues_beyond_a_right_angle():
    for angle in (-3.0, -1.0, 2.0, 3.1):
        exact = float(mp.ellipf(mp.mpf(angle), mp.mpf("0.75")))
        assert references.incomplete(angle, 0.25) == pytest.approx(exact, rel=8 * EPS, abs=0)


@pytest.mark.parametrize(
    ("amplitude", "millionth", "trillionth"), [(5, 2, 4), (30, 5, 9), (90, 16, 34), (170, 1239, 2944)]
)
def test_series_length(amplitude, millionth, trillionth):
    angle = radians(amplitude)
    assert references.series_length(angle, 1e-6) == millionth
    assert references.series_length(angle, 1e-12) == trillionth
    # As many terms reach the tolerance, one less does not: this is what the length means.
    m = mp.sin(mp.mpf(angle) / 2) ** 2
    exact = 2 * mp.ellipk(m) / mp.pi
    terms = [(mp.binomial(2 * n, n) / mp.mpf(4) ** n) ** 2 * m**n for n in range(trillionth)]
    assert 1 - mp.fsum(terms) / exact <= 1e-12 < 1 - mp.fsum(terms[:-1]) / exact


def test_series_is_summed_to_the_last_digits():
    exact = float(mp.ellipk(mp.sin(mp.mpf(radians(90)) / 2) ** 2)) * 4 / W0
    assert references.period_by_series(radians(90), W02, 60) == pytest.approx(exact, rel=8 * EPS, abs=0)


# Motion


def taylor(phi0, rate0, w02, stop, k2=0):
    """Return phi and w at `stop` as 30-digit numbers, by the Taylor series of the equation itself, 30 terms a step."""
    phi, w = mp.mpf(phi0), mp.mpf(rate0)
    # A tenth of the angle to the next singularity in complex time.
    n = max(1, int(stop * (W0 + abs(rate0)) / 0.3))
    h = mp.mpf(stop) / n
    for _ in range(n):
        p, s, c = [phi, w], [mp.sin(phi)], [mp.cos(phi)]
        for j in range(30):
            if j:
                s.append(mp.fsum(i * p[i] * c[j - i] for i in range(1, j + 1)) / j)
                c.append(-mp.fsum(i * p[i] * s[j - i] for i in range(1, j + 1)) / j)
            p.append((-mp.mpf(w02) * s[j] - mp.mpf(k2) * (j + 1) * p[j + 1]) / ((j + 1) * (j + 2)))
        powers = [h**i for i in range(len(p))]
        phi = mp.fdot(p, powers)
        w = mp.fdot((i * p[i] for i in range(1, len(p))), powers)
    return phi, w


@pytest.mark.parametrize("phi0", [0.3, pi / 2, 2.9])
def test_a_fall_through_strong_drag_against_the_taylor_series(phi0):
    k2 = 300.0
    times = [0.0, 1.0, 30.0]
    phi, w = references.overdamped_fall(times, phi0, k2, W02)
    exact, exact_rate = series.motion(times, phi0, 0.0, k2, W02)
    # The next terms are e^2, a few times over, and logarithms of the fall, below 10.
    bound = 10 * (W02 / k2**2) ** 2
    assert phi == pytest.approx(exact, rel=bound, abs=0)
    assert w == pytest.approx(exact_rate, rel=bound, abs=0)


def test_taylor_series_keeps_its_digits_at_large_angles():
    """Whole turns change nothing but the angle."""
    times = [0.0, 0.5]
    near, far = (series.motion(times, 0.5 + turns * 2 * pi, 3.0, 0.1, 9.80665) for turns in (0, 40))
    # 80*pi is rounded to 3e-14, times w02*t.
    assert far[1][-1] == pytest.approx(near[1][-1], rel=0, abs=1e-12)


def test_taylor_series_has_the_digits_of_40_digit_arithmetic():
    # 170 deg, k2 = 0.002/s, after 5 s: 40-digit Taylor series with other steps, and mpmath's odefun.
    phi, w = taylor(radians(170), 0, 9.80665, 5, 0.002)
    assert abs(phi - mp.mpf("2.8284207868873456665")) < mp.mpf("1e-18")
    assert abs(w - mp.mpf("-0.67797844862637026221")) < mp.mpf("1e-18")


STARTS = [
    (1e-8, 0.0),
    (0.5, 0.0),
    (2.5, 0.0),
    (-3.1, 0.0),
    (radians(179.9999), 0.0),
    (1.0, 2.0),
    (1.0, -2.0),
    (100.0, -3.0),
    (0.0, 7.0),
    (1.0, -8.0),
    (0.0, 20.0),
    (0.0, 2 * W0 * (1 - 1e-9)),
    (0.0, -2 * W0 * (1 + 1e-9)),
    (0.0, 2 * W0),
    (pi - 1e-6, 0.0),
    (-1.0, 5.0),
]


@pytest.mark.parametrize(("phi0", "rate0"), STARTS)
def test_motion_against_a_taylor_series(phi0, rate0):
    for t in (0.3, 2.0, 5.0):
        phi, w = (float(x) for x in references.motion(t, phi0, rate0, W02))
        exact, exact_rate = taylor(phi0, rate0, W02, t)
        # u = w0*t rounds by EPS*w0*t at the rate of the motion; the functions by 40 roundings of their largest values.
        scale = max(1e-8, min(abs(phi0), pi)) if rate0 == 0 else pi
        fastest = W0 * scale + abs(rate0)
        bound = EPS * (2 * W0 * t * fastest / W0 + 40 * scale + abs(phi0) + abs(float(exact)))
        assert abs(phi - float(exact)) <= bound
        assert abs(w - float(exact_rate)) <= bound * (W0 + abs(rate0))


@pytest.mark.parametrize("amplitude", [1e-8, 0.5, 2.0, 3.0, radians(179.9999)])
def test_libration_returns_after_the_period(amplitude):
    T = references.period(amplitude, W02)
    phi, w = references.libration(np.array([0.0, T / 2, T]), amplitude, W02)
    assert np.abs(phi - amplitude * np.array([1, -1, 1])).max() <= 4 * EPS * amplitude
    # The rate at the turning point is the acceleration times the rounding of T and of u.
    assert np.abs(w).max() <= 8 * EPS * T * W02 * sin(min(amplitude, pi / 2))


@pytest.mark.parametrize("m1", [0.9, 0.5, 0.1, 1e-3, 1e-9, 1e-13])
def test_jacobi_against_mpmath(m1):
    m = 1 - mp.mpf(m1)
    u = np.linspace(-2, 4, 13) * float(mp.ellipk(m))
    measured = references.jacobi(u, m1)
    for name, values in zip(("sn", "cn", "dn"), measured, strict=True):
        exact = np.array([float(mp.ellipfun(name, mp.mpf(x), m=m)) for x in u])
        # Reducing u by the period rounds u, which moves the functions by as much; 20 roundings beyond.
        assert np.abs(values - exact).max() <= EPS * (2 * np.abs(u).max() + 20)


@pytest.mark.parametrize(
    ("phi0", "rate0"), [(0.0, 2 * W0), (1.0, 5.0), (pi - 1e-9, 0.0), (0.0, 2 * W0 * (1 - 1e-12))]
)
def test_complement_keeps_its_digits(phi0, rate0):
    exact = mp.cos(mp.mpf(phi0) / 2) ** 2 - mp.mpf(rate0) ** 2 / (4 * mp.mpf(W02))
    assert references.complement(phi0, rate0, W02) == pytest.approx(float(exact), rel=2 * EPS, abs=0)


# Linear pendulum


def matrix_exponential(k2, t):
    A = mp.matrix([[0, 1], [-mp.mpf(W02), -mp.mpf(k2)]])
    return mp.expm(A * mp.mpf(t))


DAMPING = [0.0, 0.002, 1.0, 6.26, 2 * W0, 6.3, 50.0, 1e3]


@pytest.mark.parametrize("k2", DAMPING)
@pytest.mark.parametrize("t", [0.01, 1.0, 5.0])
def test_linear_responses_against_the_matrix_exponential(k2, t):
    flow = matrix_exponential(k2, t)
    # The discriminant w02 - k2^2/4 rounds by EPS*k2^2 and is multiplied by t^2; then some 20 roundings.
    scale = EPS * (20 + 4 * W0 * t + (k2 * t) ** 2 * (k2 < 10))
    h, rate = references.impulse_response(t, k2, W02)
    assert abs(h - float(flow[0, 1])) <= scale / W0
    assert abs(rate - float(flow[1, 1])) <= scale
    phi, w = references.free_evolution(t, 0.3, -2.0, k2, W02)
    assert abs(phi - float(flow[0, 0] * mp.mpf(0.3) - 2 * flow[0, 1])) <= 3 * scale
    assert abs(w - float(flow[1, 0] * mp.mpf(0.3) - 2 * flow[1, 1])) <= 9 * scale
    step, _ = references.step_response(t, k2, W02)
    assert abs(step - float((1 - flow[0, 0]) / mp.mpf(W02))) <= 3 * scale / W02


@pytest.mark.parametrize("k2", [0.002, 0.5, 6.26, 50.0])
@pytest.mark.parametrize("w", [0.3, 2.0, 3.1315, 10.0])
def test_sinusoidal_response_against_the_matrix_exponential(k2, w):
    # States: angle, rate, and the oscillator sin(w*t), w*cos(w*t) that drives them.
    A = mp.matrix(
        [[0, 1, 0, 0], [-mp.mpf(W02), -mp.mpf(k2), 1, 0], [0, 0, 0, 1], [0, 0, -(mp.mpf(w) ** 2), 0]]
    )
    exact = mp.expm(A * 2) * mp.matrix([0, 0, 0, w])
    phi, rate = (float(x) for x in references.sinusoidal_response(2.0, w, k2, W02))
    # Near resonance it is the difference of two motions |h(w)| times as large.
    size = abs(complex(references.frequency_response(w, k2, W02)))
    assert abs(phi - float(exact[0])) <= 40 * EPS * (1 + size)
    assert abs(rate - float(exact[1])) <= 40 * EPS * (1 + size) * max(w, W0)


@pytest.mark.parametrize("k2", [0.002, 2.0, 50.0])
def test_held_frequency_response_is_the_hold_and_its_images(k2):
    w, H = 3.0, 0.2
    total = mp.mpf(0)
    for j in range(-200, 201):
        image = mp.mpf(w) + 2 * mp.pi * j / H
        hold = (1 - mp.exp(-1j * image * H)) / (1j * image * H)
        total += hold / (W02 - image**2 + 1j * k2 * image)
    # The images fall like 1/j^3 in pairs of opposite sign: beyond 200 they sum to 1e-8 of the whole at most.
    sampled, _ = references.held_frequency_response(w, H, k2, W02)
    assert abs(sampled / complex(total) - 1) <= 1e-8
    assert abs(references.hold(w, H) - complex((1 - mp.exp(-1j * w * H)) / (1j * w * H))) <= 4 * EPS


@pytest.mark.parametrize("k2", [0.0, 0.5, 2 * sqrt(W02), 20.0])
def test_the_response_to_a_cubic_is_a_cubic_and_the_free_evolution_from_it(k2):
    H, n, row = 0.4, 5, [0.3, -1.0, 2.0, 1.5]  # the drive and its derivatives at the beginning
    t, steps = H * np.arange(n + 1), np.arange(n)
    factors = [1.0, H * steps, (H * steps) ** 2 / 2, (H * steps) ** 3 / 6]
    rows = np.array([sum(row[j + i] * factors[i] for i in range(4 - j)) + 0 * steps for j in range(4)]).T
    slopes = [0.0] * 6  # of the cubic: derivatives at t = 0, from the highest
    for j in (3, 2, 1, 0):
        slopes[j] = (row[j] - k2 * slopes[j + 1] - slopes[j + 2]) / W02
    cubic = [sum(slopes[j + i] * t**i / factorial(i) for i in range(4 - j)) for j in (0, 1)]
    free = references.free_evolution(t, -slopes[0], -slopes[1], k2, W02)
    found = references.polynomial_response(rows, H, k2, W02)
    # Cubic and free evolution, a few roundings each, cancel at first.
    for ours, particular, rest in zip(found, cubic, free, strict=True):
        size = np.max(np.abs(particular)) + np.max(np.abs(rest))
        assert np.max(np.abs(ours - particular - rest)) <= 32 * EPS * size


@pytest.mark.parametrize("k2", [0.0, 0.002, 2 * W0, 50.0])
@pytest.mark.parametrize("n", [1, 50, 10_000])
def test_rk4_of_a_free_motion_is_a_power_of_its_step(k2, n):
    h = 1e-3
    z = mp.mpf(h) * mp.matrix([[0, 1], [-mp.mpf(W02), -mp.mpf(k2)]])
    one = mp.eye(2)
    power = (one + z * (one + z * (one + z * (one + z / 4) / 3) / 2)) ** n
    start = mp.matrix([1, -2])
    found = references.rk4_evolution([0, n], *map(float, start), k2, W02, h)
    assert [float(x[0]) for x in found] == list(start)
    # The change of a step has four roundings, and the motion carries them on like an error of the rate: without its own
    # digits the change would lose one of 1 in each step.
    bound = 4 * EPS * (1 + n * h * max(W0, k2))
    for ours, exact, size in zip(found, power * start, (1, W0), strict=True):
        assert abs(mp.mpf(float(ours[1])) - exact) <= bound * size


def test_rk4_under_a_held_drive_is_its_discrete_motion_for_small_angles():
    u, H, h, small = [1.0, -2.0, 0.5], 0.3, 0.04, 1e-9
    for k2 in (0.002, 5.0):
        phi, w = references.rk4_response(u, H, k2, W02, h)
        drive = [small * x for x in u]
        motion = discrete.motion("ExplicitRungeKutta4", [0.0, H, 2 * H, 3 * H], 0.0, 0.0, k2, W02, h, drive)
        assert np.max(np.abs(motion[0] / small - phi)) <= 24 * 4 * EPS * np.max(np.abs(phi))
        assert np.max(np.abs(motion[1] / small - w)) <= 24 * 4 * EPS * np.max(np.abs(w))


def test_rk4_from_a_start_is_the_sum_of_free_evolution_and_response():
    u, H, h, start = [1.0, -2.0, 0.5], 0.3, 0.04, (0.7, -1.1)
    for k2 in (0.002, 5.0):
        steps = 8 * np.arange(4)  # 8 substeps of 37.5 ms
        free = references.rk4_evolution(steps, *start, k2, W02, H / 8)
        driven = references.rk4_response(u, H, k2, W02, h)
        for both, *parts in zip(references.rk4_response(u, H, k2, W02, h, start), free, driven, strict=True):
            assert np.max(np.abs(both - sum(parts))) <= 24 * 4 * EPS * W0


def test_roundings_of_increments_add_up_to_what_the_motion_carries_on():
    H, k2, n, eps = 0.02, 0.5, 400, 1e-6
    t = H * np.arange(n)
    drive = np.sin(3 * t)
    state = references.polynomial_response(drive[:, np.newaxis], H, k2, W02)
    carried = references.response_rounding(state, drive, H, k2, W02)
    # Increments that are all larger by eps: the motion of a pendulum that is faster by eps, and so is its drive.
    fast = references.polynomial_response(
        (1 + eps) ** 2 * drive[:, np.newaxis], H, (1 + eps) * k2, (1 + eps) ** 2 * W02
    )
    moved = np.max(np.abs(fast[0] - state[0])) / eps
    assert moved <= carried * (1 + 10 * W0 * H)  # sizes of a step are those at its beginning
    assert carried <= 20 * moved


def test_held_response_is_that_of_steps():
    u, H = np.array([1.0, -2.0, 0.5]), 0.3
    t = H * np.arange(4)
    for k2 in (0.002, 50.0):
        phi, w = references.polynomial_response(u[:, np.newaxis], H, k2, W02)
        jumps = np.diff(u, prepend=0.0)
        exact = [
            sum(
                jump * np.array(references.step_response(time - n * H, k2, W02))
                for n, jump in enumerate(jumps)
                if time > n * H
            )
            for time in t[1:]
        ]
        assert np.abs(np.array([phi[1:], w[1:]]).T - np.array(exact)).max() <= 40 * EPS


# The document's pulse A*exp(-t^2/2), A = 1/sqrt(2*pi), k2 = 0.002/s, from minus infinity: 30-digit quadrature.
DOCUMENT_PULSE = {
    -3: "2.22534788183623e-4",
    -1: "0.0233415451157726",
    -0.5: "0.0385870576631277",
    0: "0.0472313218313262",
    0.5: "0.0409724409790077",
    1: "0.0233861270933305",
    2: "0.00373592928069484",
    3: "3.01207408000561e-4",
    5: "1.25696954968869e-4",
    10: "-2.42396709814816e-4",
    50: "-1.09054877879663e-3",
}


def test_gaussian_response_has_the_digits_of_the_document_case():
    t = np.array(list(DOCUMENT_PULSE), dtype=float)
    exact = np.array([float(x) for x in DOCUMENT_PULSE.values()])
    phi, _ = references.gaussian_response(t, 1 / sqrt(2 * pi), 0.0, 1.0, 0.002, W02)
    # 15 digits are given, and the measured accuracy of the form is 4.4e-16 of the peak, which w0*t*EPS joins at 50 s.
    assert np.abs(phi - exact).max() <= 0.0473 * 20 * EPS + 5e-18


def test_gaussian_response_of_the_pulse_cut_at_its_peak():
    phi, _ = references.gaussian_response(1.0, 1 / sqrt(2 * pi), 0.0, 1.0, 0.002, W02, start=0.0)
    assert float(phi) == pytest.approx(0.070555779097875582, rel=20 * EPS, abs=0)


def convolution(t, center, variance, k2, start):
    """Return angle and rate by quadrature of the impulse response with the pulse."""
    reach = 12 * mp.sqrt(variance)
    lower = center - reach if start is None else max(mp.mpf(start), center - reach)
    upper = min(mp.mpf(t), center + reach)
    points = mp.linspace(lower, upper, 9 if k2 < 10 else 33)
    half = mp.mpf(k2) / 2
    root = mp.sqrt(mp.mpf(W02) - half**2)

    def h(s):
        return mp.re(mp.exp(-half * s) * (mp.sin(root * s) / root if root else s))

    def rate(s):
        return mp.re(mp.exp(-half * s) * (mp.cos(root * s) - half * (mp.sin(root * s) / root if root else s)))

    def pulse(s):
        return mp.exp(-((s - center) ** 2) / (2 * mp.mpf(variance)))

    return tuple(
        float(mp.quad(lambda s, f=f: f(t - s) * pulse(s), points, method="gauss-legendre")) for f in (h, rate)
    )


@pytest.mark.parametrize("k2", [0.002, 1.0, 6.26, 2 * W0, 20.0])
@pytest.mark.parametrize(
    ("center", "variance", "start"), [(5.0, 0.25, None), (3.0, 0.01, 0.0), (0.0, 4.0, 0.0), (0.0, 1.0, 1.0)]
)
def test_gaussian_response_against_quadrature(k2, center, variance, start):
    for t in (2.0, 5.5):
        phi, w = (float(x) for x in references.gaussian_response(t, 1.0, center, variance, k2, W02, start))
        exact, exact_rate = convolution(t, center, variance, k2, start)
        # Near critical damping the difference of the roots divides: it costs w0/|beta| roundings, 32 at k2 = 6.26.
        beta = sqrt(abs(W02 - k2 * k2 / 4)) or W0
        size = min(sqrt(2 * pi * variance) / W0, 1 / W02)
        bound = 40 * EPS * size * max(1.0, W0 / beta)
        assert abs(phi - exact) <= bound
        assert abs(w - exact_rate) <= bound * max(W0, k2)


def test_gaussian_response_is_continuous_through_critical_damping():
    t = np.linspace(-2, 6, 41)
    critical = references.gaussian_response(t, 1.0, 0.0, 0.25, 2 * W0, W02)
    for relative in (-1e-8, 1e-8):
        near = references.gaussian_response(t, 1.0, 0.0, 0.25, 2 * W0 * (1 + relative), W02)
        # k2 changes by 1e-8 of itself, and the response by less than that; roundings are multiplied by w0/beta = 1e4.
        assert np.abs(near[0] - critical[0]).max() <= 1e-8
        assert np.abs(near[1] - critical[1]).max() <= 1e-8 * W0


@pytest.mark.parametrize("k2", [1e3, 1e6, 1e9])
def test_slow_root_does_not_cancel(k2):
    with mp.workdps(60):  # here the difference loses up to 17 digits
        exact = (mp.mpf(k2) - mp.sqrt(mp.mpf(k2) ** 2 - 4 * mp.mpf(W02))) / 2
    assert references.real_roots(k2, W02)[1] == pytest.approx(float(exact), rel=4 * EPS, abs=0)
