"""A run that leaves the range of a double ends in an error; a step size that leads there is warned of."""

from __future__ import annotations

import re
from math import inf, isfinite, nextafter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from methods.solvers import SolverMethod, stability_limit
from tests.driver import OK, WARNING, Fmu, Instance, is_error

EXPLICIT = (SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2, SolverMethod.ExplicitRungeKutta4)
REAL_LIMIT = {1: 2.0, 2: 2.0, 3: 2.785293563405282}  # |R(-x)| = 1; Hairer & Wanner II, section IV.2

STIFF = {
    "m = 1e-12": {"m": 1e-12, "gamma": 1e-3},
    "m = 1e-12, g = 0": {"m": 1e-12, "gamma": 1e-3, "g": 0.0, "w_start": 1.0},  # no sine is evaluated
    "gamma = 1e9": {"gamma": 1e9},
    "gamma = 1e9, g = 0": {"gamma": 1e9, "g": 0.0, "w_start": 1.0},
    "gamma = 1e4": {"gamma": 1e4},
    "long rod": {"gamma": 1e4, "L": 1e3, "w_start": 1e100},
}


def finite_or_refused(instance: Instance) -> bool:
    """Return whether each output is finite or cannot be read."""
    for name in ("phi", "w", "a", "E"):
        status, (value,) = instance.get_references("Real", [instance.fmu.reference[name]])
        if not (is_error(status) or isfinite(value)):
            return False
    return True


@pytest.mark.parametrize("start", STIFF.values(), ids=STIFF)
@pytest.mark.parametrize("method", EXPLICIT, ids=lambda method: method.name)
def test_an_unstable_run_ends_in_an_error_that_says_where_and_why(
    fmu: Fmu, method: SolverMethod, start: dict[str, float]
) -> None:
    h, rate = 1e-3, start["gamma"] / start.get("m", 1.0)
    with fmu.running(start | {"solver.method": method, "solver.stepSize": h}) as instance:
        time, before = 0.0, instance.get("phi", "w")
        # h*rate >= 10, so every substep multiplies the fast part by |R(-10)| >= 9, and 9^1000 > 1.8e308.
        for k in range(1000):
            time = 0.01 * k
            status = instance.step(time, 0.01)
            assert finite_or_refused(instance)
            if is_error(status):
                break
            before = instance.get("phi", "w")
        assert is_error(status)
        assert instance.get("phi", "w") == before
        message = next(text for text in instance.errors if "diverged" in text)
    found = re.fullmatch(
        r"pendulum: diverged at t = (\S+) s: substep (\d+) of (\S+) s with (\w+) left the range of a double; "
        r"the stability limit of (\w+) for this pendulum is (\S+) s: "
        r"use solver.stepSize = (\S+) s or less, or ImplicitEuler",
        message,
    )
    assert found is not None, message
    at, substep, length, limit, stable = (float(found[i]) for i in (1, 2, 3, 6, 7))
    assert found[4] == found[5] == method.name
    assert length == pytest.approx(h, rel=1e-15, abs=0)
    assert 1 <= substep <= 10
    assert at == pytest.approx(time + substep * h, rel=1e-15, abs=0)
    # With w02 << rate^2 the fast eigenvalue is the damping rate: relative error w02/rate^2 <= 1e-7.
    assert limit == pytest.approx(REAL_LIMIT[method] / rate, rel=1e-5, abs=0)  # six digits are printed
    assert limit * 0.9998 < stable < limit


