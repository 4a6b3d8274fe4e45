"""A run that leaves the range of a double ends in an error; a step size that leads there is warned of."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import count
from math import inf, isfinite, nextafter, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf

from methods.solvers import METHODS, SolverMethod, stability_limit
from tests.driver import OK, WARNING, Fmu, Instance, is_error
from tests.plants import Plant

LIMITED = [method for method in SolverMethod if METHODS[method].real_limit < inf]
UNLIMITED = [method for method in SolverMethod if method not in LIMITED]
Start = Callable[[Plant], dict[str, float]]  # start values of a model

STIFF: dict[str, Start] = {
    "light": lambda p: {p.mass: 1e-12, p.drag: 1e-2, p.v_start: 1.0},
    "light and free": lambda p: p.pull(0.0) | {p.mass: 1e-12, p.drag: 1e-2, p.v_start: 1.0},
    "drag 1e9": lambda p: {p.drag: 1e9, p.v_start: 1.0},
    "drag 1e9 and free": lambda p: p.pull(0.0) | {p.drag: 1e9, p.v_start: 1.0},
    "drag 1e4": lambda p: {p.drag: 1e4, p.v_start: 1.0},
    "fast": lambda p: {p.drag: 1e4, p.v_start: 1e100},
}
each_stiff_start = pytest.mark.parametrize("start_of", STIFF.values(), ids=STIFF)


def real_limit(method: SolverMethod) -> float:
    """Return the x up to which |R(-x)| <= 1, R the polynomial of exp of the degree of the order.

    Such is R of an explicit method with as many stages as its order: Hairer & Wanner II, section IV.2.
    """
    with mp.workdps(40):

        def is_stable(x: mpf) -> bool:
            return abs(sum((-x) ** k / mp.factorial(k) for k in range(METHODS[method].order + 1))) <= 1

        stable = next(mpf(k) / 100 for k in count(1) if not is_stable(mpf(k + 1) / 100))
        unstable = stable + mpf(1) / 100
        for _ in range(mp.prec):
            middle = (stable + unstable) / 2
            stable, unstable = (middle, unstable) if is_stable(middle) else (stable, middle)
        return float(stable)


REAL_LIMIT = {method: real_limit(method) for method in LIMITED}


def finite_or_refused(instance: Instance) -> bool:
    """Return whether each output is finite or cannot be read."""
    plant = instance.fmu.plant
    for name in (*plant.state, plant.a, plant.energy):
        status, (value,) = instance.get_references("Real", [instance.fmu.reference[name]])
        if not (is_error(status) or isfinite(value)):
            return False
    return True


def limit_of(plant: Plant, method: SolverMethod, start: Mapping[str, float]) -> float:
    """Return the largest stable substep [s] of small swings with these start values."""
    values = plant.defaults | dict(start)
    model = plant.slave.model
    motion = model(*(values[name] for name in model._fields)).motion(0.0)
    return stability_limit(method, motion.damping_rate, motion.w02)


@each_stiff_start
@pytest.mark.parametrize("method", LIMITED, ids=lambda method: method.name)
def test_an_unstable_run_ends_in_an_error_that_says_where_and_why(
    fmu: Fmu, method: SolverMethod, start_of: Start
) -> None:
    plant, start = fmu.plant, start_of(fmu.plant)
    h, rate = 1e-3, start[plant.drag] / start.get(plant.mass, plant.defaults[plant.mass])
    with fmu.running(start | {"solver.method": method, "solver.stepSize": h}) as instance:
        time, before = 0.0, instance.get(*plant.state)
        # h*rate >= 10, so every substep multiplies the fast part by |R(-10)| >= 9, and 9^1000 > 1.8e308.
        for k in range(1000):
            time = 0.01 * k
            status = instance.step(time, 0.01)
            assert finite_or_refused(instance)
            if is_error(status):
                break
            before = instance.get(*plant.state)
        assert is_error(status)
        assert instance.get(*plant.state) == before
        message = next(text for text in instance.errors if "diverged" in text)
    found = re.fullmatch(
        rf"{plant.system}: diverged at t = (\S+) s: substep (\d+) of (\S+) s with (\w+) left the range of a double; "
        rf"the stability limit of (\w+) for this {plant.system} is (\S+) s: "
        r"use solver.stepSize = (\S+) s or less, or solver.method = 6 \(TRBDF2\) or 7 \(SDIRK4\)",
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


@each_stiff_start
@pytest.mark.parametrize("method", UNLIMITED, ids=lambda method: method.name)
def test_a_method_without_a_limit_survives_them_all(fmu: Fmu, method: SolverMethod, start_of: Start) -> None:
    # All are A-stable, which is a promise for linear equations; for others only ImplicitEuler makes one (B-stability).
    linear = {} if method is SolverMethod.ImplicitEuler else fmu.plant.plain
    with fmu.running({**linear, **start_of(fmu.plant), "solver.method": method}) as instance:
        instance.run([0.01 * k for k in range(100)])
        assert all(map(isfinite, instance.get(*fmu.plant.state)))
        assert not instance.warnings


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
@pytest.mark.parametrize("w02", [0.0, 9.81])
def test_a_drive_too_large_for_a_double_is_an_error(fmu: Fmu, method: SolverMethod, w02: float) -> None:
    plant = fmu.plant
    start = plant.pull(w02) | {
        plant.mass: 1e-12,
        plant.drag: 0.0,
        plant.input: 1e300,
        "solver.method": method,
        "solver.stepSize": 1e-4,
    }
    with fmu.running(start) as instance:
        before = instance.get(*plant.state)
        assert is_error(instance.step(0.0, 0.01))
        message = instance.errors[0]
        assert instance.get(*plant.state) == before
    assert "diverged at t = " in message
    limit = limit_of(plant, method, start)
    assert (
        f"{method.name} is stable at every step size for small swings of this {plant.system}: " in message
    ) == (limit == inf)
    assert "inf s" not in message


def test_a_rate_that_overflows_in_the_last_substep_is_an_error(fmu: Fmu) -> None:
    plant = fmu.plant
    start = plant.pull(0.0) | {
        plant.drag: 0.0,
        plant.input: 1e308,
        "solver.method": SolverMethod.ExplicitEuler,
        "solver.stepSize": 10.0,
    }
    with fmu.running(start) as instance:
        assert is_error(instance.step(0.0, 10.0))  # x still advances with the old rate, 0
        assert instance.get(plant.v) == (0.0,)


def test_within_the_stability_limit_the_error_points_to_drive_and_start(fmu: Fmu) -> None:
    plant = fmu.plant
    start = plant.pull(1e-6) | {plant.v_start: 1.7e308, plant.drag: 0.0, "solver.stepSize": 1.0}
    with fmu.running(start) as instance:
        assert is_error(instance.step(0.0, 10.0))
        assert "is within the stability limit" in instance.errors[0]
        assert f"check the {plant.quantity} and the start values, or use a smaller" in instance.errors[0]


positive = st.floats(-12.0, 12.0).map(lambda exponent: 10.0**exponent)


WITHIN = {"> 0": positive, ">= 0": positive | st.just(0.0), "finite": st.just(0.0) | st.floats(-1e12, 1e12)}


@st.composite
def any_start(draw: st.DrawFn, plant: Plant) -> dict[str, float]:
    """Return any parameters of the equation, any speed and any drive."""
    start = {
        parameter.name: draw(WITHIN[text])
        for text in WITHIN
        for parameter in plant.with_range(text)
        if parameter.name in plant.slave.model._fields
    }
    start[plant.v_start] = draw(st.floats(-1e160, 1e160))
    start[plant.input] = draw(st.just(0.0) | st.floats(allow_nan=False, allow_infinity=False))
    return start


@given(data=st.data(), method=st.sampled_from(LIMITED), h=positive)
def test_no_call_is_ok_with_a_value_that_is_not_finite(
    fmu: Fmu, data: st.DataObject, method: SolverMethod, h: float
) -> None:
    start = data.draw(any_start(fmu.plant))
    with fmu.running(start | {"solver.method": method, "solver.stepSize": h}) as instance:
        for k in range(3):
            status = instance.step(7.0 * h * k, 7.0 * h)
            assert finite_or_refused(instance)
            assert status == OK or is_error(status)


UNSTABLE: dict[str, tuple[SolverMethod, Start]] = {
    "undamped RK4": (SolverMethod.ExplicitRungeKutta4, lambda p: {p.drag: 0.0}),
    "default RK4": (SolverMethod.ExplicitRungeKutta4, lambda p: {}),
    "default midpoint": (SolverMethod.ExplicitMidPoint2, lambda p: {p.drag: 0.1}),
    "default Euler": (SolverMethod.ExplicitEuler, lambda p: {}),
    "stiff RK4": (SolverMethod.ExplicitRungeKutta4, lambda p: {p.mass: 1e-12, p.drag: 1e-3}),
    "stiff midpoint": (SolverMethod.ExplicitMidPoint2, lambda p: {p.drag: 1e9}),
    "stiff Euler": (SolverMethod.ExplicitEuler, lambda p: p.pull(0.0) | {p.drag: 1e9}),
    "pushed away from rest": (SolverMethod.ExplicitRungeKutta4, lambda p: p.pull(-9.81)),
}


@pytest.mark.parametrize(("method", "start_of"), UNSTABLE.values(), ids=UNSTABLE)
@pytest.mark.parametrize("factor", [1.0001, 1.5, 1e3])
def test_an_unstable_step_size_is_warned_of_with_one_that_is_not(
    fmu: Fmu, method: SolverMethod, start_of: Start, factor: float
) -> None:
    start = start_of(fmu.plant)
    if not all(fmu.plant.variables[name].allows(value) for name, value in start.items()):
        pytest.skip("the model has no such parameters")
    limit = limit_of(fmu.plant, method, start)
    if limit == inf:
        pytest.skip("the model is stable at every step size with these parameters")
    with fmu.instance() as instance:
        assert (
            instance.initialize(start | {"solver.method": method, "solver.stepSize": factor * limit})
            <= WARNING
        )
        (warning,) = instance.warnings
    assert warning.category == "logStatusWarning"
    assert warning.category in declared_categories(fmu)
    assert warning.text.startswith(
        f"{fmu.plant.system}: substeps of solver.stepSize = {factor * limit!r} s would be unstable: "
    )
    found = re.search(r"use solver.stepSize = (\S+) s or less", warning.text)
    assert found is not None, warning.text
    stable = float(found[1])
    assert 0.9998 * limit < stable <= limit
    with fmu.running(start | {"solver.method": method, "solver.stepSize": stable}) as instance:
        assert not instance.warnings


# Of a method, w02 and the damping rate: limits that are free of rounding but that of the last operation.
EXACT_LIMITS = {
    # At k2 = 2*w0 both eigenvalues are -w0.
    **{f"critical {method.name}": (method, 4.0, 4.0, REAL_LIMIT[method] / 2.0) for method in LIMITED},
    # Without w02 they are 0 and -k2.
    **{f"{method.name}, free": (method, 0.0, 4.0, REAL_LIMIT[method] / 4.0) for method in LIMITED},
    # |1 + h*lambda|^2 = 1 - h*k2 + h^2*w02 for a complex pair.
    "damped ExplicitEuler": (SolverMethod.ExplicitEuler, 4.0, 0.5, 0.5 / 4.0),
}


@pytest.mark.parametrize(("method", "w02", "rate", "limit"), EXACT_LIMITS.values(), ids=EXACT_LIMITS)
def test_the_warning_begins_above_the_limit(
    fmu: Fmu, method: int, w02: float, rate: float, limit: float
) -> None:
    for h, warned in ((nextafter(limit, 0.0), False), (limit, False), (nextafter(limit, inf), True)):
        start = fmu.plant.pull(w02) | {fmu.plant.drag: rate, "solver.method": method, "solver.stepSize": h}
        with fmu.instance() as instance:
            status = instance.initialize(start)
            assert not is_error(status)
            assert len(instance.warnings) == warned


@given(rate=positive, w02=positive, method=st.sampled_from(LIMITED))
def test_the_step_size_of_the_warning_is_never_warned_of(
    fmu: Fmu, rate: float, w02: float, method: SolverMethod
) -> None:
    start = fmu.plant.pull(w02) | {fmu.plant.drag: rate, "solver.method": method}
    with fmu.running(start | {"solver.stepSize": 1e30}) as instance:
        (warning,) = instance.warnings
    for advised in advice(warning.text, {"solver.method": method, "solver.stepSize": 1e30}):
        with fmu.running(start | advised) as instance:
            assert not instance.warnings, advised


def advice(text: str, settings: dict[str, float]) -> list[dict[str, float]]:
    """Return the settings that a warning names instead of `settings`."""
    advised = []
    for alternative in text.rpartition("use ")[2].split(", or "):
        step = re.search(r"solver.stepSize = (\S+) s or less", alternative)
        named = {"solver.stepSize": float(step[1])} if step else {}
        methods = [{"solver.method": int(value)} for value in re.findall(r"(\d) \(", alternative)]
        advised += [settings | named | method for method in methods or [{}]]
    return advised


@given(rate=st.just(0.0) | positive, w02=positive, method=st.sampled_from(LIMITED))
def test_the_advised_method_suits_the_motion(fmu: Fmu, rate: float, w02: float, method: SolverMethod) -> None:
    plant = fmu.plant
    start = plant.pull(w02) | {plant.drag: rate, "solver.method": method, "solver.stepSize": 1e30}
    with fmu.running(start) as instance:
        (warning,) = instance.warnings
    advised = {setting["solver.method"] for setting in advice(warning.text, start)} - {method}
    if rate >= 2.0 * sqrt(w02):  # no swings: drag makes the motion stiff
        assert advised == {SolverMethod.TRBDF2, SolverMethod.SDIRK4}
    elif METHODS[method].order < METHODS[SolverMethod.ExplicitRungeKutta4].order:
        assert advised == {SolverMethod.ExplicitRungeKutta4}
    else:
        assert not advised


@pytest.mark.parametrize(
    "method",
    [method for method in LIMITED if stability_limit(method, 0.0, 1.0) == 0.0],
    ids=lambda method: method.name,
)
def test_a_method_without_a_stable_step_size_is_warned_of_with_one_that_has(
    fmu: Fmu, method: SolverMethod
) -> None:
    start = fmu.plant.pull(9.81) | {fmu.plant.drag: 0.0}
    with fmu.running(start | {"solver.method": method}) as instance:
        (warning,) = instance.warnings
    assert f"has no stable step size for this {fmu.plant.system}" in warning.text
    (advised,) = advice(warning.text, {})
    with fmu.running(start | advised) as instance:
        assert not instance.warnings


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
def test_a_stable_step_size_is_not_warned_of(fmu: Fmu, method: SolverMethod) -> None:
    start = {fmu.plant.drag: 0.2}
    limit = limit_of(fmu.plant, method, start)
    h = 10.0 if limit == inf else 0.999 * limit
    with fmu.running(start | {"solver.method": method, "solver.stepSize": h}) as instance:
        assert not instance.warnings


def declared_categories(fmu: Fmu) -> set[str]:
    return set(
        re.findall(r'<Category name="(\w+)"', (fmu.folder / "modelDescription.xml").read_text("utf-8"))
    )
