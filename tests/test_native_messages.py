"""What the native FMU says is what the FMU with Python says."""

from collections.abc import Callable
from math import inf, nan
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import example, given
from hypothesis import strategies as st

import build_fmu
from fmi.shell import FmuError
from methods.solvers import SolverMethod
from slave import DampedPendulum
from tests.driver import WARNING, Instance, Log
from tests.plants import PENDULUM

H = 0.01


class Python:
    """The slave in Python behind the names of FMPy, so that a scenario runs on both."""

    def __init__(self) -> None:
        self.slave = DampedPendulum(instance_name="pendulum")

    def setupExperiment(self, startTime: float, stopTime: float | None = None) -> None:
        self.slave.setup_experiment(startTime, stopTime)

    def enterInitializationMode(self) -> None:
        self.slave.enter_initialization_mode()

    def exitInitializationMode(self) -> None:
        self.slave.exit_initialization_mode()

    def terminate(self) -> None:
        self.slave.terminate()

    def doStep(self, t: float, step: float) -> None:
        self.slave.do_step(t, step)

    def getReal(self, vrs: list[int]) -> list[float]:
        return self.slave.get_real(vrs)

    def getBoolean(self, vrs: list[int]) -> list[bool]:
        return self.slave.get_boolean(vrs)

    def setReal(self, vrs: list[int], values: list[float]) -> None:
        self.slave.set_real(vrs, values)

    def setInteger(self, vrs: list[int], values: list[int]) -> None:
        self.slave.set_integer(vrs, values)


def initialized(fmu: Any, method: int = 3, stop: float | None = None, **values: float) -> Any:
    fmu.setupExperiment(startTime=0.0, stopTime=stop)
    fmu.setInteger([PENDULUM.reference["solver.method"]], [method])
    for name, value in values.items():
        fmu.setReal([PENDULUM.reference[name.replace("solver_", "solver.")]], [value])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu


SCENARIOS: dict[str, Callable[[Any], Any]] = {
    "all wrong parameters": lambda f: initialized(
        f, method=7, m=-1.0, L=0.0, gamma=-1e-3, g=inf, solver_stepSize=nan
    ),
    "inertia": lambda f: initialized(f, m=1e-200, L=1e-100),
    "quotients": lambda f: initialized(f, m=1e-300, gamma=1e300, L=1e-5, g=1e305),
    "step before initialization": lambda f: f.doStep(0.0, H),
    "step size zero": lambda f: initialized(f).doStep(0.0, 0.0),
    "step size negative": lambda f: initialized(f).doStep(0.25, -1e-3),
    "step size nan": lambda f: initialized(f).doStep(0.0, nan),
    "step size infinite": lambda f: initialized(f).doStep(0.0, inf),
    "time nan": lambda f: initialized(f).doStep(nan, H),
    "torque nan": lambda f: initialized(f, tau=nan).doStep(0.0, H),
    "torque infinite": lambda f: initialized(f, tau=-inf).doStep(0.0, H),
    "stop time": lambda f: initialized(f, stop=1.0).doStep(0.995, H),
    "setup too late": lambda f: initialized(f).setupExperiment(startTime=0.0),
    "exit too early": lambda f: f.exitInitializationMode(),
    "enter twice": lambda f: (f.enterInitializationMode(), f.enterInitializationMode()),
    "no start": lambda f: f.setupExperiment(startTime=nan),
    "start beyond the stop": lambda f: f.setupExperiment(startTime=1e-5, stopTime=-1e22),
    "no stop": lambda f: f.setupExperiment(startTime=1.0, stopTime=nan),
    "substeps": lambda f: initialized(f, solver_stepSize=1e-12).doStep(0.0, 10.0),
    "divergence": lambda f: initialized(f, method=1, gamma=1e6, solver_stepSize=H).doStep(0.0, 10.0),
    "divergence undamped": lambda f: initialized(f, method=1, gamma=0.0, g=1e8, w_start=1e308).doStep(
        0.0, 10.0
    ),
    "divergence implicit": lambda f: initialized(f, method=4, w_start=1.7e308).doStep(0.0, 10.0),
    "divergence within the limit": lambda f: initialized(f, method=1, gamma=1.0, tau=1e308, m=1e-9).doStep(
        0.0, 10.0
    ),
    "divergence of no limit": lambda f: initialized(
        f, method=2, gamma=0.0, g=0.0, w_start=1.7e308, solver_stepSize=9.0
    ).doStep(0.0, 9.0),
    "step after the end": lambda f: (initialized(f), f.terminate(), f.doStep(0.0, H)),
    "unknown reference": lambda f: f.getReal([PENDULUM.reference["m"], 4711]),
    "wrong type": lambda f: f.getReal([PENDULUM.reference["solver.nfev"]]),
    "no boolean": lambda f: f.getBoolean([PENDULUM.reference["phi"]]),
    "set unknown": lambda f: f.setReal([99], [1.0]),
    "set output": lambda f: f.setReal([PENDULUM.reference["phi"]], [1.0]),
    "set parameter while stepping": lambda f: initialized(f).setReal([PENDULUM.reference["m"]], [2.0]),
    "set method while stepping": lambda f: initialized(f).setInteger(
        [PENDULUM.reference["solver.method"]], [1]
    ),
    "set torque after the end": lambda f: (
        initialized(f),
        f.terminate(),
        f.setReal([PENDULUM.reference["tau"]], [1.0]),
    ),
    "outputs of no mass": lambda f: (
        f.setReal([PENDULUM.reference["m"]], [0.0]),
        f.getReal([PENDULUM.reference["a"]]),
    ),
    "outputs of an infinite angle": lambda f: (
        f.setReal([PENDULUM.reference["phi_start"]], [inf]),
        f.getReal([PENDULUM.reference["E"]]),
    ),
}


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_a_refusal_says_what_the_fmu_with_python_says(
    instance: Instance, scenario: Callable[[Any], Any]
) -> None:
    with pytest.raises(FmuError) as python:
        scenario(Python())
    with pytest.raises(FMICallException) as raised:
        scenario(instance.slave)
    assert instance.refusal(raised.value.status) == str(python.value)


