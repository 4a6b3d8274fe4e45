"""The native FMU: the Python kernel's bits, FMI 2.0 conduct, other importers, safety of the C code."""

import ctypes
import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from importlib.util import find_spec
from math import inf, isfinite, log2, nan, pi
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import mpmath
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import build_fmu
from damped_pendulum.interface import INTERFACE, VARIABLES
from damped_pendulum.model import Pendulum
from fmi.shell import FmuError
from methods.solvers import METHODS, SolverMethod, substeps
from native import build as native
from slave import DampedPendulum
from tests.twin import longest_substep

HERE = Path(__file__).resolve().parent
IMPORTERS = HERE / "native_importers"
VR = {variable.name: vr for vr, variable in enumerate(VARIABLES)}
OUTPUTS = ("phi", "w", "a", "E")
H = 0.01
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
COMPILERS = ("gcc", "clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang)")
on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")


@pytest.fixture(scope="session")
def native_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if COMPILER is None:
        pytest.skip("no C compiler (cc, gcc, clang)")
    return build_fmu.build_native(tmp_path_factory.mktemp("dist") / "native.fmu", native.host_binary)


@pytest.fixture(scope="session")
def folder(native_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("extracted")
    with zipfile.ZipFile(native_path) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def description(folder: Path) -> Any:
    return fmpy.read_model_description(str(folder))


class FMU2Instance(FMU2Slave):
    """An instance that keeps its messages, with variables by name; FMPy goes by the name of the class."""

    def __init__(self, folder: Path, description: Any, **changed: Any) -> None:
        arguments = {
            "guid": description.guid,
            "unzipDirectory": str(folder),
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "instanceName": "pendulum",
        }
        super().__init__(**(arguments | changed))
        self.messages: list[tuple[str, int, str]] = []
        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(
            lambda environment, name, status, category, message: self.messages.append(
                (category.decode(), status, message.decode())
            )
        )
        self.instantiate(callbacks=callbacks, loggingOn=True)

    def set(self, name: str, value: float) -> None:
        (self.setInteger if name == "solver.method" else self.setReal)([VR[name]], [value])

    def get(self, *names: str) -> list[float]:
        return self.getReal([VR[name] for name in names])

    def nfev(self) -> int:
        return self.getInteger([VR["solver.nfev"]])[0]

    def partial(self, unknown: str, known: str) -> float:
        return float(self.getDirectionalDerivative([VR[unknown]], [VR[known]], [1.0])[0])

    def start(self, values: dict[str, float], stop: float | None = None) -> None:
        self.reset()
        self.setupExperiment(startTime=0.0, stopTime=stop)
        for name, value in values.items():
            self.set(name, value)
        self.enterInitializationMode()
        self.exitInitializationMode()

    def refusal(self, call: Callable[[], Any]) -> str:
        """Return the message of a call that must fail with fmi2Error."""
        self.messages.clear()
        with pytest.raises(FMICallException) as raised:
            call()
        assert raised.value.status == fmpy.fmi2.fmi2Error
        category, status, message = self.messages.pop()
        assert (category, status) == ("logStatusError", fmpy.fmi2.fmi2Error)
        return message

    def unwritten(self, call: Callable[[Any], Any], n: int) -> str:
        """Return the message of a refused call that writes `n` Reals, none of which it may touch."""
        values = (fmpy.fmi2.fmi2Real * n)(*[7.0] * n)
        message = self.refusal(lambda: call(values))
        assert list(values) == [7.0] * n
        return message

    def debug_logging(self, on: bool, *categories: str | None) -> None:
        n = len(categories)
        names = [None if category is None else category.encode() for category in categories]
        self.fmi2SetDebugLogging(self.component, on, n, (fmpy.fmi2.fmi2String * n)(*names))

    def setup(self, start: float, stop: float | None = None) -> None:
        self.fmi2SetupExperiment(self.component, 0, 0.0, start, stop is not None, stop or 0.0)

    def initialize(self) -> None:
        self.enterInitializationMode()
        self.exitInitializationMode()

    def input_derivatives(self, values: dict[int, float]) -> None:
        n = len(values)
        self.fmi2SetRealInputDerivatives(
            self.component,
            (fmpy.fmi2.fmi2ValueReference * n)(*[VR["tau"]] * n),
            n,
            (fmpy.fmi2.fmi2Integer * n)(*values),
            (fmpy.fmi2.fmi2Real * n)(*values.values()),
        )

    def output_derivative(self, name: str, order: int, value: Any = None) -> float:
        value = (fmpy.fmi2.fmi2Real * 1)() if value is None else value
        self.fmi2GetRealOutputDerivatives(
            self.component,
            (fmpy.fmi2.fmi2ValueReference * 1)(VR[name]),
            1,
            (fmpy.fmi2.fmi2Integer * 1)(order),
            value,
        )
        return float(value[0])


@pytest.fixture
def instance(folder: Path, description: Any) -> Iterator[FMU2Instance]:
    instance = FMU2Instance(folder, description)
    yield instance
    instance.fmi2FreeInstance(instance.component)


@pytest.fixture(scope="module")
def shared(folder: Path, description: Any) -> Iterator[FMU2Instance]:
    instance = FMU2Instance(folder, description)
    yield instance
    instance.fmi2FreeInstance(instance.component)


# The same bits


def kernel_step(
    pendulum: Pendulum,
    method: SolverMethod,
    phi: float,
    w: float,
    tau: float,
    t: float,
    duration: float,
    h: float,
) -> tuple[float, float, int] | None:
    """Return phi, w and the evaluations after a communication step, None if it diverges."""
    n = substeps(t, duration, h)
    try:
        phi, w, nfev = METHODS[method].solver(pendulum.motion(tau), phi, w, duration / n, n)
    except ValueError:  # math.sin(inf)
        return None
    return (phi + 0.0, w + 0.0, nfev) if isfinite(phi) and isfinite(w) else None


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300, deadline=None)
@given(
    m=st.floats(1e-3, 1e3),
    L=st.floats(1e-2, 1e2),
    gamma=st.one_of(st.just(0.0), st.floats(0, 1), st.floats(0, 1e4)),
    g=st.sampled_from([0.0, 9.80665, -1.62, 1e4]),
    phi=st.one_of(st.floats(-4, 4), st.floats(-1e6, 1e6)),
    w=st.one_of(st.floats(-5, 5), st.floats(-1e200, 1e200)),
    method=st.sampled_from(SolverMethod),
    step=st.floats(1e-4, 0.05),
    torques=st.lists(
        st.one_of(st.just(0.0), st.floats(-10, 10), st.floats(-1e300, 1e300)), min_size=1, max_size=4
    ),
    duration=st.floats(1e-3, 0.05),
)
@example(  # 3 substeps that are as long as they may be
    *(1.0, 1.0, 0.0, 9.80665, 0.5, 0.0, SolverMethod.ImplicitEuler, 1.0, [0.0]),
    3 * Pendulum(1.0, 1.0, 0.0, 9.80665).motion().longest_implicit_stage(),
)
@example(1, 1, 1e4, 9.8, 0.5, 0.0, SolverMethod.ExplicitEuler, 0.05, [0.0] * 4, 1.0)  # diverges
def test_every_method_gives_the_bits_of_the_python_kernel(
    shared: FMU2Instance,
    m: float,
    L: float,
    gamma: float,
    g: float,
    phi: float,
    w: float,
    method: SolverMethod,
    step: float,
    torques: list[float],
    duration: float,
) -> None:
    parameters = {"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w}
    shared.start(parameters | {"solver.method": method, "solver.stepSize": step})
    pendulum, nfev = Pendulum(m, L, gamma, g), 0
    h = longest_substep(method, step, pendulum)
    for i, tau in enumerate(torques):
        shared.set("tau", tau)
        expected = kernel_step(pendulum, method, phi, w, tau, i * duration, duration, h)
        if expected is None:
            message = shared.refusal(lambda i=i: shared.doStep(i * duration, duration))
            assert message.startswith("pendulum: diverged at t = ")
        else:
            shared.doStep(i * duration, duration)
            phi, w, evaluations = expected
            nfev += evaluations
        a, E = pendulum.motion(tau).acceleration()(phi, w), pendulum.energy(phi, w)
        assert shared.get("phi", "w") == [phi, w]
        for name, value in (("a", a), ("E", E)):
            if isfinite(value):
                assert shared.get(name) == [value]
            else:
                assert "is out of the range of a double" in shared.refusal(lambda name=name: shared.get(name))
        assert shared.nfev() == nfev


ZEROS = (0.0, -0.0, 5e-324, -5e-324, 1e-300, -1e-300)


def packed(*values: float) -> bytes:
    """Return the bits, in which 0.0 and -0.0 differ."""
    return struct.pack(f"{len(values)}d", *values)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=1000, deadline=None)
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
    shared: FMU2Instance, gamma: float, g: float, phi: float, w: float, tau: float, method: SolverMethod
) -> None:
    parameters = {"gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau}
    shared.start(parameters | {"solver.method": method, "solver.stepSize": H})
    pendulum = Pendulum(1.0, 1.0, gamma, g)
    h = longest_substep(method, H, pendulum)
    for i in range(3):
        acceleration = pendulum.motion(tau).acceleration()
        for name, value in (("a", acceleration(phi, w) + 0.0), ("E", pendulum.energy(phi, w))):
            if isfinite(value):
                assert packed(*shared.get(name)) == packed(value)
        expected = kernel_step(pendulum, method, phi, w, tau, i * H, H, h)
        if expected is None:
            assert "diverged" in shared.refusal(lambda i=i: shared.doStep(i * H, H))
            return
        shared.doStep(i * H, H)
        phi, w, _ = expected
        assert packed(*shared.get("phi", "w")) == packed(phi, w)


def value_in_python(compute: Callable[[], float]) -> float:
    """Return a value, NaN where it cannot be computed."""
    try:
        return compute()
    except (ValueError, ZeroDivisionError):  # math.sin(inf), a mass of zero
        return nan


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=1000, deadline=None)
@given(*[st.one_of(st.floats(), st.floats(-10, 10))] * 7)
@example(1e300, 1e-100, 0.0, 1e50, 1.0, 0.0, 0.0)  # E = 4.5969769413186036e+249, while m*g is infinite
@example(1e-300, 1e-11, 0.0, 0.0, 0.0, 0.0, 9.88e-323)  # a = 0.9881312916824931, while J has two bits
@example(1.0, 1.0, 0.0, 0.0, inf, 1.0, 0.0)  # nothing acts
@example(1.0, 1.0, 0.0, 0.0, 1.0, nan, 0.0)
@example(0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0)
@example(-1.0, 0.5, 0.1, 9.8, 1.0, 1.0, -0.0)
def test_a_and_e_are_the_bits_of_python_or_refused_whatever_is_set(
    shared: FMU2Instance, m: float, L: float, gamma: float, g: float, phi: float, w: float, tau: float
) -> None:
    shared.reset()
    values = {"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau}
    for name, value in values.items():
        shared.set(name, value)
    pendulum = Pendulum(m, L, gamma, g)
    for name, value in (
        ("a", value_in_python(lambda: pendulum.motion(tau).acceleration()(phi, w) + 0.0)),
        ("E", value_in_python(lambda: pendulum.energy(phi, w))),
    ):
        if isfinite(value):
            assert packed(*shared.get(name)) == packed(value)
        else:
            assert f"{name} is out of the range" in shared.refusal(lambda name=name: shared.get(name))


def test_numbers_keep_their_digits_where_products_of_parameters_leave_the_range(
    instance: FMU2Instance,
) -> None:
    instance.start({"m": 1e300, "g": 1e50, "L": 1e-100, "phi_start": 1.0})
    assert instance.get("E") == [4.5969769413186036e249]
    # m*g*L*sin(phi)
    assert instance.partial("E", "phi") == pytest.approx(float(mpmath.sin(1)) * 1e250, rel=1e-15, abs=0)
    instance.start({"m": 1e-300, "L": 1e-11, "gamma": 0.0, "g": 0.0, "tau": 9.88e-323})
    assert instance.get("a") == [0.9881312916824931]
    instance.input_derivatives({1: 9.88e-323, 2: 9.88e-323, 3: 9.88e-323})
    assert instance.output_derivative("w", 2) == 0.9881312916824931
    assert instance.output_derivative("a", 2) == pytest.approx(0.9881312916824931, rel=4e-16, abs=0)
    instance.start({"m": 1e300, "L": 1e-200, "g": 0.0, "gamma": 0.0, "w_start": 1e60, "tau": 1e-90})
    # der(E) = tau*w, der(J*w^2/2)/der(w) = J*w
    assert instance.output_derivative("E", 1) == pytest.approx(1e-30, rel=1e-15, abs=0)
    assert instance.partial("E", "w") == pytest.approx(1e-40, rel=1e-15, abs=0)


def test_the_default_experiment_gives_the_bits_of_the_fmu_with_python(
    native_path: Path, fmu_path: Path
) -> None:
    runs = [
        fmpy.simulate_fmu(str(path), output=[*OUTPUTS, "solver.nfev"]) for path in (native_path, fmu_path)
    ]
    assert (runs[0] == runs[1]).all()
    assert len(runs[0]) == 1001


# What the interface says


def test_the_description_differs_in_what_the_binary_can_do_alone(native_path: Path, fmu_path: Path) -> None:
    native_root, root = (
        ElementTree.fromstring(build_fmu.read_entries(path)["modelDescription.xml"])
        for path in (native_path, fmu_path)
    )
    for section in ("UnitDefinitions", "TypeDefinitions", "DefaultExperiment"):
        texts = {
            re.sub(r"\s+", " ", ElementTree.tostring(r.find(section), "unicode")) for r in (native_root, root)
        }
        assert len({text.replace("> <", "><").strip() for text in texts}) == 1
    for node, other in zip(native_root.iter("ScalarVariable"), root.iter("ScalarVariable"), strict=True):
        assert node.attrib == other.attrib
        node[0].attrib.pop("derivative", None)
        assert (node[0].tag, node[0].attrib) == (other[0].tag, other[0].attrib)
    flags, others = (r.find("CoSimulation").attrib for r in (native_root, root))
    assert {name: value for name, value in flags.items() if others.get(name) != value} == {
        "modelIdentifier": "DampedPendulumNative",
        "needsExecutionTool": "false",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "2",
        "providesDirectionalDerivative": "true",
    }


def test_the_fmu_is_valid_complete_and_the_same_bytes_each_time(native_path: Path, tmp_path: Path) -> None:
    assert validate_fmu(str(native_path)) == []
    again = build_fmu.build_native(tmp_path / "again.fmu", native.host_binary)
    assert again.read_bytes() == native_path.read_bytes()
    entries = build_fmu.read_entries(native_path)
    assert not [name for name in entries if name.endswith(".py") or name.startswith("resources/")]
    page = entries["documentation/index.html"].decode()
    assert "<!--" not in page
    assert "fmi2SetRealInputDerivatives" in page
    assert "documentation/licenses/third_party.txt" in entries


def test_the_fmu_with_python_has_nothing_of_the_native_one(fmu_path: Path) -> None:
    assert not [name for name in build_fmu.read_entries(fmu_path) if "native" in name.lower()]


def test_ranges_are_those_of_the_header() -> None:
    header = native.header("")
    for variable in VARIABLES:
        if variable.range is not None:
            assert f'"{variable.name}"' in header
            for bound in (variable.range.lowest, variable.range.highest):
                assert variable.allows(bound)
                assert repr(float(bound)) in header


# Conduct


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
    fmu.setInteger([VR["solver.method"]], [method])
    for name, value in values.items():
        fmu.setReal([VR[name.replace("solver_", "solver.")]], [value])
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
    "unknown reference": lambda f: f.getReal([VR["m"], 4711]),
    "wrong type": lambda f: f.getReal([VR["solver.nfev"]]),
    "no boolean": lambda f: f.getBoolean([VR["phi"]]),
    "set unknown": lambda f: f.setReal([99], [1.0]),
    "set output": lambda f: f.setReal([VR["phi"]], [1.0]),
    "set parameter while stepping": lambda f: initialized(f).setReal([VR["m"]], [2.0]),
    "set method while stepping": lambda f: initialized(f).setInteger([VR["solver.method"]], [1]),
    "set torque after the end": lambda f: (initialized(f), f.terminate(), f.setReal([VR["tau"]], [1.0])),
    "outputs of no mass": lambda f: (f.setReal([VR["m"]], [0.0]), f.getReal([VR["a"]])),
    "outputs of an infinite angle": lambda f: (f.setReal([VR["phi_start"]], [inf]), f.getReal([VR["E"]])),
}


