"""The native FMU gives the bits of the Python kernel."""

import struct
from collections.abc import Callable
from math import inf, isfinite, nan, pi
from pathlib import Path

import fmpy
import mpmath
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from damped_pendulum.model import Pendulum
from methods.solvers import SolverMethod
from tests.driver import OK, Instance
from tests.plants import PENDULUM
from tests.twin import Twin

CHECKS = [HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
H = 0.01
UNIT = {"m": 1.0, "L": 1.0, "gamma": 0.0, "g": 9.80665, "phi_start": 0.5, "w_start": 0.0}


def stepped(twin: Twin, t: float, duration: float) -> Twin | None:
    """Return the twin after a communication step, None if it diverges."""
    after = twin.save()
    try:
        after.step(t, duration)
    except ValueError:  # math.sin(inf)
        return None
    after.x, after.v = after.x + 0.0, after.v + 0.0
    return after if isfinite(after.x) and isfinite(after.v) else None


@settings(suppress_health_check=CHECKS, max_examples=300)
@given(
    start=st.fixed_dictionaries(
        {
            "m": st.floats(1e-3, 1e3),
            "L": st.floats(1e-2, 1e2),
            "gamma": st.one_of(st.just(0.0), st.floats(0, 1), st.floats(0, 1e4)),
            "g": st.sampled_from([0.0, 9.80665, -1.62, 1e4]),
            "phi_start": st.one_of(st.floats(-4, 4), st.floats(-1e6, 1e6)),
            "w_start": st.one_of(st.floats(-5, 5), st.floats(-1e200, 1e200)),
            "solver.method": st.sampled_from(SolverMethod),
            "solver.stepSize": st.floats(1e-4, 0.05),
        }
    ),
    torques=st.lists(
        st.one_of(st.just(0.0), st.floats(-10, 10), st.floats(-1e300, 1e300)), min_size=1, max_size=4
    ),
    duration=st.floats(1e-3, 0.05),
)
@example(  # 3 substeps that are as long as they may be
    start=UNIT | {"solver.method": SolverMethod.ImplicitEuler, "solver.stepSize": 1.0},
    torques=[0.0],
    duration=3 * Pendulum(1.0, 1.0, 0.0, 9.80665).motion().longest_implicit_stage(),
)
@example(  # diverges
    start=UNIT
    | {"gamma": 1e4, "g": 9.8, "solver.method": SolverMethod.ExplicitEuler, "solver.stepSize": 0.05},
    torques=[0.0] * 4,
    duration=1.0,
)
def test_every_method_gives_the_bits_of_the_python_kernel(
    shared: Instance, start: dict[str, float], torques: list[float], duration: float
) -> None:
    shared.start(start)
    twin = Twin(PENDULUM, start)
    for i, tau in enumerate(torques):
        assert shared.set("tau", tau) == OK
        twin.input = tau
        status = shared.step(i * duration, duration)
        after = stepped(twin, i * duration, duration)
        if after is None:
            assert shared.refusal(status).startswith("pendulum: diverged at t = ")
        else:
            assert status == OK
            twin = after
        for name, value in zip(PENDULUM.calculated, twin.calculated, strict=True):
            if isfinite(value):
                assert shared.get(name) == (value,)
            else:
                assert name in ("a", "E")
                assert "is out of the range of a double" in shared.unreadable(name)


ZEROS = (0.0, -0.0, 5e-324, -5e-324, 1e-300, -1e-300)


def packed(*values: float) -> bytes:
    """Return the bits, in which 0.0 and -0.0 differ."""
    return struct.pack(f"{len(values)}d", *values)


@settings(suppress_health_check=CHECKS, max_examples=1000)
@given(
    gamma=st.sampled_from([0.0, 0.3, 1e-300]),
    g=st.sampled_from([0.0, -0.0, 9.8, -9.8, 1e-300, 1e4]),
    phi=st.sampled_from([*ZEROS, pi, -pi, 1.0, -1.0, 1e6]),
    w=st.sampled_from([*ZEROS, 1.0, -1.0, 1e200, -1e200]),
    tau=st.sampled_from([*ZEROS, 1.0, -1.0, 1e200, -1e200]),
    method=st.sampled_from(SolverMethod),
)
@example(0.0, 0.0, 0.0, -0.0, -0.0, SolverMethod.ExplicitEuler)
@example(0.0, -9.8, -0.0, -0.0, -0.0, SolverMethod.ImplicitEuler)
def test_zeros_have_the_sign_of_those_of_the_python_kernel(
    shared: Instance, gamma: float, g: float, phi: float, w: float, tau: float, method: SolverMethod
) -> None:
    start = {"gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau}
    start |= {"solver.method": method, "solver.stepSize": H}
    shared.start(start)
    twin = Twin(PENDULUM, start)
    for i in range(3):
        _, _, a, energy, _ = twin.calculated
        for name, value in (("a", a + 0.0), ("E", energy)):
            if isfinite(value):
                assert packed(*shared.get(name)) == packed(value)
        status = shared.step(i * H, H)
        after = stepped(twin, i * H, H)
        if after is None:
            assert "diverged" in shared.refusal(status)
            return
        assert status == OK
        twin = after
        assert packed(*shared.get("phi", "w")) == packed(twin.x, twin.v)


def value_in_python(compute: Callable[[], float]) -> float:
    """Return a value, NaN where it cannot be computed."""
    try:
        return compute()
    except (ValueError, ZeroDivisionError):  # math.sin(inf), a mass of zero
        return nan


@settings(suppress_health_check=CHECKS, max_examples=1000)
@given(*[st.one_of(st.floats(), st.floats(-10, 10))] * 7)
@example(1e300, 1e-100, 0.0, 1e50, 1.0, 0.0, 0.0)  # E = 4.5969769413186036e+249, while m*g is infinite
@example(1e-300, 1e-11, 0.0, 0.0, 0.0, 0.0, 9.88e-323)  # a = 0.9881312916824931, while J has two bits
@example(1.0, 1.0, 0.0, 0.0, inf, 1.0, 0.0)  # nothing acts
@example(1.0, 1.0, 0.0, 0.0, 1.0, nan, 0.0)
@example(0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0)
@example(-1.0, 0.5, 0.1, 9.8, 1.0, 1.0, -0.0)
def test_a_and_e_are_the_bits_of_python_or_refused_whatever_is_set(
    shared: Instance, m: float, L: float, gamma: float, g: float, phi: float, w: float, tau: float
) -> None:
    assert shared.reset() == OK
    values = {"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau}
    for name, value in values.items():
        assert shared.set(name, value) == OK
    pendulum = Pendulum(m, L, gamma, g)
    for name, value in (
        ("a", value_in_python(lambda: pendulum.motion(tau).acceleration()(phi, w) + 0.0)),
        ("E", value_in_python(lambda: pendulum.energy(phi, w))),
    ):
        if isfinite(value):
            assert packed(*shared.get(name)) == packed(value)
        else:
            assert f"{name} is out of the range" in shared.unreadable(name)


def test_numbers_keep_their_digits_where_products_of_parameters_leave_the_range(instance: Instance) -> None:
    instance.start({"m": 1e300, "g": 1e50, "L": 1e-100, "phi_start": 1.0})
    assert instance.get("E") == (4.5969769413186036e249,)
    # m*g*L*sin(phi)
    assert instance.partial("E", "phi") == pytest.approx(float(mpmath.sin(1)) * 1e250, rel=1e-15, abs=0)
    instance.start({"m": 1e-300, "L": 1e-11, "gamma": 0.0, "g": 0.0, "tau": 9.88e-323})
    assert instance.get("a") == (0.9881312916824931,)
    assert instance.input_derivatives({1: 9.88e-323}) == OK
    assert instance.output_derivative("a") == 0.9881312916824931
    instance.start({"m": 1e300, "L": 1e-200, "g": 0.0, "gamma": 0.0, "w_start": 1e60, "tau": 1e-90})
    # der(E) = tau*w, der(J*w^2/2)/der(w) = J*w
    assert instance.output_derivative("E") == pytest.approx(1e-30, rel=1e-15, abs=0)
    assert instance.partial("E", "w") == pytest.approx(1e-40, rel=1e-15, abs=0)


def test_the_default_experiment_gives_the_bits_of_the_fmu_with_python(
    native_path: Path, fmu_path: Path
) -> None:
    runs = [fmpy.simulate_fmu(str(path), output=PENDULUM.calculated) for path in (native_path, fmu_path)]
    assert (runs[0] == runs[1]).all()
    assert len(runs[0]) == 1001
