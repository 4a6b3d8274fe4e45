"""The native FMU: the Python kernel's bits, FMI 2.0 conduct, other importers, safety of the C code."""

import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
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
from damped_pendulum.interface import VARIABLES, VERSION
from damped_pendulum.model import Pendulum
from damped_pendulum.solvers import METHODS, SolverMethod, substeps, unique_root_limit
from native import build as native
from slave import DampedPendulum, FmuError

HERE = Path(__file__).resolve().parent
IMPORTERS = HERE / "native_importers"
VR = {variable.name: vr for vr, variable in enumerate(VARIABLES)}
OUTPUTS = ("phi", "w", "a", "E")
H = 0.01
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
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
        self.instantiate(callbacks=callbacks)

    def set(self, name: str, value: float) -> None:
        (self.setInteger if name == "solver.method" else self.setReal)([VR[name]], [value])

    def get(self, *names: str) -> list[float]:
        return self.getReal([VR[name] for name in names])

    def nfev(self) -> int:
        return self.getInteger([VR["solver.nfev"]])[0]

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

    def input_derivatives(self, values: dict[int, float]) -> None:
        n = len(values)
        self.fmi2SetRealInputDerivatives(
            self.component,
            (fmpy.fmi2.fmi2ValueReference * n)(*[VR["tau"]] * n),
            n,
            (fmpy.fmi2.fmi2Integer * n)(*values),
            (fmpy.fmi2.fmi2Real * n)(*values.values()),
        )

    def output_derivative(self, name: str, order: int) -> float:
        value = (fmpy.fmi2.fmi2Real * 1)()
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
    return (phi, w, nfev) if isfinite(phi) and isfinite(w) else None


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
    3 * unique_root_limit(SolverMethod.ImplicitEuler, 0.0, 9.80665),
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
    h = min(step, unique_root_limit(method, *pendulum.motion()[:2]))
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
def test_numbers_read_as_in_python(shared: FMU2Instance, time: float, step: float) -> None:
    shared.start({})
    assert shared.refusal(lambda: shared.doStep(time, step)) == (
        f"pendulum: no step from t = {time!r} s: communicationStepSize = {step!r} s (allowed: > 0 and finite)"
    )


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
    with pytest.raises(FMICallException, match="discard"):  # it is for steps that were pending
        instance.fmi2GetStatus(instance.component, fmpy.fmi2.fmi2DoStepStatus, by(fmpy.fmi2.fmi2Status()))


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
            f"of 'DampedPendulumNative 0.0.0', this is 'DampedPendulumNative {VERSION}'",
        ),
        (-8, struct.pack("=q", 9), "no instance can be in it"),  # the mode
        (64 + 8 * VR["solver.nfev"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * VR["phi"], struct.pack("=d", inf), "no instance can be in it"),
        (64 + 8 * VR["m"], struct.pack("=d", -1.0), "no instance can be in it"),
        (64 + 8 * VR["solver.method"], struct.pack("=d", nan), "no instance can be in it"),
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
    assert "phi, w, tau" in instance.refusal(
        lambda: instance.getDirectionalDerivative([VR["a"]], [VR["m"]], [1.0])
    )
    instance.reset()
    assert "in mode instantiated" in instance.refusal(
        lambda: instance.getDirectionalDerivative([VR["a"]], [VR["tau"]], [1.0])
    )


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
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_sources_compile_without_a_warning(folder: Path, compiler: str) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    options = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow", "-fsyntax-only"]
    for standard in ("c11", "c17"):
        command = [compiler, f"-std={standard}", "-O2", *options, f"-I{native.FMI_HEADERS}", *native.SOURCES]
        done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


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


def test_the_c_code_is_short() -> None:
    """It is for reading: under 700 lines."""
    files = [path for path in native.FOLDER.iterdir() if path.suffix in (".c", ".h", ".in")]
    assert sum(path.read_text("utf-8").count("\n") for path in files) < 700
    assert all(len(line) <= 120 for path in files for line in path.read_text("utf-8").splitlines())


@on_linux
@needs_compiler
@pytest.mark.slow
def test_random_calls_find_no_fault_under_the_sanitizers(folder: Path, tmp_path: Path) -> None:
    program = tmp_path / "fuzz"
    options = ["-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    files = [HERE / "native_fuzz.c", *native.SOURCES]
    command = [COMPILER, *options, *sanitizers, "-I.", *files, "-o", program, "-lm"]
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
