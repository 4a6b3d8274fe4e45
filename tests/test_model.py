import dis
from math import inf, isinf, ldexp, pi
from operator import neg
from sys import float_info

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from mpmath import mp, mpf

from damped_pendulum.model import Motion, Pendulum
from methods.explicit import explicit_runge_kutta4
from methods.inline import inlined
from methods.motion import Solver
from methods.solvers import METHODS, SolverMethod

angles = st.floats(-2 * pi, 2 * pi)
rates = st.floats(-10, 10)
# Scaling by a power of two is exact above the subnormal numbers only.
dampings = st.just(0.0) | st.floats(1e-100, 10)
torques = dampings.map(lambda size: 2.0 * size) | dampings.map(lambda size: -2.0 * size)
methods = st.sampled_from(SolverMethod)


def loaded(solver: Solver) -> set[str]:
    """Return the local variables that a solver reads."""
    instructions = (i for i in dis.get_instructions(solver) if i.opname.startswith("LOAD_FAST"))
    return {name for i in instructions for name in (i.argval if isinstance(i.argval, tuple) else (i.argval,))}


@given(method=methods, terms=st.tuples(*[st.sampled_from([0.0, 0.7, 3.0])] * 3), phi=angles, w=rates)
def test_terms_that_do_not_act_are_left_out_and_change_nothing(
    method: SolverMethod, terms: tuple[float, float, float], phi: float, w: float
) -> None:
    motion, solver = Motion(*terms), METHODS[method].solver
    fast = inlined(solver, motion)
    rewritten = (
        SolverMethod.ExplicitEuler,
        SolverMethod.ExplicitMidPoint2,
        SolverMethod.ExplicitRungeKutta4,
    )
    assert (fast is solver) == (method not in rewritten)
    if fast is not solver:
        for name, value in zip(("drag", "gravity", "drive"), terms, strict=True):
            assert (f"{name}_of_model" in loaded(fast)) == (value != 0)
    assert fast(motion, phi, w, 0.01, 20) == solver(motion, phi, w, 0.01, 20)


@given(phi=angles, w=rates, damping_rate=dampings)
def test_energy_never_grows(phi: float, w: float, damping_rate: float) -> None:
    pendulum = Pendulum(1.0, 1.0, damping_rate, 9.80665)
    h, n = 1e-3, 50
    fastest = 3.2 + abs(w) + n * h * 9.81
    # RK4 conserves an energy that differs from E by a relative (h*w)^4, and rounds the state once a substep.
    ripple = ((h * fastest) ** 4 + 4e-16 * n) * (pendulum.energy(pi, 0.0) + pendulum.energy(phi, w))
    before = pendulum.energy(phi, w)
    for _ in range(5):
        phi, w, _ = explicit_runge_kutta4(pendulum.motion(), phi, w, h, n)
        after = pendulum.energy(phi, w)
        assert after <= before + ripple
        before = after


@given(method=methods, phi=angles, w=rates, damping_rate=dampings, drive=torques)
def test_the_mirror_image_moves_as_the_mirror_image(
    method: SolverMethod, phi: float, w: float, damping_rate: float, drive: float
) -> None:
    solver = METHODS[method].solver
    moved = solver(Motion(damping_rate, 9.80665, drive), phi, w, 0.01, 20)
    mirrored = solver(Motion(damping_rate, 9.80665, -drive), -phi, -w, 0.01, 20)
    assert mirrored == (-moved[0], -moved[1], moved[2])


@given(method=methods, phi=angles, m=st.floats(1e-6, 1e6))
def test_the_mass_does_not_matter_without_drag_and_torque(method: SolverMethod, phi: float, m: float) -> None:
    solver = METHODS[method].solver
    light, heavy = (Pendulum(mass, 0.7, 0.0, 9.81).motion() for mass in (1.0, m))
    assert solver(light, phi, 0.0, 0.01, 20) == solver(heavy, phi, 0.0, 0.01, 20)


@given(method=methods, phi=angles, gamma=dampings, tau=torques, power=st.integers(-20, 20))
def test_drag_and_torque_count_per_mass(
    method: SolverMethod, phi: float, gamma: float, tau: float, power: int
) -> None:
    solver = METHODS[method].solver
    m = 2.0**power  # scaling by it is exact
    light = Pendulum(1.0, 0.7, gamma, 9.81).motion(tau)
    heavy = Pendulum(m, 0.7, gamma * m, 9.81).motion(tau * m)
    assert solver(light, phi, 0.0, 0.01, 20) == solver(heavy, phi, 0.0, 0.01, 20)


