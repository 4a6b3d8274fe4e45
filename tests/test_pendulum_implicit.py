"""ImplicitEuler of the pendulum against its equation in many digits: roots, lengths of substeps, evaluations."""

from __future__ import annotations

from itertools import count
from sys import float_info

import pytest
from mpmath import mp, mpf

from methods.solvers import METHODS, SolverMethod
from tests.driver import OK, Fmu

EPS = float_info.epsilon
IMPLICIT = {"solver.method": SolverMethod.ImplicitEuler}


def strength(h: mpf, damping_rate: float, w02: float) -> mpf:
    """Return s of the equation of a substep x + s*sin(x) = c, which has a single root for every c iff |s| <= 1."""
    return h * h * w02 / (1 + h * damping_rate)


def fewest_substeps(duration: float, longest: float, damping_rate: float, w02: float) -> int:
    """Return the least number of substeps that are no longer than `longest` and have a single root."""
    for n in count(1):
        h = mpf(duration) / n
        s = abs(strength(h, damping_rate, w02))
        assert abs(s - 1) > 1e-6, (
            "the FMU keeps a margin of 1e-9 in h: nothing is claimed so near to the limit"
        )
        if h <= longest and s < 1:
            return n
    raise AssertionError


def exact_substep(
    phi: mpf, w: mpf, h: mpf, damping_rate: float, w02: float, drive: float
) -> tuple[mpf, mpf, mpf]:
    """Return angle and rate after a substep with |s| < 1, and the slope 1 + s*cos(x) at the root."""
    s = strength(h, damping_rate, w02)
    v = (w + h * drive) / (1 + h * damping_rate)
    c = phi + h * v
    low, high = c - abs(s), c + abs(s)  # x + s*sin(x) - c changes its sign between them, and only once
    for _ in range(mp.prec + 10):
        middle = (low + high) / 2
        if middle + s * mp.sin(middle) > c:
            high = middle
        else:
            low = middle
    return low, (low - phi) / h, 1 + s * mp.cos(low)


@pytest.mark.parametrize("gamma", [0.0, 0.5, 20.0])
@pytest.mark.parametrize(
    ("g", "duration"),
    [
        (-9.80665, 0.3),
        (-9.80665, 2.0),
        (-1.62, 2.0),
        (-1000.0, 0.1),
        (9.80665, 0.3),
        (9.80665, 2.0),
        (1000.0, 0.1),
    ],
)
def test_a_substep_has_a_single_root_and_finds_it(fmu: Fmu, g: float, duration: float, gamma: float) -> None:
    start = {"gamma": gamma, "g": g, "phi_start": 1.0, "w_start": 0.5, "tau": 0.7, "solver.stepSize": 5.0}
    with fmu.running(start | IMPLICIT) as instance:
        assert instance.step(0.0, duration) == OK
        found_phi, found_w, nfev = instance.get("phi", "w", "solver.nfev")
    with mp.workdps(40):
        phi, w, phi_error, w_error = mpf(1.0), mpf(0.5), mpf(0), mpf(0)
        n = fewest_substeps(duration, 5.0, gamma, g)
        h = mpf(duration) / n
        s = abs(strength(h, gamma, g))
        for _ in range(n):
            new_phi, new_w, slope = exact_substep(phi, w, h, gamma, g, 0.7)
            # The roundings of v (5), of c (2) and of s*sin(x) (8), half a unit each, and the errors brought along;
            # the root passes them on through the slope, and is off by a unit of its own. h, 1 + h*k2 and kick
            # are rounded in both, so what they move is counted with the products. The rate is v - kick*sin(x).
            v = (w + h * mpf(0.7)) / (1 + h * gamma)
            v_error = (w_error + 3 * EPS * (abs(w) + h)) / (1 + h * gamma)
            c_error = phi_error + h * v_error + EPS * (abs(phi) + 2 * abs(h * v))
            phi_error = (c_error + 4 * EPS * s) / slope + EPS * abs(new_phi)
            w_error = v_error + s / h * (phi_error + 4 * EPS) + EPS * (abs(v) + abs(new_w))
            phi, w = new_phi, new_w
        assert abs(found_phi - phi) <= phi_error
        assert abs(found_w - w) <= w_error
        # A substep fewer or more, or another root, is far off: the bound tells them apart.
        assert phi_error < 1e-8
    assert nfev >= 2 * n  # Newton evaluates at least twice where it has to move


