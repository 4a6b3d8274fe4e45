"""Where a double ends for the pendulum: its parameters, inertia and energy."""

from __future__ import annotations

from fractions import Fraction
from operator import neg
from sys import float_info

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import mpf

from methods.solvers import METHODS, SolverMethod
from tests.driver import OK, WARNING, Fmu, is_error
from tests.plants import PENDULUM
from tests.test_pendulum_outputs import ENERGY_BOUND, exact_energy
from tests.twin import Twin

EPS = float_info.epsilon
TINY, HUGE = 5e-324, float_info.max


@pytest.mark.parametrize("start", [{"g": -9.81}, {"m": 1e-300, "gamma": 0.0}, {"L": 1e100}], ids=str)
def test_odd_pendulums_are_accepted(fmu: Fmu, start: dict[str, float]) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(start) == OK
        assert instance.step(0.0, 0.01) == OK


def test_the_shortest_rod_is_refused_for_its_inertia_and_not_for_its_range(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.initialize({"L": TINY, "m": HUGE, "g": 0.0}))
        assert "J = m*L^2 = 0.0 kg.m2 is out of the range" in instance.errors[0]
        assert "allowed" not in instance.errors[0]
    with fmu.instance() as instance:
        assert instance.initialize({"L": 1e-150, "m": 1e10}) <= WARNING, instance.errors


@pytest.mark.parametrize("method", [m for m in SolverMethod if not METHODS[m].tableau], ids=lambda m: m.name)
@pytest.mark.parametrize("g", [9.80665, 0.0])
def test_a_run_that_diverges_ends_there_and_not_after_all_its_substeps(
    fmu: Fmu, method: SolverMethod, g: float
) -> None:
    start = {"g": g, "w_start": 1.0, "gamma": 1e9, "solver.method": method, "solver.stepSize": 1e-6}
    with fmu.running(start) as instance:
        assert is_error(instance.step(0.0, 2000.0))  # two thousand million substeps would take hours


def test_the_longest_substep_of_the_implicit_method_counts(fmu: Fmu) -> None:
    start = {"solver.method": SolverMethod.ImplicitEuler, "solver.stepSize": 10.0}
    longest = Twin(PENDULUM, start).max_step
    assert 0.3 < longest < 0.4  # 1/w0, where the equation of a substep gets a second root
    with fmu.running(start) as instance:
        assert is_error(instance.step(1e15, 1.0))
        assert f"is more than the longest substep ({longest!r} s)" in instance.errors[0]


sizes = st.floats(TINY, HUGE) | st.floats(-300.0, 300.0).map(lambda power: 10.0**power)
signed = sizes | sizes.map(neg) | st.just(0.0)
angles = signed.filter(lambda phi: phi / 2 * 2 == phi)  # half of a subnormal angle can be rounded


def read(fmu: Fmu, name: str, values: dict[str, float]) -> float | None:
    """Return an output of an instance that is not initialized yet, None if it is refused as out of range."""
    with fmu.instance() as instance:
        for variable, value in values.items():
            assert instance.set(variable, value) == OK
        status, (found,) = instance.get_references("Real", [fmu.reference[name]])
        assert is_error(status) == (f"{name} is out of the range of a double" in str(instance.errors))
        return None if is_error(status) else found


def agrees(found: float | None, exact: mpf, bound: mpf) -> bool:
    """Return whether `found` is `exact` to within `bound`, or missing where `exact` leaves the range of a double."""
    if found is None:
        return bool(abs(exact) + bound > HUGE)
    return bool(abs(found - exact) <= bound)


ENERGIES = {
    "m*g overflows": {"m": 1e300, "g": 1e50, "L": 1e-100, "phi_start": 1.0},
    "m*g underflows": {"m": 1e-200, "g": 1e-200, "L": 1e200, "phi_start": 2.0},
    "J is subnormal": {"m": 1e-300, "L": 1e-11, "g": 0.0, "gamma": 0.0, "w_start": 1e11},
    "w^2 underflows": {"m": 1e300, "L": 1.0, "g": 0.0, "w_start": 1e-170},
    "phi^2 underflows": {"m": 1e300, "L": 1.0, "g": 9.81, "phi_start": 1e-170},
    "phi^2 underflows, g < 0": {"m": 1e300, "L": 1.0, "g": -9.81, "phi_start": 1e-170},
    "J*w overflows": {"m": 1e10, "L": 1e-160, "g": 0.0, "w_start": 1e300},
    "both": {"m": 1e-300, "L": 1e-11, "g": 1e300, "gamma": 0.0, "phi_start": 1e-139, "w_start": 1e11},
}


@pytest.mark.parametrize("start", ENERGIES.values(), ids=ENERGIES)
def test_the_energy_keeps_its_digits_where_a_product_of_its_factors_does_not(
    fmu: Fmu, start: dict[str, float]
) -> None:
    values = {"phi_start": 0.0, "w_start": 0.0} | start
    exact, size = exact_energy(*(values[name] for name in ("m", "L", "g", "phi_start", "w_start")))
    assert size > float_info.min
    found = read(fmu, "E", values)
    assert found is not None
    assert abs(found - exact) <= ENERGY_BOUND * size


@given(m=sizes, L=sizes, g=signed, phi=angles, w=signed)
def test_the_energy_is_that_of_the_formula_wherever_it_is_a_double(
    fmu: Fmu, m: float, L: float, g: float, phi: float, w: float
) -> None:
    found = read(fmu, "E", {"m": m, "L": L, "g": g, "phi_start": phi, "w_start": w})
    exact, size = exact_energy(m, L, g, phi, w)
    assert agrees(found, exact, ENERGY_BOUND * size + TINY)


@given(m=sizes, L=sizes, tau=signed)
@example(m=1e-300, L=1e-11, tau=9.88e-323)
@example(m=1e-300, L=1e-11, tau=-9.88e-323)
@example(m=1e-200, L=1e-100, tau=1e-320)
@example(m=1e300, L=1e100, tau=1e300)
def test_the_acceleration_keeps_its_digits_whatever_the_inertia(
    fmu: Fmu, m: float, L: float, tau: float
) -> None:
    found = read(fmu, "a", {"m": m, "L": L, "gamma": 0.0, "g": 0.0, "tau": tau})
    drive = Fraction(tau) / (Fraction(m) * Fraction(L) ** 2)
    exact = mpf(drive.numerator) / drive.denominator
    # Two products and a quotient, half a unit each, and the last place of a subnormal number.
    assert agrees(found, exact, 2 * EPS * abs(exact) + TINY)


def test_an_inertia_without_digits_moves_the_pendulum_with_all_of_them(fmu: Fmu) -> None:
    m, L, tau = 1e-300, 1e-11, 9.88e-323
    a = float(Fraction(tau) / (Fraction(m) * Fraction(L) ** 2))
    assert a == pytest.approx(0.988, rel=1e-3, abs=0)
    start = {"m": m, "L": L, "gamma": 0.0, "g": 0.0, "tau": tau, "phi_start": 0.0, "solver.stepSize": 0.25}
    with fmu.running(start) as instance:
        assert instance.step(0.0, 0.25) == OK
        # Under a constant torque alone RK4 is exact, but for a few roundings of a, h*a and the sums.
        assert instance.get("w") == (pytest.approx(0.25 * a, rel=8 * EPS, abs=0),)
        assert instance.get("phi") == (pytest.approx(0.25**2 / 2 * a, rel=8 * EPS, abs=0),)