def test_energy_keeps_its_digits_at_small_angles() -> None:
    # 2*w02*sin(phi/2)^2 = w02*phi^2/2*(1 - phi^2/12), whose second term is far below rounding.
    assert Pendulum(1.0, 1.0, 0.0, 9.80665).energy(1e-8, 0.0) == pytest.approx(
        9.80665 / 2 * 1e-16, rel=1e-15, abs=0
    )


EPS, TINY, HUGE = mpf(float_info.epsilon), mpf(5e-324), mpf(float_info.max)
sizes = st.builds(ldexp, st.floats(1.0, 2.0, exclude_max=True), st.integers(-1074, 1023)).filter(bool)
signed = sizes | sizes.map(neg) | st.just(0.0)


def is_rounded(found: float, exact: mpf, bound: mpf) -> bool:
    """Return whether `found` is `exact` to within `bound`, or infinite where that is beyond the range of a double."""
    if isinf(found):
        return bool(abs(exact) + bound > HUGE) and (found > 0) == (exact > 0)
    return bool(abs(found - exact) <= bound)


@given(m=sizes, L=sizes, tau=signed)
@example(m=1e-300, L=1e-11, tau=9.88e-323)
@example(m=1e300, L=1e200, tau=1e300)
def test_the_drive_keeps_its_digits_whatever_the_inertia(m: float, L: float, tau: float) -> None:
    pendulum = Pendulum(m, L, 0.0, 0.0)
    with mp.workdps(60):
        J = mpf(m) * mpf(L) ** 2
        # Two products and a quotient, half a unit each, and the last place of a subnormal number.
        assert is_rounded(pendulum.J, J, EPS * J * (1 + EPS) + TINY)
        drive = mpf(tau) / J
        assert is_rounded(pendulum.motion(tau).drive, drive, 1.5 * EPS * abs(drive) * (1 + 2 * EPS) + TINY)


@given(m=sizes, L=sizes, g=signed, phi=signed, w=signed)
@example(m=1e300, L=1e-100, g=1e50, phi=1.0, w=0.0)
@example(m=1e-300, L=1e-11, g=0.0, phi=0.0, w=1e11)
@example(m=1e300, L=1.0, g=-9.81, phi=1e-170, w=0.0)
def test_the_energy_keeps_its_digits_whatever_its_factors(
    m: float, L: float, g: float, phi: float, w: float
) -> None:
    with mp.workdps(60):
        kinetic = mpf(m) * mpf(L) ** 2 * mpf(w) ** 2 / 2
        # Halving a subnormal angle can lose its last bit, which is the energy of an angle that is no double.
        potential = 2 * mpf(m) * mpf(g) * mpf(L) * mp.sin(mpf(phi / 2)) ** 2
        size = kinetic + abs(potential)
        # Half a unit for each product, one for the sine, which counts twice, and half a unit for the sum.
        bound = 4.5 * EPS * size * (1 + 10 * EPS) + TINY
        assert is_rounded(Pendulum(m, L, 0.0, g).energy(phi, w), kinetic + potential, bound)


def test_energy_of_the_upright_position() -> None:
    assert Pendulum(2.0, 3.0, 0.0, 10.0).energy(pi, 0.0) == pytest.approx(2 * 2 * 10 * 3, rel=1e-15, abs=0)
    assert Pendulum(2.0, 3.0, 0.0, 10.0).energy(0.0, 0.5) == 0.5 * 2 * 9 * 0.25


@pytest.mark.parametrize(
    ("pendulum", "problem"),
    [
        (Pendulum(1.0, 1e-200, 0.0, 1.0), "J = m*L^2 = 0.0 kg.m2"),
        (Pendulum(1e300, 1e200, 0.0, 1.0), "J = m*L^2 = inf kg.m2"),
        (Pendulum(1e-300, 1.0, 1e300, 1.0), "gamma/m = inf 1/s"),
        (Pendulum(1.0, 1e-150, 0.0, 1e300), "g/L = inf 1/s2"),
    ],
)
def test_combinations_beyond_the_range_of_a_double_are_named(pendulum: Pendulum, problem: str) -> None:
    assert pendulum.out_of_range() == [f"{problem} is out of the range of a double"]
    assert Pendulum(1.0, 1.0, 0.0, -inf).out_of_range() == ["g/L = -inf 1/s2 is out of the range of a double"]