@given(time=st.floats(), step=st.floats(max_value=0.0))
@example(1e16, -9999999999999998.0)
@example(1e-4, -9.999e-5)
@example(123456789012345680.0, -5e-324)
@example(2.0**-24, -(2.0**-24))
def test_numbers_read_as_in_python(shared: Instance, time: float, step: float) -> None:
    shared.start({})
    assert_refused_as_in_python(shared, time, step)


def test_powers_of_two_read_as_in_python(shared: Instance) -> None:
    """The doubles below one are closer to it than those above, and 46 of them have a shortest decimal of their own."""
    shared.start({})
    for exponent in range(-1074, 1024):
        assert_refused_as_in_python(shared, 2.0**exponent, -(2.0**exponent))


def assert_refused_as_in_python(shared: Instance, time: float, step: float) -> None:
    assert shared.refusal(shared.step(time, step)) == (
        f"pendulum: no step from t = {time!r} s: communicationStepSize = {step!r} s (allowed: > 0 and finite)"
    )


@given(st.floats(1e-300, 1e-8))
@example(9.995e-10)
@example(9.99499e-10)
def test_rounded_numbers_read_as_in_python(shared: Instance, h: float) -> None:
    shared.start({"solver.stepSize": h})
    count = (100.0 - 4 * 2.0**-52 * 100.0) / h
    message = shared.refusal(shared.step(0.0, 100.0))
    assert f" would need {count:.3g} substeps of {h!r} s, at most 2147483647 " in message


def test_an_unstable_step_size_is_a_warning(instance: Instance) -> None:
    instance.start({"solver.method": SolverMethod.ExplicitEuler, "gamma": 0.0})
    assert instance.log == [
        Log(
            WARNING,
            "logStatusWarning",
            "pendulum: substeps of solver.stepSize = 0.001 s would be unstable: "
            "ExplicitEuler has no stable step size for this pendulum: "
            "use solver.method = 3 (ExplicitRungeKutta4) with solver.stepSize = 0.90311 s or less",
        )
    ]


@pytest.mark.parametrize("method", SolverMethod)
@pytest.mark.parametrize("gamma", [0.0, 1e-9, 0.002, 3.0, 6.2, 50.0])
def test_the_warning_comes_at_the_stability_limit_of_python(
    instance: Instance, method: SolverMethod, gamma: float
) -> None:
    limit = build_fmu.stability_limit(method, gamma, 9.80665)
    for h in (limit * (1 - 1e-9), limit * (1 + 1e-9)) if 0.0 < limit < inf else (1e-3,):
        instance.log.clear()
        instance.start({"solver.method": method, "gamma": gamma, "solver.stepSize": h})
        assert bool(instance.log) == (h > limit)