@pytest.mark.parametrize("scenario", SCENARIOS.values(), ids=SCENARIOS)
def test_a_refusal_says_what_the_fmu_with_python_says(
    instance: FMU2Instance, scenario: Callable[[Any], Any]
) -> None:
    with pytest.raises(FmuError) as raised:
        scenario(Python())
    assert instance.refusal(lambda: scenario(instance)) == str(raised.value)


@given(time=st.floats(), step=st.floats(max_value=0.0))
@example(1e16, -9999999999999998.0)
@example(1e-4, -9.999e-5)
@example(123456789012345680.0, -5e-324)
@example(2.0**-24, -(2.0**-24))
def test_numbers_read_as_in_python(shared: FMU2Instance, time: float, step: float) -> None:
    shared.start({})
    assert_refused_as_in_python(shared, time, step)


def test_powers_of_two_read_as_in_python(shared: FMU2Instance) -> None:
    """The doubles below one are closer to it than those above, and 46 of them have a shortest decimal of their own."""
    shared.start({})
    for exponent in range(-1074, 1024):
        assert_refused_as_in_python(shared, 2.0**exponent, -(2.0**exponent))


def assert_refused_as_in_python(shared: FMU2Instance, time: float, step: float) -> None:
    assert shared.refusal(lambda: shared.doStep(time, step)) == (
        f"pendulum: no step from t = {time!r} s: communicationStepSize = {step!r} s (allowed: > 0 and finite)"
    )


@given(st.floats(1e-300, 1e-8))
@example(9.995e-10)
@example(9.99499e-10)
def test_rounded_numbers_read_as_in_python(shared: FMU2Instance, h: float) -> None:
    shared.start({"solver.stepSize": h})
    count = (100.0 - 4 * 2.0**-52 * 100.0) / h
    message = shared.refusal(lambda: shared.doStep(0.0, 100.0))
    assert f" would need {count:.3g} substeps of {h!r} s, at most 2147483647 " in message


def test_an_unstable_step_size_is_a_warning(instance: FMU2Instance) -> None:
    initialized(instance, method=1, gamma=0.0)
    assert instance.messages == [
        (
            "logStatusWarning",
            fmpy.fmi2.fmi2Warning,
            "solver.stepSize = 0.001 s is unstable: ExplicitEuler has no stable step size for this pendulum "
            "(stability limit 0 s): use ExplicitRungeKutta4 or ImplicitEuler",
        )
    ]


@pytest.mark.parametrize("method", SolverMethod)
@pytest.mark.parametrize("gamma", [0.0, 1e-9, 0.002, 3.0, 6.2, 50.0])
def test_the_warning_comes_at_the_stability_limit_of_python(
    instance: FMU2Instance, method: SolverMethod, gamma: float
) -> None:
    limit = build_fmu.stability_limit(method, gamma, 9.80665)
    for h in (limit * (1 - 1e-9), limit * (1 + 1e-9)) if 0.0 < limit < inf else (1e-3,):
        instance.reset()
        instance.messages.clear()
        initialized(instance, method, gamma=gamma, solver_stepSize=h)
        assert bool(instance.messages) == (h > limit)


