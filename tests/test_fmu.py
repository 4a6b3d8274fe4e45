"""The built FMU against the kernel it was made from."""

import subprocess
import sys
from collections.abc import Iterator
from math import pi
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import build_fmu
from damped_pendulum.interface import VARIABLES
from damped_pendulum.model import Pendulum
from methods.solvers import METHODS, SolverMethod, substeps
from tests.twin import longest_substep

REFERENCE = {variable.name: vr for vr, variable in enumerate(VARIABLES)}
OUTPUTS = [REFERENCE[name] for name in ("phi", "w", "a", "E")]


@pytest.fixture(scope="module")
def slave(fmu_path: Path) -> Iterator[FMU2Slave]:
    description = fmpy.read_model_description(str(fmu_path))
    folder = fmpy.extract(str(fmu_path))
    slave = fmpy.instantiate_fmu(folder, description, "CoSimulation")
    yield slave
    slave.freeInstance()


def start(slave: FMU2Slave, values: dict[str, float]) -> None:
    slave.reset()
    slave.setupExperiment(startTime=0.0)
    for name, value in values.items():
        setter = slave.setInteger if name == "solver.method" else slave.setReal
        setter([REFERENCE[name]], [value])
    slave.enterInitializationMode()
    slave.exitInitializationMode()


def outputs(pendulum: Pendulum, phi: float, w: float, tau: float) -> list[float]:
    return [phi, w, pendulum.motion(tau).acceleration()(phi, w), pendulum.energy(phi, w)]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    m=st.floats(0.01, 100),
    L=st.floats(0.01, 100),
    gamma=st.one_of(st.just(0.0), st.floats(0, 1)),
    g=st.sampled_from([0.0, 9.80665, -1.62]),
    phi=st.floats(-4, 4),
    w=st.floats(-5, 5),
    method=st.sampled_from(SolverMethod),
    step=st.floats(1e-4, 0.02),
    torques=st.lists(st.one_of(st.just(0.0), st.floats(-10, 10)), min_size=1, max_size=4),
    H=st.floats(1e-3, 0.05),
)
def test_the_fmu_is_its_kernel_bit_for_bit(
    slave: FMU2Slave,
    m: float,
    L: float,
    gamma: float,
    g: float,
    phi: float,
    w: float,
    method: SolverMethod,
    step: float,
    torques: list[float],
    H: float,
) -> None:
    parameters = {"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w}
    start(slave, parameters | {"solver.method": method, "solver.stepSize": step})
    pendulum, nfev = Pendulum(m, L, gamma, g), 0
    max_step = longest_substep(method, step, pendulum)
    for i, tau in enumerate(torques):
        slave.setReal([REFERENCE["tau"]], [tau])
        assert slave.getReal(OUTPUTS) == outputs(pendulum, phi, w, tau)
        slave.doStep(i * H, H)
        n = substeps(i * H, H, max_step)
        phi, w, evaluations = METHODS[method].solver(pendulum.motion(tau), phi, w, H / n, n)
        nfev += evaluations
        assert slave.getReal(OUTPUTS) == outputs(pendulum, phi, w, tau)
    assert slave.getInteger([REFERENCE["solver.nfev"]]) == [nfev]


def test_outputs_are_right_before_the_first_step(slave: FMU2Slave) -> None:
    expected = outputs(Pendulum(2.0, 0.5, 0.1, 9.0), pi / 3, -1.5, 0.25)
    slave.reset()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    for name, value in (("m", 2.0), ("L", 0.5), ("gamma", 0.1), ("g", 9.0), ("tau", 0.25)):
        slave.setReal([REFERENCE[name]], [value])
    slave.setReal([REFERENCE["phi_start"], REFERENCE["w_start"]], [pi / 3, -1.5])
    assert slave.getReal(OUTPUTS) == expected
    slave.exitInitializationMode()
    assert slave.getReal(OUTPUTS) == expected
    assert slave.getInteger([REFERENCE["solver.nfev"]]) == [0]


def test_the_start_time_changes_nothing_but_the_clock(fmu_path: Path) -> None:
    runs = [
        fmpy.simulate_fmu(str(fmu_path), start_time=begin, stop_time=begin + 1, output_interval=0.125)
        for begin in (0.0, 1024.0)  # binary fractions, so that the steps have the same bits
    ]
    assert (runs[0]["phi"] == runs[1]["phi"]).all()


def test_the_fmu_imports_the_standard_library_and_the_embedded_pythonfmu_only(
    fmu_path: Path, tmp_path: Path
) -> None:
    build_fmu.zipfile.ZipFile(fmu_path).extractall(tmp_path)
    resources = tmp_path / "resources"
    program = f"""
import sys
sys.path.insert(0, {str(resources)!r})
before = set(sys.modules)
name = open({str(resources / "slavemodule.txt")!r}).readline()
slave = __import__(name).DampedPendulum(instance_name="alone")
slave.enter_initialization_mode()
slave.exit_initialization_mode()
assert slave.do_step(0.0, 0.1)
foreign = [n for n in set(sys.modules) - before
           if n.partition(".")[0] not in sys.stdlib_module_names
           and not (getattr(sys.modules[n], "__file__", None) or "").startswith({str(resources)!r})]
assert not foreign, foreign
assert "numpy" not in sys.modules
"""
    # -I -S: neither the environment nor site-packages can help.
    subprocess.run([sys.executable, "-I", "-S", "-c", program], check=True)