@pytest.mark.parametrize("start", STIFF.values(), ids=STIFF)
def test_the_implicit_method_survives_them_all(fmu: Fmu, start: dict[str, float]) -> None:
    with fmu.running(start | {"solver.method": SolverMethod.ImplicitEuler}) as instance:
        instance.run([0.01 * k for k in range(100)])
        assert all(map(isfinite, instance.get("phi", "w")))
        assert not instance.warnings


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_a_torque_too_large_for_a_double_is_an_error(fmu: Fmu, method: SolverMethod, gravity: float) -> None:
    start = {
        "m": 1e-12,
        "gamma": 0.0,
        "g": gravity,
        "tau": 1e300,
        "solver.method": method,
        "solver.stepSize": 1e-4,
    }
    with fmu.running(start) as instance:
        before = instance.get("phi", "w")
        assert is_error(instance.step(0.0, 0.01))
        assert "diverged at t = " in instance.errors[0]
        assert instance.get("phi", "w") == before


def test_a_rate_that_overflows_in_the_last_substep_is_an_error(fmu: Fmu) -> None:
    start = {
        "g": 0.0,
        "gamma": 0.0,
        "tau": 1e308,
        "solver.method": SolverMethod.ExplicitEuler,
        "solver.stepSize": 10.0,
    }
    with fmu.running(start) as instance:
        assert is_error(instance.step(0.0, 10.0))  # the angle still advances with the old rate, 0
        assert instance.get("w") == (0.0,)


def test_within_the_stability_limit_the_error_points_to_torque_and_start(fmu: Fmu) -> None:
    with fmu.running({"w_start": 1.7e308, "g": 0.0, "gamma": 0.0, "solver.stepSize": 1.0}) as instance:
        assert is_error(instance.step(0.0, 10.0))
        assert "is within the stability limit" in instance.errors[0]
        assert "check the torque and the start values" in instance.errors[0]


positive = st.floats(-12.0, 12.0).map(lambda exponent: 10.0**exponent)


@given(
    method=st.sampled_from(EXPLICIT),
    m=positive,
    L=positive,
    gamma=positive | st.just(0.0),
    g=st.just(0.0) | st.floats(-1e12, 1e12),
    w=st.floats(-1e160, 1e160),
    tau=st.just(0.0) | st.floats(allow_nan=False, allow_infinity=False),
    h=positive,
)
def test_no_call_is_ok_with_a_value_that_is_not_finite(
    fmu: Fmu, method: SolverMethod, m: float, L: float, gamma: float, g: float, w: float, tau: float, h: float
) -> None:
    start = {"m": m, "L": L, "gamma": gamma, "g": g, "w_start": w, "tau": tau, "solver.method": method}
    with fmu.running(start | {"solver.stepSize": h}) as instance:
        for k in range(3):
            status = instance.step(7.0 * h * k, 7.0 * h)
            assert finite_or_refused(instance)
            assert status == OK or is_error(status)


LIMITED = {
    "undamped RK4": (SolverMethod.ExplicitRungeKutta4, {"gamma": 0.0}),
    "default RK4": (SolverMethod.ExplicitRungeKutta4, {}),
    "default midpoint": (SolverMethod.ExplicitMidPoint2, {"gamma": 0.1}),
    "default Euler": (SolverMethod.ExplicitEuler, {}),
    "stiff RK4": (SolverMethod.ExplicitRungeKutta4, {"m": 1e-12, "gamma": 1e-3}),
    "stiff midpoint": (SolverMethod.ExplicitMidPoint2, {"gamma": 1e9}),
    "stiff Euler": (SolverMethod.ExplicitEuler, {"gamma": 1e9, "g": 0.0}),
    "upside down": (SolverMethod.ExplicitRungeKutta4, {"g": -9.81}),
}


@pytest.mark.parametrize(("method", "start"), LIMITED.values(), ids=LIMITED)
@pytest.mark.parametrize("factor", [1.0001, 1.5, 1e3])
def test_an_unstable_step_size_is_warned_of_with_one_that_is_not(
    fmu: Fmu, method: SolverMethod, start: dict[str, float], factor: float
) -> None:
    m, gamma, g = start.get("m", 1.0), start.get("gamma", 0.002), start.get("g", 9.80665)
    limit = stability_limit(method, gamma / m, g)
    with fmu.instance() as instance:
        assert (
            instance.initialize(start | {"solver.method": method, "solver.stepSize": factor * limit})
            <= WARNING
        )
        (warning,) = instance.warnings
    assert warning.category == "logStatusWarning"
    assert warning.category in declared_categories(fmu)
    assert warning.text.startswith(f"solver.stepSize = {factor * limit!r} s is unstable: ")
    found = re.search(r"use solver.stepSize = (\S+) s or less", warning.text)
    assert found is not None, warning.text
    stable = float(found[1])
    assert 0.9998 * limit < stable <= limit
    with fmu.running(start | {"solver.method": method, "solver.stepSize": stable}) as instance:
        assert not instance.warnings