def test_outputs_are_right_before_the_first_step(instance: FMU2Instance) -> None:
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()
    for name, value in {"m": 2.0, "L": 0.5, "gamma": 0.1, "g": 9.0, "tau": 0.25, "phi_start": pi / 3}.items():
        instance.set(name, value)
    pendulum = Pendulum(2.0, 0.5, 0.1, 9.0)
    expected = [pi / 3, 0.0, pendulum.motion(0.25).acceleration()(pi / 3, 0.0), pendulum.energy(pi / 3, 0.0)]
    assert instance.get(*OUTPUTS) == expected
    instance.exitInitializationMode()
    assert instance.get(*OUTPUTS) == expected


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"guid": "{0}"}, "the GUID is {0} instead of "),
        ({"instanceName": ""}, "the instance name is missing"),
        ({"instanceName": " \t\n"}, "the instance name is missing"),
    ],
)
def test_a_wrong_instantiation_is_refused(
    folder: Path, description: Any, changed: dict[str, str], words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    messages: list[str] = []
    with pytest.raises(Exception, match="Failed to instantiate model"):
        FMU2Recording(messages, folder, description, **changed)
    assert words in messages[0]


class FMU2Recording(FMU2Instance):
    """An instance whose messages outlive a refused instantiation."""

    def __init__(self, messages: list[str], *arguments: Any, **changed: Any) -> None:
        self._kept = messages
        super().__init__(*arguments, **changed)

    def instantiate(self, *arguments: Any, **named: Any) -> None:
        try:
            super().instantiate(*arguments, **named)
        finally:
            self._kept += [message for _, _, message in self.messages]


def raw_instance(
    library: FMU2Instance, logger: Any, name: str, kind: int, guid: str, logging: bool = True
) -> Any:
    """Instantiate without FMPy's checks."""
    callbacks = fmpy.fmi2.fmi2CallbackFunctions()
    callbacks.logger = logger
    return library.fmi2Instantiate(
        name.encode(), kind, guid.encode(), b"", fmpy.fmi2.byref(callbacks), 0, logging
    )


@pytest.fixture
def log() -> tuple[list[bytes], Any]:
    """Return the messages of a logger, and the logger."""
    messages: list[bytes] = []
    logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *arguments: messages.append(arguments[-1]))
    return messages, logger


def test_a_model_exchange_instance_is_refused(
    instance: FMU2Instance, description: Any, log: tuple[list[bytes], Any]
) -> None:
    messages, logger = log
    assert raw_instance(instance, logger, "p", fmpy.fmi2.fmi2ModelExchange, description.guid) is None
    assert messages == [b"p: the FMU is for co-simulation alone"]


def test_percent_and_number_signs_do_not_reach_a_logger_that_formats(
    instance: FMU2Instance, log: tuple[list[bytes], Any]
) -> None:
    messages, logger = log
    assert raw_instance(instance, logger, "50% of #r9#", fmpy.fmi2.fmi2CoSimulation, "#%s#") is None
    assert messages[0].startswith(b"50percent of ##r9##: the GUID is ##percents## instead of ")


@pytest.mark.parametrize(
    "text", ["a" + 300 * "\u00e4", 134 * "\u20ac", "ab" + 101 * "\U0001f600", 4000 * "%"]
)
def test_a_long_text_of_the_host_is_cut_between_characters(
    instance: FMU2Instance, log: tuple[list[bytes], Any], text: str
) -> None:
    messages, logger = log
    for name, guid in ((text, "x"), ("x", text), (text, text)):
        assert raw_instance(instance, logger, name, fmpy.fmi2.fmi2CoSimulation, guid) is None
        shown = messages.pop().decode()  # which UTF-8 that is cut would not let
        whole = text.encode()[:400].decode(errors="ignore").replace("%", "percent")
        assert (whole if name == text else "x") + ": the GUID is " in shown
        assert len(shown.encode()) < 4096


def test_a_message_that_does_not_fit_is_cut_between_characters(
    instance: FMU2Instance, log: tuple[list[bytes], Any]
) -> None:
    """Its 4095 bytes end within one of these names or the other."""
    messages, logger = log
    for first in range(1, 9):
        name, guid = 400 * "%", (first + 180) * "%" + 200 * "\u00e4"
        assert raw_instance(instance, logger, name, fmpy.fmi2.fmi2CoSimulation, guid) is None
        assert 4080 < len(messages.pop().decode().encode()) < 4096


def warned(instance: FMU2Instance) -> bool:
    """Return whether an unstable step size is logged; the status tells it always."""
    instance.reset()
    instance.messages.clear()
    instance.setInteger([VR["solver.method"]], [1])
    instance.enterInitializationMode()
    status = int(instance.fmi2ExitInitializationMode(instance.component) or 0)
    assert status == fmpy.fmi2.fmi2Warning
    return bool(instance.messages)


def test_warnings_are_logged_where_logging_is_on(
    folder: Path, description: Any, instance: FMU2Instance
) -> None:
    assert warned(instance)
    for on, categories, expected in (
        (False, (), False),
        (True, (), True),
        (True, ("logStatusError",), False),
        (True, ("logStatusError", "logStatusWarning"), True),
        (True, ("logStatusDiscard",), False),
        (False, ("logStatusWarning",), False),
    ):
        instance.debug_logging(on, *categories)
        assert warned(instance) == expected, (on, categories)  # after a reset
        instance.refusal(lambda: instance.doStep(0.0, -1.0))  # errors always are
    state = instance.getFMUstate()
    instance.debug_logging(True)
    instance.setFMUstate(state)
    assert warned(instance)  # logging is no part of a state
    instance.freeFMUstate(state)


def test_without_logging_an_instance_logs_no_warning(instance: FMU2Instance, description: Any) -> None:
    messages: list[int] = []
    logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(lambda *arguments: messages.append(arguments[2]))
    guid, library = description.guid, instance.component
    quiet = raw_instance(instance, logger, "quiet", fmpy.fmi2.fmi2CoSimulation, guid, logging=False)
    try:
        instance.component = quiet
        assert not warned(instance)
        assert messages == []
        with pytest.raises(FMICallException):
            instance.doStep(0.0, -1.0)
        assert messages == [fmpy.fmi2.fmi2Error]
    finally:
        instance.component = library
        instance.fmi2FreeInstance(quiet)


def test_wrong_log_categories_are_refused_and_change_nothing(instance: FMU2Instance) -> None:
    allowed = "(allowed: logStatusWarning, logStatusDiscard, logStatusError)"
    assert instance.refusal(lambda: instance.debug_logging(False, "logStatusError", "logAl")) == (
        f"pendulum: log category logAl is unknown {allowed}"
    )
    assert "an argument is NULL" in instance.refusal(lambda: instance.debug_logging(False, None))
    assert "an argument is NULL" in instance.refusal(
        lambda: instance.fmi2SetDebugLogging(instance.component, 0, 1, None)
    )
    assert warned(instance)


def test_the_description_names_the_categories_of_the_messages(description: Any, native_path: Path) -> None:
    root = ElementTree.fromstring(build_fmu.read_entries(native_path)["modelDescription.xml"])
    assert [node.get("name") for node in root.iter("Category")] == [
        "logStatusWarning",
        "logStatusDiscard",
        "logStatusError",
    ]


def test_a_second_setup_replaces_all_of_the_first(instance: FMU2Instance) -> None:
    instance.setup(0.0, stop=1.0)
    instance.setup(0.5)
    instance.initialize()
    instance.doStep(1.0, H)


@pytest.mark.parametrize(
    ("start", "stop", "step", "slack"),
    [
        (0.0, 1.0, 0.1, 1e-9),  # that of FMPy
        (-2.0, 1.0, 0.1, 2e-9),
        (0.0, 1e9, 1.5, 0.15),  # a tenth of the step where it is more
        (0.0, 1.0, 1e-12, 1e-13),
        (0.0, 1e9, 1e-6, 4 * 2.0**-52 * 1e9),  # the rounding of the clock at least
    ],
)
def test_a_step_may_end_beyond_the_stop_time_by_what_the_clock_of_a_host_is_off(
    instance: FMU2Instance, start: float, stop: float, step: float, slack: float
) -> None:
    """Of the slack 1e-3 is left to the rounding of the time, and no less than two units in its last place."""
    margin = max(1e-3 * slack, 2 * (stop + step) * 2.0**-52)
    assert margin < slack / 1.9
    instance.set("solver.stepSize", 2.0)  # longer than the clock is coarse
    instance.setup(start, stop)
    instance.initialize()
    instance.doStep(stop + slack - margin - step, step)
    begin = stop + slack + margin - step
    assert instance.refusal(lambda: instance.doStep(begin, step)) == (
        f"pendulum: no step from t = {begin!r} s over {step!r} s: it must end at a finite time, "
        f"not beyond the stop time ({stop!r} s)"
    )


def test_a_clock_that_is_coarser_than_a_substep_is_refused(instance: FMU2Instance) -> None:
    instance.start({"solver.stepSize": 1e-3})
    instance.doStep(1e12, 1.0)  # rounded to 0.9 ms
    time = 1.2e12
    assert instance.refusal(lambda: instance.doStep(time, 1.0)) == (
        f"pendulum: no step from t = {time!r} s over 1.0 s: its times are rounded to "
        f"{4 * 2.0**-52 * (time + 1.0)!r} s, which is more than the longest substep (0.001 s)"
    )
    assert "would need" in instance.refusal(lambda: instance.doStep(1e15, 1e12))  # the first of two reasons