@pytest.mark.parametrize("g", [0.0, -0.0])
@pytest.mark.parametrize("start", [{}, {"gamma": 0.0}, {"gamma": 3.0, "tau": 0.7, "w_start": 2.0}], ids=str)
def test_without_gravity_a_substep_is_one_evaluation(fmu: Fmu, start: dict[str, float], g: float) -> None:
    with fmu.running(start | IMPLICIT | {"g": g, "solver.stepSize": 0.01}) as instance:
        for k in range(3):
            assert instance.step(0.07 * k, 0.07) == OK
            assert instance.get("solver.nfev") == ((k + 1) * 7,)


def test_gravity_too_weak_for_a_double_is_one_evaluation_too(fmu: Fmu) -> None:
    with fmu.running(
        IMPLICIT | {"g": 1.0, "solver.stepSize": 1e-170}
    ) as instance:  # s = h^2*w02 is 0 in doubles
        assert instance.step(0.0, 2.5e-170) == OK
        assert instance.get("solver.nfev") == (3,)


def newton_evaluations(s: mpf, c: mpf) -> int | None:
    """Return how often Newton's method from x = c evaluates the residual, None where that is a matter of rounding.

    It ends once the error that a step leaves, |s|*correction^2/(2*slope) by Taylor, is below an eighth of eps*|x|:
    a quarter of the last place, whose spacing is eps*|x|/2 at least.
    """
    x = c
    for evaluations in count(1):
        slope = 1 + s * mp.cos(x)
        correction = (x - c + s * mp.sin(x)) / slope
        x -= correction
        left = abs(s) * correction**2 / (2 * slope) / abs(x)
        # The residual is rounded by a few eps*|s|, so a correction near sqrt(eps) by a relative 1e-7.
        if abs(left / (EPS / 8) - 1) < 1e-5:
            return None
        if left < EPS / 8:
            return evaluations
    raise AssertionError


@pytest.mark.parametrize(("h", "gamma"), [(0.05, 0.0), (0.15, 0.5), (0.25, 0.0)])
def test_newton_takes_the_evaluations_that_it_takes_without_rounding(
    fmu: Fmu, h: float, gamma: float
) -> None:
    start = IMPLICIT | {"gamma": gamma, "solver.stepSize": h}
    judged = 0
    with fmu.instance() as instance, mp.workdps(40):
        s = strength(mpf(h), gamma, 9.80665)
        for k in range(1, 301):
            expected = newton_evaluations(s, mpf(0.01 * k))  # at rest without torque c is the angle before
            if expected is None:
                continue
            assert instance.initialize(start | {"phi_start": 0.01 * k}) == OK
            assert instance.step(0.0, h) == OK
            assert instance.get("solver.nfev") == (expected,)
            assert instance.reset() == OK
            judged += 1
    assert judged > 290


@pytest.mark.parametrize(
    "method", [m for m in SolverMethod if METHODS[m].tableau], ids=lambda method: method.name
)
@pytest.mark.parametrize("g", [1.0, -1.0])
def test_the_noise_of_a_late_clock_does_not_make_a_substep_too_long_for_its_root(
    fmu: Fmu, method: SolverMethod, g: float
) -> None:
    """At 1e7 s times are rounded to 1e-9 s and more; |s| = (d*h)^2 must stay below 1 all the same."""
    longest = 1.0 / METHODS[method].tableau[-1][-1]
    start = {"gamma": 0.0, "g": g, "phi_start": 0.0, "solver.method": method, "solver.stepSize": 10.0}
    with fmu.running(start, time=1e7) as instance:
        assert instance.step(1e7, longest) == OK
        assert instance.get("phi", "w") == (0.0, 0.0)
        # One evaluation for each stage at rest; two substeps have twice as many, an explicit stage counts once.
        implicit = sum(row[-1] != 0.0 for row in METHODS[method].tableau)
        assert instance.get("solver.nfev")[0] >= 2 * implicit
