"""The reason of an error reaches the user, and it can be printed with printf."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_uint
from io import StringIO
from math import nan

import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException, printLogMessage
from hypothesis import given
from hypothesis import strategies as st

from fmi.shell import FmuError
from methods.solvers import SolverMethod
from tests.driver import ERROR, FATAL, OK, Fmu, Instance, is_error
from tests.plants import Plant
from tests.test_conduct_divergence import declared_categories

FAULTS: dict[str, Callable[[Instance], int]] = {
    "parameters": lambda i: i.initialize({i.fmu.plant.mass: -1.0, i.fmu.plant.drag: nan}),
    "order": lambda i: i.call("fmi2ExitInitializationMode"),
    "experiment": lambda i: i.call("fmi2SetupExperiment", 0, 0.0, nan, 0, 0.0),
    "output": lambda i: i.set(i.fmu.plant.x, 1.0),
    "fixed": lambda i: max(i.initialize(), i.set(i.fmu.plant.mass, 1.0)),
    "reference": lambda i: i.set_references("Real", [99], [1.0]),
    "type": lambda i: i.get_references("Integer", [0])[0],
    "string": lambda i: i.call("fmi2GetString", (c_uint * 1)(0), 1, None),
    "step": lambda i: max(i.initialize(), i.step(0.0, -1.0)),
    "input": lambda i: max(i.initialize(), i.set(i.fmu.plant.input, nan), i.step(0.0, 0.01)),
    "divergence": lambda i: max(
        i.initialize(
            i.fmu.plant.pull(0.0)
            | {i.fmu.plant.v_start: 1e308, i.fmu.plant.drag: 0.0, "solver.stepSize": 10.0}
        ),
        i.step(0.0, 10.0),
    ),
    "state": lambda i: i.restore_bytes(b"nothing"),
}


def unstable(plant: Plant) -> dict[str, float]:
    """Return start values with which the default step size is warned of, and the default run still has an end.

    |1 - h*rate| is 1.001, so that what the drag ends grows to e^10 of itself in 10 s.
    """
    return {plant.mass: 1.0, plant.drag: 2001.0, "solver.method": SolverMethod.ExplicitEuler}


each_fault = pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)


@each_fault
def test_an_error_is_logged_in_one_line(fmu: Fmu, fault: Callable[[Instance], int]) -> None:
    with fmu.instance() as instance:
        assert is_error(fault(instance))
        (told,) = (entry for entry in instance.log if is_error(entry.status))
    assert (told.status, told.category) == fmu.error
    assert told.category in {"", *declared_categories(fmu)}
    assert told.text.startswith(f"{fmu.plant.system}: ")
    assert "\n" not in told.text


@each_fault
@pytest.mark.parametrize("logging", [False, True])
def test_an_error_is_told_whether_or_not_there_is_a_log(
    fmu: Fmu, fault: Callable[[Instance], int], logging: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    with fmu.instance(logging=logging) as instance:
        fault(instance)
        told = instance.errors
    lines = capfd.readouterr().err.splitlines()
    assert (len(told), len(lines)) == fmu.places(logging)
    (text,) = {*told, *lines}
    assert text.startswith(f"{fmu.plant.system}: ")


class ClosedPipe(StringIO):
    def write(self, text: str) -> int:
        raise BrokenPipeError


closed = StringIO()
closed.close()


class Deleted(StringIO):
    """As of a graphical host whose window is gone."""

    def write(self, text: str) -> int:
        raise RuntimeError("the object behind this one has been deleted")


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(
    "stderr", [None, closed, ClosedPipe(), Deleted()], ids=["none", "closed", "broken pipe", "deleted"]
)
def test_a_stderr_that_cannot_be_written_does_not_hide_the_reason(
    plant: Plant, stderr: StringIO | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    slave = plant.slave(instance_name="plant")
    monkeypatch.setattr(sys, "stderr", stderr)
    with pytest.raises(FmuError, match=rf"^plant: {plant.x} is an output: it cannot be set$"):
        slave.set_real([plant.reference[plant.x]], [1.0])


@pytest.mark.parametrize("logging", [False, True])
def test_a_warning_is_told_whether_or_not_there_is_a_log(
    fmu: Fmu, logging: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    with fmu.instance("100%", logging=logging) as instance:
        for _ in range(2):
            instance.log.clear()
            instance.start(unstable(fmu.plant))
            told = [entry.text for entry in instance.warnings]
            lines = capfd.readouterr().err.splitlines()
            assert (len(told), len(lines)) == fmu.places(logging)
            (text,) = {*told, *lines}
            assert text.startswith("100percent: substeps of solver.stepSize = 0.001 s would be unstable: ")
            # Logging that is turned on or off by the host later counts, too.
            logging = not logging
            assert instance.call("fmi2SetDebugLogging", logging, 0, None) == OK


@each_fault
@pytest.mark.parametrize("name", ["100%", "%s%n%d", "%%", "unit \N{GREEK SMALL LETTER PHI} %"])
def test_no_message_contains_a_percent_sign(fmu: Fmu, fault: Callable[[Instance], int], name: str) -> None:
    with fmu.instance(name) as instance:
        fault(instance)
        assert instance.errors
        assert not any("%" in entry.text or "%" in entry.category for entry in instance.log)


@given(
    data=st.data(),
    method=st.integers(-(2**31), 2**31 - 1),
    name=st.text("%sdn0 \N{GREEK SMALL LETTER PHI}", min_size=1).filter(str.strip),
)
def test_whatever_the_values_the_message_has_no_percent_sign(
    fmu: Fmu, data: st.DataObject, method: int, name: str
) -> None:
    reals = [parameter.name for parameter in fmu.plant.parameters if parameter.type != "SolverMethod"]
    values = data.draw(st.fixed_dictionaries(dict.fromkeys(reals, st.floats())))
    with fmu.instance(name) as instance:
        status = instance.initialize(values | {"solver.method": method})
        if not is_error(status):
            status = instance.step(0.0, values["solver.stepSize"])
        assert bool(instance.errors) == is_error(status)
        assert not any("%" in entry.text for entry in instance.log)


def test_fmpy_shows_the_reason(fmu: Fmu, capfd: pytest.CaptureFixture[str]) -> None:
    # FMPy prints what is logged, but with no logger it calls the one that was given last in this process.
    with pytest.raises(FMICallException, match=r"fmi2ExitInitializationMode failed with status [34]"):
        simulate_fmu(
            str(fmu.path), start_values={fmu.plant.mass: -1.0}, debug_logging=True, logger=printLogMessage
        )
    captured = capfd.readouterr()
    mass = fmu.plant.mass
    reason = f"{fmu.name}: cannot initialize: {mass} = -1.0{fmu.plant.unit(mass)} (allowed: > 0)"
    assert (reason in captured.out, reason in captured.err) == fmu.places(logging=True)


each_option = pytest.mark.parametrize("options", [[], ["--debug-logging"]], ids=["quiet", "logging"])


@each_option
def test_fmpy_shows_a_warning_once(fmu: Fmu, options: list[str]) -> None:
    start = unstable(fmu.plant)
    done = fmpy_simulate(fmu, start, options)
    assert done.returncode == 0
    (line,) = (done.stdout + done.stderr).splitlines()
    slave = fmu.plant.slave(instance_name=fmu.name)
    for name in (fmu.plant.mass, fmu.plant.drag):
        slave.set_real([fmu.reference[name]], [start[name]])
    slave.set_integer([fmu.reference["solver.method"]], [start["solver.method"]])
    assert line.removeprefix("[WARNING] ") == f"{fmu.name}: {slave.start()}"
    assert "would be unstable" in line


@each_option
def test_fmpy_shows_an_error_once(fmu: Fmu, options: list[str]) -> None:
    done = fmpy_simulate(fmu, {fmu.plant.mass: -1.0}, options)
    assert done.returncode != 0
    mass = fmu.plant.mass
    reason = f"{fmu.name}: cannot initialize: {mass} = -1.0{fmu.plant.unit(mass)} (allowed: > 0)"
    assert (done.stdout + done.stderr).count(reason) == 1


def fmpy_simulate(
    fmu: Fmu, start: Mapping[str, float], options: Sequence[str]
) -> subprocess.CompletedProcess[str]:
    values = [word for name, value in start.items() for word in (name, str(value))]
    command = [sys.executable, "-m", "fmpy", "simulate", fmu.path, *options, "--start-values", *values]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_run_without_errors_reports_nothing(fmu: Fmu, capfd: pytest.CaptureFixture[str]) -> None:
    with fmu.running() as instance:
        instance.run([0.01 * k for k in range(11)])
        assert instance.log == []
    assert capfd.readouterr() == ("", "")


@each_fault
def test_the_status_of_an_error_is_error_or_fatal(fmu: Fmu, fault: Callable[[Instance], int]) -> None:
    with fmu.instance() as instance:
        assert fault(instance) in (ERROR, FATAL)