def test_a_reset_instance_is_a_new_one(instance: FMU2Instance) -> None:
    fresh = instance.serializeFMUstate(instance.getFMUstate())
    instance.start({"m": 2.0, "solver.method": 1, "tau": 1.0})
    instance.doStep(0.0, H)
    instance.reset()
    assert instance.serializeFMUstate(instance.getFMUstate()) == fresh


def test_status_of_steps(instance: FMU2Instance) -> None:
    instance.start({}, stop=1.0)
    instance.doStep(0.0, H)
    time, ended = fmpy.fmi2.fmi2Real(), fmpy.fmi2.fmi2Boolean(1)
    by = fmpy.fmi2.byref
    instance.fmi2GetRealStatus(instance.component, fmpy.fmi2.fmi2LastSuccessfulTime, by(time))
    instance.fmi2GetBooleanStatus(instance.component, fmpy.fmi2.fmi2Terminated, by(ended))
    assert (time.value, ended.value) == (H, 0)
    instance.refusal(lambda: instance.doStep(2.0, H))
    instance.fmi2GetRealStatus(instance.component, fmpy.fmi2.fmi2LastSuccessfulTime, by(time))
    assert time.value == H
    instance.messages.clear()
    with pytest.raises(FMICallException, match="discard"):  # it is for steps that were pending
        instance.fmi2GetStatus(instance.component, fmpy.fmi2.fmi2DoStepStatus, by(fmpy.fmi2.fmi2Status()))
    assert instance.messages == [
        ("logStatusDiscard", fmpy.fmi2.fmi2Discard, "there is no status of kind 0: no step is pending")
    ]


def test_before_the_first_step_the_last_successful_time_is_the_start_time(instance: FMU2Instance) -> None:
    instance.setup(2.5)
    instance.initialize()
    time = fmpy.fmi2.fmi2Real()
    instance.fmi2GetRealStatus(instance.component, fmpy.fmi2.fmi2LastSuccessfulTime, fmpy.fmi2.byref(time))
    assert time.value == 2.5


def test_of_a_refused_read_nothing_is_written(instance: FMU2Instance) -> None:
    references = (fmpy.fmi2.fmi2ValueReference * 2)(VR["phi"], VR["E"])
    instance.set("phi_start", inf)
    message = instance.unwritten(
        lambda values: instance.fmi2GetReal(instance.component, references, 2, values), 2
    )
    assert message.startswith("pendulum: E is out of the range of a double at phi = inf rad")


# State


def run_on(instance: FMU2Instance, steps: int) -> list[float]:
    for i in range(steps):
        instance.doStep(1.0 + i * H, H)
    return [*instance.get(*OUTPUTS, "tau"), instance.nfev()]


def test_a_restored_state_has_the_same_future(instance: FMU2Instance, folder: Path, description: Any) -> None:
    instance.start({"gamma": 0.3, "solver.method": 4, "tau": 0.7}, stop=100.0)
    run_on(instance, 3)
    instance.input_derivatives({1: 2.0, 3: -5.0})
    state = instance.getFMUstate()
    data = instance.serializeFMUstate(state)
    future = run_on(instance, 5)
    instance.setFMUstate(state)
    assert run_on(instance, 5) == future
    instance.freeFMUstate(state)
    assert state.value is None
    other = FMU2Instance(folder, description)
    other.setFMUstate(other.deSerializeFMUstate(data))
    assert run_on(other, 5) == future
    assert "fixed parameter" in other.refusal(lambda: other.set("m", 1.0))  # the mode is part of the state
    other.fmi2FreeInstance(other.component)


def test_a_state_from_bytes_is_a_new_one_whatever_the_variable_held(instance: FMU2Instance) -> None:
    instance.start({})
    data = instance.serializeFMUstate(instance.getFMUstate())
    instance.doStep(0.0, H)
    live = instance.getFMUstate()
    later = instance.serializeFMUstate(live)
    buffer = (ctypes.c_char * len(data)).from_buffer_copy(data)
    for held in (0xDEAD, live.value):
        state = fmpy.fmi2.fmi2FMUstate(held)
        instance.fmi2DeSerializeFMUstate(instance.component, buffer, len(data), fmpy.fmi2.byref(state))
        assert state.value not in (held, None)
        assert instance.serializeFMUstate(state) == data
        instance.freeFMUstate(state)
    assert instance.serializeFMUstate(live) == later
    wrong = fmpy.fmi2.fmi2FMUstate(0xDEAD)
    buffer[9] = b"?"
    instance.refusal(
        lambda: instance.fmi2DeSerializeFMUstate(
            instance.component, buffer, len(data), fmpy.fmi2.byref(wrong)
        )
    )
    assert wrong.value == 0xDEAD


def test_a_state_that_is_pointed_to_is_used_again(instance: FMU2Instance) -> None:
    instance.start({})
    state = instance.getFMUstate()
    place, before = state.value, instance.serializeFMUstate(state)
    instance.doStep(0.0, H)
    instance.fmi2GetFMUstate(instance.component, fmpy.fmi2.byref(state))
    assert state.value == place
    assert instance.serializeFMUstate(state) != before


def test_bytes_of_a_state_may_have_more_room_than_they_need(instance: FMU2Instance) -> None:
    state = instance.getFMUstate()
    data = instance.serializeFMUstate(state)
    for room in (len(data), len(data) + 3):
        buffer = ctypes.create_string_buffer(b"?" * (len(data) + 8), len(data) + 8)
        instance.fmi2SerializeFMUstate(instance.component, state, buffer, room)
        assert buffer.raw == data + b"?" * 8
    assert f"a state needs {len(data)} bytes, there are {len(data) - 1}" in instance.refusal(
        lambda: instance.fmi2SerializeFMUstate(instance.component, state, buffer, len(data) - 1)
    )


def test_a_damaged_state_is_refused(instance: FMU2Instance) -> None:
    data = instance.serializeFMUstate(instance.getFMUstate())
    for i in range(len(data)):
        for bit in (0x01, 0x80):
            damaged = data[:i] + bytes([data[i] ^ bit]) + data[i + 1 :]
            message = instance.refusal(lambda damaged=damaged: instance.deSerializeFMUstate(damaged))
            assert message == "pendulum: cannot restore the state: the bytes are damaged (wrong checksum)"
    for wrong in (data[:-1], data + b"\0", b""):
        assert f"the bytes are damaged ({len(wrong)}, not {len(data)})" in instance.refusal(
            lambda wrong=wrong: instance.deSerializeFMUstate(wrong)
        )


