"""The built FMU against the kernel it was made from."""

import subprocess
import sys
from collections.abc import Iterator
from math import pi
from pathlib import Path

import fmpy
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import build_fmu
from methods.solvers import SolverMethod
from tests.driver import OK, Fmu, Instance
from tests.plants import PENDULUM
from tests.twin import Twin


@pytest.fixture(scope="module")
def instance(fmu: Fmu) -> Iterator[Instance]:
    with fmu.instance() as instance:
        yield instance


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    start=st.fixed_dictionaries(
        {
            "m": st.floats(0.01, 100),
            "L": st.floats(0.01, 100),
            "gamma": st.one_of(st.just(0.0), st.floats(0, 1)),
            "g": st.sampled_from([0.0, 9.80665, -1.62]),
            "phi_start": st.floats(-4, 4),
            "w_start": st.floats(-5, 5),
            "solver.method": st.sampled_from(SolverMethod),
            "solver.stepSize": st.floats(1e-4, 0.02),
        }
    ),
    torques=st.lists(st.one_of(st.just(0.0), st.floats(-10, 10)), min_size=1, max_size=4),
    H=st.floats(1e-3, 0.05),
)
def test_the_fmu_is_its_kernel_bit_for_bit(
    instance: Instance, start: dict[str, float], torques: list[float], H: float
) -> None:
    instance.start(start)
    twin = Twin(PENDULUM, start)
    for i, tau in enumerate(torques):
        assert instance.set("tau", tau) == OK
        twin.input = tau
        assert instance.get(*PENDULUM.calculated) == twin.calculated
        assert instance.step(i * H, H) == OK
        twin.step(i * H, H)
        assert instance.get(*PENDULUM.calculated) == twin.calculated


def test_outputs_are_right_before_the_first_step(instance: Instance) -> None:
    start = {"m": 2.0, "L": 0.5, "gamma": 0.1, "g": 9.0, "tau": 0.25, "phi_start": pi / 3, "w_start": -1.5}
    expected = Twin(PENDULUM, start).calculated
    assert instance.reset() == OK
    assert instance.set_up(0.0) == OK
    assert instance.call("fmi2EnterInitializationMode") == OK
    for name, value in start.items():
        assert instance.set(name, value) == OK
    assert instance.get(*PENDULUM.calculated) == expected
    assert instance.call("fmi2ExitInitializationMode") == OK
    assert instance.get(*PENDULUM.calculated) == expected


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