# Limits that are free of rounding but that of the last operation, for m = 1 kg and L = 1 m.
EXACT_LIMITS = {
    # At k2 = 2*w0 both eigenvalues are -w0.
    "critical Euler": (1, 4.0, 4.0, REAL_LIMIT[1] / 2.0),
    "critical midpoint": (2, 4.0, 4.0, REAL_LIMIT[2] / 2.0),
    "critical RK4": (3, 4.0, 4.0, REAL_LIMIT[3] / 2.0),
    # Without gravity they are 0 and -k2.
    "Euler in space": (1, 0.0, 4.0, REAL_LIMIT[1] / 4.0),
    "midpoint in space": (2, 0.0, 4.0, REAL_LIMIT[2] / 4.0),
    "RK4 in space": (3, 0.0, 4.0, REAL_LIMIT[3] / 4.0),
    # |1 + h*lambda|^2 = 1 - h*k2 + h^2*w02 for a complex pair.
    "damped Euler": (1, 4.0, 0.5, 0.5 / 4.0),
}


@pytest.mark.parametrize(("method", "g", "gamma", "limit"), EXACT_LIMITS.values(), ids=EXACT_LIMITS)
def test_the_warning_begins_above_the_limit(
    fmu: Fmu, method: int, g: float, gamma: float, limit: float
) -> None:
    for h, warned in ((nextafter(limit, 0.0), False), (limit, False), (nextafter(limit, inf), True)):
        start = {"g": g, "gamma": gamma, "solver.method": method, "solver.stepSize": h}
        with fmu.instance() as instance:
            status = instance.initialize(start)
            assert not is_error(status)
            assert len(instance.warnings) == warned


@given(rate=positive, w02=positive, method=st.sampled_from(EXPLICIT))
def test_the_step_size_of_the_warning_is_never_warned_of(
    fmu: Fmu, rate: float, w02: float, method: SolverMethod
) -> None:
    start = {"gamma": rate, "g": w02, "solver.method": method}
    with fmu.running(start | {"solver.stepSize": 1e30}) as instance:
        (warning,) = instance.warnings
    found = re.search(r"use solver.stepSize = (\S+) s or less", warning.text)
    assert found is not None, warning.text
    with fmu.running(start | {"solver.stepSize": float(found[1])}) as instance:
        assert not instance.warnings


@pytest.mark.parametrize("method", [SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2])
def test_a_method_without_a_stable_step_size_is_warned_of_with_one_that_has(
    fmu: Fmu, method: SolverMethod
) -> None:
    with fmu.running({"gamma": 0.0, "solver.method": method}) as instance:
        (warning,) = instance.warnings
    assert "has no stable step size for this pendulum" in warning.text
    assert warning.text.endswith("use ExplicitRungeKutta4 or ImplicitEuler")


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
def test_a_stable_step_size_is_not_warned_of(fmu: Fmu, method: SolverMethod) -> None:
    limit = stability_limit(method, 0.2, 9.80665)
    h = 10.0 if limit == inf else 0.999 * limit
    with fmu.running({"gamma": 0.2, "solver.method": method, "solver.stepSize": h}) as instance:
        assert not instance.warnings


def declared_categories(fmu: Fmu) -> set[str]:
    return set(
        re.findall(r'<Category name="(\w+)"', (fmu.folder / "modelDescription.xml").read_text("utf-8"))
    )