@pytest.mark.parametrize(
    ("at", "patch", "words"),
    [
        (
            4,
            b"DampedPendulumNative 0.0.0\0",
            f"of 'DampedPendulumNative 0.0.0', this is '{INTERFACE.state_format(native.MODEL_NAME)}'",
        ),
        (-8, struct.pack("=q", 9), "no instance can be in it"),  # the mode
        (64 + 8 * VR["solver.nfev"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * VR["phi"], struct.pack("=d", inf), "no instance can be in it"),
        (64 + 8 * VR["m"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * VR["solver.method"], struct.pack("=d", nan), "no instance can be in it"),
        (64 + 8 * VR["solver.method"], struct.pack("=d", 2.5), "no instance can be in it"),
        (64 + 8 * VR["solver.nfev"], struct.pack("=d", 0.5), "no instance can be in it"),
        (64 + 8 * len(VARIABLES) + 8, struct.pack("=d", nan), "no instance can be in it"),  # der2(tau)
        (64 + 8 * len(VARIABLES) + 24, struct.pack("=d", -H), "no instance can be in it"),  # the time since
        (-32, struct.pack("=d", nan), "no instance can be in it"),  # the time
        (-24, struct.pack("=d", inf), "no instance can be in it"),  # the start time
        (-16, struct.pack("=d", -1.0), "no instance can be in it"),  # the stop time
    ],
)
def test_a_state_with_the_right_checksum_is_refused_too(
    instance: FMU2Instance, at: int, patch: bytes, words: str
) -> None:
    initialized(instance)
    forged = bytearray(instance.serializeFMUstate(instance.getFMUstate()))
    start = at % len(forged)
    forged[start : start + len(patch)] = patch
    forged[:4] = struct.pack("=I", zlib.crc32(forged[4:]))
    assert words in instance.refusal(lambda: instance.deSerializeFMUstate(bytes(forged)))


def test_a_state_before_the_first_step_has_no_step_behind_it(instance: FMU2Instance) -> None:
    forged = bytearray(instance.serializeFMUstate(instance.getFMUstate()))
    at = 64 + 8 * len(VARIABLES) + 24
    forged[at : at + 8] = struct.pack("=d", H)
    forged[:4] = struct.pack("=I", zlib.crc32(forged[4:]))
    assert "no instance can be in it" in instance.refusal(lambda: instance.deSerializeFMUstate(bytes(forged)))


# Derivatives


def driven(t: mpmath.mpf) -> mpmath.mpf:
    """Return the torque of the default pendulum with gamma = 0.5 under which phi(t) is `driven_angle`."""
    phi = driven_angle
    return mpmath.diff(phi, t, 2) + 0.5 * mpmath.diff(phi, t) + 9.80665 * mpmath.sin(phi(t))


def driven_angle(t: mpmath.mpf) -> mpmath.mpf:
    return 0.5 + 0.4 * mpmath.sin(1.3 * t)


@pytest.fixture(scope="module")
def torque() -> Callable[[float], list[float]]:
    """Return tau [N.m] and its derivatives of order 1 to 3 at a time, each computed once."""
    known: dict[float, list[float]] = {}

    def at(t: float) -> list[float]:
        if t not in known:
            with mpmath.workdps(30):
                known[t] = [float(c * mpmath.factorial(k)) for k, c in enumerate(mpmath.taylor(driven, t, 3))]
        return known[t]

    return at


def driven_error(
    instance: FMU2Instance, method: int, steps: int, torque: Callable[[float], list[float]], orders: int
) -> float:
    """Return |phi - exact| after 1 s of `steps` communication steps, one substep each."""
    step = 1.0 / steps
    start = {"gamma": 0.5, "phi_start": 0.5, "w_start": 0.4 * 1.3}
    instance.start(start | {"solver.method": method, "solver.stepSize": step})
    for i in range(steps):
        tau, *derivatives = torque(i * step)
        instance.set("tau", tau)
        instance.input_derivatives(dict(enumerate(derivatives[:orders], start=1)))
        instance.doStep(i * step, step)
    return abs(instance.get("phi")[0] - float(driven_angle(mpmath.mpf(1))))


@pytest.mark.parametrize("method", SolverMethod)
def test_with_input_derivatives_a_driven_run_has_the_order_of_the_method(
    instance: FMU2Instance, method: SolverMethod, torque: Callable[[float], list[float]]
) -> None:
    coarse, fine = (driven_error(instance, method, steps, torque, 3) for steps in (32, 64))
    # The next term of the error changes the observed order by O(H), H = 1/32.
    assert log2(coarse / fine) == pytest.approx(METHODS[method].order, abs=0.25)


@pytest.mark.parametrize(
    ("method", "nodes"),
    [
        (1, {0.0: 1.0}),  # weights of the quadrature over a substep, by place in it
        (2, {0.5: 1.0}),
        (3, {0.0: 1 / 6, 0.5: 4 / 6, 1.0: 1 / 6}),
        (4, {1.0: 1.0}),
    ],
)
def test_a_free_mass_shows_at_which_times_a_method_takes_the_torque(
    instance: FMU2Instance, method: int, nodes: dict[float, float]
) -> None:
    """Without gravity and damping J*w is the sum of the torques at the nodes of the substeps."""
    n, h = 4, 0.25
    instance.start(
        {"m": 2.0, "gamma": 0.0, "g": 0.0, "solver.method": method, "solver.stepSize": h, "tau": 1.0}
    )
    instance.input_derivatives({1: 2.0, 2: -6.0, 3: 24.0})
    instance.doStep(0.0, n * h)
    torques = [
        weight * (1 + 2 * t - 3 * t**2 + 4 * t**3)
        for i in range(n)
        for place, weight in nodes.items()
        for t in ((i + place) * h,)
    ]
    assert instance.get("w")[0] == pytest.approx(h * sum(torques) / 2.0, rel=1e-15 * len(torques))


def test_without_input_derivatives_the_torque_is_held(
    instance: FMU2Instance, torque: Callable[[float], list[float]]
) -> None:
    coarse, fine = (driven_error(instance, 3, steps, torque, 0) for steps in (32, 64))
    assert log2(coarse / fine) == pytest.approx(1.0, abs=0.25)


def test_input_derivatives_hold_for_one_step(instance: FMU2Instance) -> None:
    def after(second: dict[int, float]) -> list[float]:
        instance.start({"tau": 0.5})
        instance.input_derivatives({1: 3.0})
        instance.doStep(0.0, H)
        instance.input_derivatives(second)
        instance.doStep(H, H)
        return instance.get(*OUTPUTS)

    assert after({}) == after({1: 0.0}) != after({1: 3.0})


RAMP = {"gamma": 0.0, "g": 0.0, "phi_start": 0.0, "tau": 1.0}


def derivatives(instance: FMU2Instance) -> list[float]:
    """Return der(phi), der(w), der(a), der(E), and those of order 2."""
    return [instance.output_derivative(name, order) for order in (1, 2) for name in OUTPUTS]


def test_what_is_read_after_a_step_belongs_to_its_end(instance: FMU2Instance) -> None:
    """tau = 1 + 3*t on J = 1 alone: w = t + 1.5*t^2, E = w^2/2; every number is exact in binary."""
    instance.start(RAMP)
    instance.input_derivatives({1: 3.0})
    assert derivatives(instance) == [0.0, 1.0, 3.0, 0.0, 1.0, 3.0, 0.0, 1.0]
    instance.doStep(0.0, 0.5)
    assert instance.get("w", "a", "tau") == [pytest.approx(0.875, rel=1e-13), 2.5, 1.0]
    expected = [0.875, 2.5, 3.0, 2.1875, 2.5, 3.0, 0.0, 2.5**2 + 0.875 * 3.0]
    assert derivatives(instance) == pytest.approx(expected, rel=1e-13, abs=0)
    instance.terminate()
    assert derivatives(instance) == pytest.approx(expected, rel=1e-13, abs=0)
    assert instance.get("a") == [2.5]


def test_all_coefficients_of_the_torque_count_at_the_end_of_a_step(instance: FMU2Instance) -> None:
    """tau = 1 + 2*t - 3*t^2 + 4*t^3 on J = 2: 1.75 at t = 0.5 with the derivatives 2 and 6."""
    instance.start(RAMP | {"m": 2.0})
    instance.input_derivatives({1: 2.0, 2: -6.0, 3: 24.0})
    instance.doStep(0.0, 0.5)
    assert instance.get("a") == [1.75 / 2]
    assert [instance.output_derivative("w", 2), instance.output_derivative("a", 2)] == [1.0, 3.0]


def test_the_torque_goes_on_until_it_is_set_anew(instance: FMU2Instance) -> None:
    def after_a_step() -> None:
        instance.start(RAMP)
        instance.input_derivatives({1: 3.0, 2: 1.0})
        instance.doStep(0.0, 0.5)

    after_a_step()
    instance.set("tau", 4.0)
    assert instance.get("a") == [4.0]
    assert instance.output_derivative("w", 2) == 0.0
    after_a_step()
    instance.input_derivatives({1: 7.0})
    assert instance.get("a") == [1.0]
    assert [instance.output_derivative(name, 2) for name in ("w", "a")] == [7.0, 0.0]
    after_a_step()
    instance.doStep(0.5, 0.5)  # nothing is set: tau is held as it was set
    assert instance.get("a", "tau") == [1.0, 1.0]
    assert instance.get("w")[0] == pytest.approx(0.875 + 0.5**3 / 6 + 0.5, rel=1e-13, abs=0)


def test_tau_and_its_derivatives_may_be_set_in_any_order(instance: FMU2Instance) -> None:
    def after(*orders: int) -> list[float]:
        instance.start(RAMP | {"g": 9.8})
        instance.input_derivatives({2: 5.0})
        instance.doStep(0.0, H)
        for order in orders:
            if order == 0:
                instance.set("tau", 4.0)
            else:
                instance.input_derivatives({order: 10.0 * order})
        instance.doStep(H, H)
        return instance.get(*OUTPUTS)

    assert after(0, 1, 3) == after(1, 0, 3) == after(3, 1, 0) != after(0, 1)


def test_a_step_that_fails_leaves_the_torque_of_the_last_one(instance: FMU2Instance) -> None:
    instance.start(RAMP, stop=1.0)
    instance.input_derivatives({1: 3.0})
    instance.doStep(0.0, 0.5)
    before = [*instance.get(*OUTPUTS), *derivatives(instance)]
    instance.refusal(lambda: instance.doStep(0.5, 1.0))
    instance.refusal(lambda: instance.doStep(0.5, -1.0))
    assert [*instance.get(*OUTPUTS), *derivatives(instance)] == before


def test_a_state_keeps_the_torque_of_the_last_step(
    instance: FMU2Instance, folder: Path, description: Any
) -> None:
    instance.start(RAMP | {"g": 9.8})
    instance.input_derivatives({1: 3.0, 2: -2.0, 3: 5.0})
    instance.doStep(0.0, 0.5)
    expected = [*instance.get(*OUTPUTS), *derivatives(instance)]
    state = instance.getFMUstate()
    data = instance.serializeFMUstate(state)
    instance.doStep(0.5, 0.25)
    instance.setFMUstate(state)
    assert [*instance.get(*OUTPUTS), *derivatives(instance)] == expected
    instance.doStep(0.5, 0.25)
    future = [*instance.get(*OUTPUTS), *derivatives(instance)]
    other = FMU2Instance(folder, description)
    other.setFMUstate(other.deSerializeFMUstate(data))
    assert [*other.get(*OUTPUTS), *derivatives(other)] == expected
    other.doStep(0.5, 0.25)
    assert [*other.get(*OUTPUTS), *derivatives(other)] == future
    other.fmi2FreeInstance(other.component)


def sine_errors(instance: FMU2Instance, steps: int) -> list[float]:
    """Return the worst errors of w, a, der(a), der(E) at the ends of the steps of a second under tau = sin(3*t)."""
    step = 1.0 / steps
    instance.start(RAMP | {"solver.stepSize": step})
    worst = [0.0] * 4
    for i in range(steps):
        with mpmath.workdps(30):
            t, end = mpmath.mpf(i) / steps, mpmath.mpf(i + 1) / steps
            taus = [float(3**k * mpmath.sin(3 * t + k * mpmath.pi / 2)) for k in range(4)]
            w, tau = (1 - mpmath.cos(3 * end)) / 3, mpmath.sin(3 * end)
            exact = [float(value) for value in (w, tau, 3 * mpmath.cos(3 * end), w * tau)]
        instance.set("tau", taus[0])
        instance.input_derivatives(dict(enumerate(taus[1:], start=1)))
        instance.doStep(i * step, step)
        found = [*instance.get("w", "a"), *(instance.output_derivative(name, 1) for name in ("a", "E"))]
        worst = [max(e, abs(x - y)) for e, x, y in zip(worst, found, exact, strict=True)]
    return worst


def test_outputs_of_a_driven_run_are_as_exact_as_its_torque(instance: FMU2Instance) -> None:
    """The torque of a step is a Taylor polynomial of degree 3: its error is of order 4, that of its derivative 3."""
    coarse, fine = sine_errors(instance, 16), sine_errors(instance, 32)
    orders = [log2(c / f) for c, f in zip(coarse, fine, strict=True)]
    # The next term of the error changes the observed order by O(3*H), H = 1/16.
    assert orders == [pytest.approx(order, abs=0.25) for order in (4, 4, 3, 4)]
    # At most (3*H)^4/24 and 3*(3*H)^3/6 from the torque.
    assert fine[1] <= (3 / 32) ** 4 / 24
    assert fine[2] <= 3 * (3 / 32) ** 3 / 6


def test_the_time_of_a_divergence_is_that_under_the_torque_of_the_step(instance: FMU2Instance) -> None:
    """With tau = 1e307*(1 + t) the implicit method sums phi up to 1.797e308 in 3.9 s; held, the torque takes 6 s."""
    w = phi = Fraction(0)
    count = 0
    while phi * 10**307 <= Fraction(sys.float_info.max):
        count += 1
        w += Fraction(1, 10) * (1 + Fraction(count, 10))
        phi += Fraction(1, 10) * w
    assert count == 39
    instance.start(RAMP | {"solver.method": 4, "solver.stepSize": 0.1, "tau": 1e307})
    instance.input_derivatives({1: 1e307})
    message = instance.refusal(lambda: instance.doStep(0.0, 8.0))
    assert f"diverged at t = {39 * 0.1!r} s: substep 39 of 0.1 s " in message


@pytest.mark.parametrize(
    ("order", "value", "words"),
    [
        (0, 1.0, "(allowed: 1..3)"),
        (4, 1.0, "(allowed: 1..3)"),
        (2, nan, "order 2 of tau = nan (allowed: finite)"),
    ],
)
def test_wrong_input_derivatives_are_refused(
    instance: FMU2Instance, order: int, value: float, words: str
) -> None:
    assert words in instance.refusal(lambda: instance.input_derivatives({order: value}))


def test_output_derivatives_are_of_outputs_alone(instance: FMU2Instance) -> None:
    instance.start({})
    for name in ("m", "tau"):
        assert instance.unwritten(lambda value, name=name: instance.output_derivative(name, 1, value), 1) == (
            f"pendulum: {name} is not an output"
        )
    for order in (0, 3):
        assert "of a (allowed: 1..2)" in instance.unwritten(
            lambda value, order=order: instance.output_derivative("a", order, value), 1
        )


def test_output_derivatives_that_are_not_finite_are_refused_and_none_is_written(
    instance: FMU2Instance,
) -> None:
    instance.start({"w_start": 1e200})
    references = (fmpy.fmi2.fmi2ValueReference * 2)(VR["phi"], VR["a"])
    orders = (fmpy.fmi2.fmi2Integer * 2)(1, 2)
    message = instance.unwritten(  # der2(a) has a term w02*sin(phi)*w^2
        lambda values: instance.fmi2GetRealOutputDerivatives(
            instance.component, references, 2, orders, values
        ),
        2,
    )
    assert message == "pendulum: derivative of order 2 of a is out of the range of a double"


def test_derivatives_of_the_energy_are_those_of_torque_and_drag(instance: FMU2Instance) -> None:
    """der(E) = (tau - gamma*L^2*w)*w, and J*a = tau - gamma*L^2*w - m*g*L*sin(phi)."""
    m, L, gamma, g, phi, w, tau, rate = 2.0, 0.7, 0.5, 9.0, 0.9, -1.2, 0.3, 0.4
    instance.start({"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau})
    instance.input_derivatives({1: rate})
    a = (tau - gamma * L**2 * w - m * g * L * float(mpmath.sin(phi))) / (m * L**2)
    power = (tau - gamma * L**2 * w) * w
    change = (rate - gamma * L**2 * a) * w + (tau - gamma * L**2 * w) * a
    assert instance.output_derivative("E", 1) == pytest.approx(power, rel=1e-14, abs=0)
    assert instance.output_derivative("E", 2) == pytest.approx(change, rel=1e-14, abs=0)


def test_output_derivatives_are_those_of_the_trajectory(instance: FMU2Instance) -> None:
    """Central differences of steps of h have an error of h^2/6 and h^2/12 times a derivative of order 100."""
    h, rate, curvature = 1e-3, 2.0, -7.0  # of tau
    instance.start({"gamma": 0.5, "solver.stepSize": h, "tau": 0.3})
    samples, derivatives = [instance.get(*OUTPUTS)], []
    for i in range(2):
        t = i * h
        instance.set("tau", 0.3 + rate * t + curvature * t * t / 2)
        instance.input_derivatives({1: rate + curvature * t, 2: curvature})
        derivatives = [[instance.output_derivative(name, order) for name in OUTPUTS] for order in (1, 2)]
        instance.doStep(t, h)
        t = (i + 1) * h
        instance.set("tau", 0.3 + rate * t + curvature * t * t / 2)
        samples.append(instance.get(*OUTPUTS))
    for i in range(len(OUTPUTS)):
        before, at, after = (sample[i] for sample in samples)
        assert derivatives[0][i] == pytest.approx((after - before) / (2 * h), abs=100 * h * h)
        assert derivatives[1][i] == pytest.approx((after - 2 * at + before) / (h * h), abs=100 * h * h)


def test_directional_derivatives_are_those_of_the_outputs(instance: FMU2Instance) -> None:
    """Central differences with d = 1e-5 have an error of d^2 times a derivative and of 1e-16/d: below 1e-8."""
    d = 1e-5
    base = {"m": 2.0, "L": 0.7, "gamma": 0.5, "phi_start": 0.9, "w_start": -1.2, "tau": 0.3}

    def outputs(known: str, shift: float) -> list[float]:
        instance.start(base | {known: base[known] + shift})
        return instance.get(*OUTPUTS)

    for known, varied in (("phi", "phi_start"), ("w", "w_start"), ("tau", "tau")):
        pairs = zip(outputs(varied, d), outputs(varied, -d), strict=True)
        expected = [(high - low) / (2 * d) for high, low in pairs]
        instance.start(base)
        found = instance.getDirectionalDerivative([VR[name] for name in OUTPUTS], [VR[known]], [1.0])
        assert found == pytest.approx(expected, abs=1e-7)
    together = instance.getDirectionalDerivative([VR["a"]], [VR["phi"], VR["tau"]], [2.0, -3.0])
    singly = [instance.getDirectionalDerivative([VR["a"]], [VR[name]], [1.0])[0] for name in ("phi", "tau")]
    assert together == [pytest.approx(2 * singly[0] - 3 * singly[1], rel=1e-15)]
    assert "phi, w, tau" in instance.refusal(lambda: instance.partial("a", "m"))
    assert "phi, w, tau" in instance.refusal(lambda: instance.partial("tau", "phi"))
    instance.reset()
    assert "in mode instantiated" in instance.refusal(lambda: instance.partial("a", "tau"))


def test_directional_derivatives_outlive_the_run(instance: FMU2Instance) -> None:
    instance.start({"m": 2.0, "tau": 0.3})
    instance.doStep(0.0, H)
    arguments = [VR[name] for name in OUTPUTS], [VR[name] for name in ("phi", "w", "tau")], [2.0, 3.0, 5.0]
    before = instance.getDirectionalDerivative(*arguments)
    instance.terminate()
    assert instance.getDirectionalDerivative(*arguments) == before
    assert "phi, w, tau" in instance.refusal(lambda: instance.partial("a", "m"))


def readable(lowest: float, highest: float) -> Any:
    """Return a strategy of numbers with few digits, at which mpmath's differences are exact to many."""
    return st.floats(lowest, highest).map(lambda value: round(value, 6))


KNOWNS = ("m", "L", "gamma", "g", "phi_start", "w_start", "solver.stepSize", "tau")


def exact_outputs(m: Any, L: Any, gamma: Any, g: Any, phi: Any, w: Any, h: Any, tau: Any) -> list[Any]:
    """Return phi, w, a, E of the parameters `KNOWNS` at the beginning."""
    a = tau / (m * L**2) - gamma / m * w - g / L * mpmath.sin(phi)
    return [phi, w, a, m * L**2 * w**2 / 2 + m * g * L * (1 - mpmath.cos(phi)) + 0 * h]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    m=st.floats(1e-3, 1e3),
    L=st.floats(1e-2, 1e2),
    gamma=readable(0.0, 10.0),
    g=readable(-20.0, 20.0),
    phi=readable(-4.0, 4.0),
    w=readable(-5.0, 5.0),
    tau=readable(-10.0, 10.0),
)
def test_in_initialization_mode_directional_derivatives_are_by_the_parameters(
    shared: FMU2Instance, m: float, L: float, gamma: float, g: float, phi: float, w: float, tau: float
) -> None:
    """A partial has three terms at most, each rounded to a few 1e-16 of itself."""
    point = (m, L, gamma, g, phi, w, 1e-3, tau)
    shared.reset()
    for name, value in zip(KNOWNS, point, strict=True):
        shared.set(name, value)
    shared.enterInitializationMode()
    with mpmath.workdps(40):
        for i, known in enumerate(KNOWNS):
            for j, unknown in enumerate(OUTPUTS):

                def along(x: Any, i: int = i, j: int = j) -> Any:
                    return exact_outputs(*(x if k == i else mpmath.mpf(v) for k, v in enumerate(point)))[j]

                expected = float(mpmath.diff(along, mpmath.mpf(point[i])))
                terms = (
                    abs(tau / (m * L * L))
                    + abs(gamma / m * w)
                    + abs(g / L)
                    + m * (L * w) ** 2
                    + m * abs(g) * L
                )
                bound = 1e-14 * terms * (1 + 1 / m + 1 / L)
                assert shared.partial(unknown, known) == pytest.approx(expected, rel=1e-14, abs=bound)
    assert "by Real parameters, tau" in shared.refusal(lambda: shared.partial("a", "phi"))
    assert "not of type Real" in shared.refusal(lambda: shared.partial("a", "solver.method"))


def test_directional_derivatives_replace_what_the_host_had(instance: FMU2Instance) -> None:
    instance.start({})
    values = (fmpy.fmi2.fmi2Real * 1)(7.0)
    reference = fmpy.fmi2.fmi2ValueReference
    for knowns, expected in ((1, 1.0), (0, 0.0)):
        instance.fmi2GetDirectionalDerivative(
            instance.component,
            (reference * 1)(VR["phi"]),
            1,
            (reference * 1)(VR["phi"]),
            knowns,
            (fmpy.fmi2.fmi2Real * 1)(1.0),
            values,
        )
        assert list(values) == [expected]


@pytest.mark.parametrize(
    ("unknowns", "knowns", "direction", "words"),
    [
        (["phi", "a"], ["phi"], 1.7e308, "directional derivative of a is out of the range of a double"),
        (["phi", "a"], ["phi"], nan, "directional derivative of phi is out of the range of a double"),
        (
            ["phi", "m"],
            ["phi"],
            1.0,
            "no derivative of m with respect to phi (allowed: of outputs by phi, w, tau)",
        ),
        (["phi"] * 257, ["phi"] * 256, 1.0, "257 unknowns by 256 knowns in one call (allowed: at most 65536"),
        (["phi"] * 65536, ["w"] * 65536, 1.0, "65536 unknowns by 65536 knowns in one call"),
    ],
)
def test_of_refused_directional_derivatives_none_is_written(
    instance: FMU2Instance, unknowns: list[str], knowns: list[str], direction: float, words: str
) -> None:
    instance.start({"phi_start": 0.1})
    references = [
        (fmpy.fmi2.fmi2ValueReference * len(names))(*(VR[name] for name in names))
        for names in (unknowns, knowns)
    ]
    message = instance.unwritten(
        lambda values: instance.fmi2GetDirectionalDerivative(
            instance.component,
            references[0],
            len(unknowns),
            references[1],
            len(knowns),
            (fmpy.fmi2.fmi2Real * len(knowns))(*[direction] * len(knowns)),
            values,
        ),
        len(unknowns),
    )
    assert message.startswith(f"pendulum: {words}")


# Other importers


@pytest.fixture(scope="session")
def final_angle(fmu_path: Path) -> float:
    """Of the default experiment, by the FMU with Python in FMPy."""
    return float(fmpy.simulate_fmu(str(fmu_path), output=["phi"])["phi"][-1])


def printed(command: list[Any], **named: Any) -> float:
    done = subprocess.run(command, capture_output=True, text=True, check=False, **named)
    assert done.returncode == 0, done.stdout + done.stderr
    return float(re.findall(r"^phi (.*)$", done.stdout, re.MULTILINE)[0])


@on_linux
@needs_compiler
def test_a_host_in_c_needs_no_python(
    folder: Path, description: Any, tmp_path: Path, final_angle: float
) -> None:
    host = tmp_path / "host"
    options = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    subprocess.run([COMPILER, *options, HERE / "native_host.c", "-o", host, "-ldl"], check=True)
    library = folder / "binaries" / fmpy.platform / f"{native.MODEL_NAME}{fmpy.sharedLibraryExtension}"
    assert printed([host, library, description.guid, str(VR["phi"])]) == pytest.approx(final_angle, abs=1e-12)


@pytest.fixture(scope="session")
def jars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the Java importers of pom.xml from Maven Central."""
    for tool in ("java", "mvn"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    folder = tmp_path_factory.mktemp("jars")
    command = ["mvn", "-q", "-B", "-f", IMPORTERS / "pom.xml", "dependency:copy-dependencies"]
    command += [f"-DoutputDirectory={folder}", "-Dmdep.stripVersion=true"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"mvn cannot get the importers: {done.stdout.strip().splitlines()[:1]}")
    return folder


@on_linux
@pytest.mark.slow
@pytest.mark.parametrize("program", ["Fmi4j.java", "JavaFmi.java"])
def test_importers_in_java_agree_and_load_no_python(
    native_path: Path, jars: Path, program: str, final_angle: float
) -> None:
    # JavaFMI reaches into java.prefs for a chmod.
    options = ["--add-opens", "java.prefs/java.util.prefs=ALL-UNNAMED", "-cp", f"{jars}/*"]
    command = ["java", *options, IMPORTERS / program, native_path, str(VR["phi"])]
    assert printed(command) == pytest.approx(final_angle, abs=1e-12)


def test_fmpy_compile_rebuilds_the_binary(native_path: Path, tmp_path: Path, final_angle: float) -> None:
    if shutil.which("cmake", path=search_path()) is None:
        pytest.skip("cmake is not installed")
    copy = tmp_path / "copy.fmu"
    entries = build_fmu.read_entries(native_path)
    build_fmu.write_entries(
        copy, {name: data for name, data in entries.items() if not name.startswith("binaries/")}
    )
    program = f"import fmpy.cli, sys; sys.argv = ['fmpy', 'compile', {str(copy)!r}]; fmpy.cli.main()"
    subprocess.run(
        [sys.executable, "-c", program],
        check=True,
        capture_output=True,
        env=os.environ | {"PATH": search_path()},
    )
    assert fmpy.platform in fmpy.supported_platforms(str(copy))
    # The flags are not those of the build, and the bits still are.
    assert float(fmpy.simulate_fmu(str(copy), output=["phi"])["phi"][-1]) == final_angle


def search_path() -> str:
    return os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))


# Compiler and sanitizers


@on_linux
def test_the_library_exports_the_functions_of_fmi_alone(folder: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    exported, needed = symbols(folder / "binaries" / "linux64" / "DampedPendulumNative.so")
    header = (native.FMI_HEADERS / "fmi2Functions.h").read_text("utf-8")
    common, _, co_simulation = re.split("Functions for FMI2 for (?:Model Exchange|Co-Simulation)", header)[:3]
    assert exported == set(re.findall(r"#define (fmi2\w+) +fmi2FullName", common + co_simulation))
    assert not [name for name in needed if "Py" in name]


@needs_compiler
@on_linux
def test_no_global_can_change(folder: Path, tmp_path: Path) -> None:
    """Instances in several threads share constants alone."""
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    for source in native.SOURCES:
        output = tmp_path / "object.o"
        command = [
            COMPILER,
            "-std=c11",
            "-O0",
            "-fno-pic",
            f"-I{native.FMI_HEADERS}",
            "-c",
            source,
            "-o",
            output,
        ]
        subprocess.run(command, cwd=folder / "sources", check=True)
        listed = subprocess.run(["nm", output], capture_output=True, text=True, check=True).stdout
        assert not re.findall(r"^\S* [bBcCdDgGsS] .*$", listed, re.MULTILINE)


def symbols(library: Path) -> tuple[set[str], set[str]]:
    """Return the names that a library defines, and those that it needs, with their versions."""
    lines = subprocess.run(
        ["nm", "-D", library], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    names = [line.split()[-2:] for line in lines]
    return {name for kind, name in names if kind == "T"}, {name for kind, name in names if kind == "U"}


def images(universal: bytes) -> list[bytes]:
    """Return the images in a universal Mach-O file."""
    count = struct.unpack_from(">I", universal, 4)[0]
    places = [struct.unpack_from(">II", universal, 8 + 20 * i + 8) for i in range(count)]
    return [universal[at : at + size] for at, size in places]


def least_macos(image: bytes) -> tuple[int, int]:
    """Return the oldest version of macOS that a 64-bit Mach-O image runs on."""
    at = 32
    for _ in range(struct.unpack_from("<I", image, 16)[0]):
        command, size, first, second = struct.unpack_from("<IIII", image, at)
        if command in (0x24, 0x32):  # LC_VERSION_MIN_MACOSX, LC_BUILD_VERSION
            version = first if command == 0x24 else second
            if command == 0x32:
                version = struct.unpack_from("<I", image, at + 12)[0]
            return version >> 16, version >> 8 & 0xFF
        at += size
    raise AssertionError("no version")


@pytest.mark.slow
def test_every_platform_is_built_on_this_machine(tmp_path: Path, native_path: Path) -> None:
    if find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed")
    path = build_fmu.build_native(tmp_path / "all.fmu")
    entries = build_fmu.read_entries(path)
    binaries = {name.split("/")[1]: data for name, data in entries.items() if name.startswith("binaries/")}
    magic = {"linux64": b"\x7fELF", "win64": b"MZ", "darwin64": b"\xca\xfe\xba\xbe\0\0\0\2"}
    assert {platform: data[: len(magic[platform])] for platform, data in binaries.items()} == magic
    assert validate_fmu(str(path)) == []
    assert build_fmu.build_native(tmp_path / "again.fmu").read_bytes() == path.read_bytes()
    assert [least_macos(image) for image in images(binaries["darwin64"])] == [(11, 0), (11, 0)]
    host, everywhere = (build_fmu.read_entries(p)["modelDescription.xml"] for p in (native_path, path))
    assert host == everywhere  # the GUID is that of the sources
    if sys.platform.startswith("linux"):
        library = tmp_path / "library.so"
        library.write_bytes(binaries["linux64"])
        exported, needed = symbols(library)
        assert {name[:4] for name in exported} == {"fmi2"}
        versions = {tuple(map(int, name.split("GLIBC_")[1].split("."))) for name in needed if "GLIBC" in name}
        assert max(versions) <= (2, 17)
        runs = [fmpy.simulate_fmu(str(p), output=OUTPUTS) for p in (native_path, path)]
        assert (runs[0] == runs[1]).all()


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_sources_compile_without_a_warning(folder: Path, compiler: str) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    options = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow"]
    options += ["-Wcast-qual", "-Wnull-dereference", "-c", "-o", os.devnull]
    for standard, level in (("c11", "-O0"), ("c11", "-O3"), ("c17", "-O2")):
        command = [compiler, f"-std={standard}", level, *options, f"-I{native.FMI_HEADERS}", *native.SOURCES]
        done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
def test_the_sources_refuse_to_be_compiled_without_nan(folder: Path, compiler: str, flag: str) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    command = [compiler, "-std=c11", flag, "-fsyntax-only", f"-I{native.FMI_HEADERS}", *native.SOURCES]
    done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "those take out the tests for NaN and infinity" in done.stderr


def standard_headers(folder: Path) -> Path:
    """Write the headers as the standard has them, with the prefix that those of FMPy leave out."""
    folder.mkdir()
    for path in native.FMI_HEADERS.glob("fmi2*.h"):
        text = path.read_text("utf-8")
        if path.name == "fmi2Functions.h":
            text, count = re.subn(
                r"^#define fmi2FullName\(name\).*$",
                "#if !defined(FMI2_OVERRIDE_FUNCTION_PREFIX) && defined(FMI2_FUNCTION_PREFIX)\n"
                "#define fmi2Paste(a,b) a ## b\n"
                "#define fmi2PasteB(a,b) fmi2Paste(a,b)\n"
                "#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)\n"
                "#else\n"
                "#define fmi2FullName(name) name\n"
                "#endif",
                text,
                flags=re.MULTILINE,
            )
            assert count == 1
        (folder / path.name).write_text(text, "utf-8")
    return folder


def global_names(file: Path) -> set[str]:
    listed = subprocess.run(["nm", "-g", "--defined-only", file], capture_output=True, text=True, check=True)
    return {line.split()[-1] for line in listed.stdout.splitlines()}


@needs_compiler
@on_linux
def test_the_sources_of_two_fmus_link_into_one_program(folder: Path, tmp_path: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    headers, sources = standard_headers(tmp_path / "fmi"), folder / "sources"
    listed = ElementTree.parse(folder / "modelDescription.xml").getroot().iter("File")
    assert [node.get("name") for node in listed] == ["all.c"]
    names = {}
    for name, flags in {
        "A_": ["-DFMI2_FUNCTION_PREFIX=A_"],
        "B_": ["-DFMI2_FUNCTION_PREFIX=B_"],
        f"{native.MODEL_NAME}_": [],
        "": ["-DFMI2_OVERRIDE_FUNCTION_PREFIX"],
    }.items():
        output = tmp_path / f"{name}.o"
        options = ["-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-pedantic", *flags, f"-I{headers}"]
        subprocess.run([COMPILER, *options, "-c", sources / "all.c", "-o", output], check=True)
        names[name] = global_names(output)
    assert len(names[""]) == 34
    for prefix, found in names.items():
        assert found == {prefix + name for name in names[""]}
    program = tmp_path / "program"
    command = [COMPILER, "-std=c11", f"-I{headers}", f"-I{sources}", HERE / "native_linked_twice.c"]
    command += [tmp_path / "A_.o", tmp_path / "B_.o", "-lm", "-o", program]
    subprocess.run(command, check=True)
    assert subprocess.run([program], capture_output=True, text=True, check=True).stdout == "2.0 2.0 21\n"
    # The library of the build, with headers of either kind, has the names of the standard.
    for include in (headers, native.FMI_HEADERS):
        library = tmp_path / "library.so"
        flags = [*native.FLAGS, "-fPIC", "-fvisibility=hidden", "-shared", f"-I{include}"]
        subprocess.run([COMPILER, *flags, sources / "all.c", "-lm", "-o", library], check=True)
        assert symbols(library)[0] == names[""]


@needs_compiler
def test_an_instance_that_there_is_no_memory_for_is_reported(folder: Path, tmp_path: Path) -> None:
    program, sources = tmp_path / "program", folder / "sources"
    command = [COMPILER, "-std=c11", "-Dcalloc=failing_calloc", f"-I{native.FMI_HEADERS}", f"-I{sources}"]
    command += [
        HERE / "native_no_memory.c",
        *(sources / name for name in native.SOURCES),
        "-lm",
        "-o",
        program,
    ]
    subprocess.run(command, check=True)
    done = subprocess.run([program], capture_output=True, text=True, check=True)
    assert done.stdout == "poor 3 logStatusError there is no memory for an instance\n"


@pytest.fixture(scope="session")
def strange_host(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str, str], Path]:
    """Return a function that compiles the strange host with a compiler and a level of optimization."""
    built: dict[tuple[str, str], Path] = {}

    def compiled(compiler: str, level: str) -> Path:
        if not sys.platform.startswith("linux"):
            pytest.skip("Linux only")
        if shutil.which(compiler) is None:
            pytest.skip(f"{compiler} is not installed")
        if (compiler, level) not in built:
            program, sources = tmp_path_factory.mktemp("host") / "host", folder / "sources"
            flags = [flag for flag in native.FLAGS if not flag.startswith("-O")]
            command = [compiler, *flags, level, "-pthread", f"-I{native.FMI_HEADERS}", f"-I{sources}"]
            command += [HERE / "native_strange_host.c", *(sources / name for name in native.SOURCES)]
            done = subprocess.run(
                [*command, "-lm", "-o", program], capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stderr
            built[compiler, level] = program
        return built[compiler, level]

    return compiled


def messages_in(program: Path, condition: str, **environment: str) -> list[str]:
    """Return what is logged in a host of a condition."""
    done = subprocess.run(
        [program, condition], capture_output=True, text=True, check=False, env=os.environ | environment
    )
    assert done.returncode == 0, f"status {done.returncode}: {done.stderr}"
    return done.stdout.splitlines()


BUILDS = [(compiler, level) for compiler in COMPILERS for level in ("-O0", "-O3")]


@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_a_thread_with_a_stack_of_32_kib_can_do_all(strange_host: Any, compiler: str, level: str) -> None:
    program = strange_host(compiler, level)
    messages = messages_in(program, "plain")
    assert len(messages) == 8
    assert messages_in(program, "stack") == messages


@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_only_what_overflows_raises_floating_point_exceptions(
    strange_host: Any, compiler: str, level: str
) -> None:
    program = strange_host(compiler, level)
    assert messages_in(program, "traps") == messages_in(program, "plain")[:-2]


@pytest.mark.parametrize("rounding", ["upward", "downward", "towardzero"])
def test_numbers_in_messages_do_not_follow_the_rounding_of_the_host(strange_host: Any, rounding: str) -> None:
    program = strange_host("gcc", "-O0")
    assert messages_in(program, rounding) == messages_in(program, "plain")[1:-2]


def test_numbers_in_messages_do_not_follow_the_locale_of_the_host(strange_host: Any, tmp_path: Path) -> None:
    if shutil.which("localedef") is None:
        pytest.skip("localedef is not installed")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"localedef cannot make de_DE: {done.stderr.strip()[:200]}")
    program = strange_host("gcc", "-O0")
    german = {"LOCPATH": str(tmp_path), "LC_ALL": "de_DE.UTF-8"}
    assert messages_in(program, "locale", **german) == messages_in(program, "plain")


def test_without_a_compiler_there_is_one_line_and_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "find_spec", lambda name: None)
    monkeypatch.setattr(native.shutil, "which", lambda name: None)
    with pytest.raises(SystemExit) as raised:
        build_fmu.main(["--native", "--output", str(tmp_path / "x.fmu")])
    assert raised.value.code == 2
    assert capsys.readouterr().err == (
        "build_fmu.py: --native: no C compiler: install the package ziglang, or cc, gcc or clang\n"
    )
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_what_the_compiler_refuses_is_printed_and_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "find_spec", lambda name: None)
    monkeypatch.setattr(native, "FLAGS", (*native.FLAGS, "-DVARIABLE_COUNT="))
    assert build_fmu.main(["--native", "--output", str(tmp_path / "x.fmu")]) == 1
    assert "VARIABLE_COUNT" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_zig_has_a_cache_where_that_of_the_user_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "ZIG_GLOBAL_CACHE_DIR"
    file = tmp_path / "file"  # below which no user can write
    file.write_text("", "utf-8")
    for variable in (name, "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(variable, raising=False)
    for home in (file, None):
        if home is None:
            monkeypatch.delenv("HOME")
        else:
            monkeypatch.setenv("HOME", str(home))
        with native.zig_environment() as environment:
            folder = Path(environment[name])
            (folder / "written").write_text("", "utf-8")
        assert not folder.exists()
    monkeypatch.setenv("LOCALAPPDATA" if os.name == "nt" else "HOME", str(tmp_path))
    with native.zig_environment() as environment:
        assert name not in environment
    monkeypatch.setenv(name, "where the user wants it")
    monkeypatch.setenv("HOME", str(file))
    with native.zig_environment() as environment:
        assert environment[name] == "where the user wants it"


@on_linux
@pytest.mark.slow
def test_zig_compiles_without_a_home_that_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed")
    file = tmp_path / "file"
    file.write_text("", "utf-8")
    for variable in ("ZIG_GLOBAL_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(file))
    monkeypatch.setattr(native, "TARGETS", native.TARGETS[:1])
    assert list(native.binaries("guid")) == ["binaries/linux64/DampedPendulumNative.so"]


@on_linux
@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
def test_random_calls_find_no_fault_under_the_sanitizers(folder: Path, tmp_path: Path, compiler: str) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    program = tmp_path / "fuzz"
    options = ["-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    sanitizers = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    files = [HERE / "native_fuzz.c", *native.SOURCES]
    command = [compiler, *options, *sanitizers, "-I.", *files, "-o", program, "-lm"]
    done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    seconds = 60 if os.environ.get("CI") else 5
    environment = os.environ | {"ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"}
    for seed in (1, 2):
        done = subprocess.run(
            [program, str(seed), str(seconds // 2)],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
        )
        assert done.returncode == 0, f"seed {seed}:\n{done.stderr}"
        counts = {name: int(count) for name, count in re.findall(r"(\w+) (\d+)", done.stdout)}
        assert min(counts.values()) > 0, counts  # every status was reached
