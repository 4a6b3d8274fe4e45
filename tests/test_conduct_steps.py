"""What cannot be carried out is refused, and the state before it is kept."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_char_p, c_uint
from math import inf, nan
from pathlib import Path

import fmpy
import pytest

from tests.driver import OK, Fmu, Instance, is_error
from tests.plants import Plant
from tests.twin import Twin


def drive_and_step(value: float) -> Callable[[Instance], int]:
    return lambda instance: max(instance.set(instance.fmu.plant.input, value), instance.step(0.01, 0.01))


REFUSED = {
    "no step": (lambda i: i.step(0.01, 0.0), "communicationStepSize = 0.0 s (allowed: > 0 and finite)"),
    "backward": (lambda i: i.step(0.01, -0.01), "communicationStepSize = -0.01 s (allowed: > 0 and finite)"),
    "nan step": (lambda i: i.step(0.01, nan), "communicationStepSize = nan s (allowed: > 0 and finite)"),
    "endless step": (lambda i: i.step(0.01, inf), "communicationStepSize = inf s (allowed: > 0 and finite)"),
    "nan time": (lambda i: i.step(nan, 0.01), "it must end at a finite time"),
    "infinite time": (lambda i: i.step(-inf, 0.01), "it must end at a finite time"),
    "past the stop time": (lambda i: i.step(0.01, 2.0), "not beyond the stop time"),
    "too many substeps": (lambda i: i.step(-1e9, 1e9), "at most 2147483647 are allowed"),
    "nan drive": (drive_and_step(nan), "{drive} = nan{unit} (allowed: finite)"),
    "infinite drive": (drive_and_step(inf), "{drive} = inf{unit} (allowed: finite)"),
    "minus infinite drive": (drive_and_step(-inf), "{drive} = -inf{unit} (allowed: finite)"),
}


@pytest.mark.parametrize(("fault", "told"), REFUSED.values(), ids=REFUSED)
def test_a_refused_step_says_why_and_changes_nothing(
    fmu: Fmu, fault: Callable[[Instance], int], told: str
) -> None:
    plant = fmu.plant
    twin = Twin(plant, {plant.input: 0.5})
    with fmu.instance() as instance:
        assert instance.initialize({plant.input: 0.5}, stop=1.0) == OK
        for time in (0.0, 0.01):
            twin.step(time, 0.01)
            assert instance.step(time, 0.01) == OK
            assert is_error(fault(instance))
            assert told.format(drive=plant.input, unit=plant.unit(plant.input)) in instance.errors[0]
            assert instance.set(plant.input, 0.5) == OK
            assert instance.get(*plant.calculated) == twin.calculated


@pytest.mark.parametrize(
    ("start", "interval", "count"),
    [
        (0.0, 0.1, 3),  # 0.1 + 0.1 + 0.1 > 0.3
        (0.0, 0.1, 1_000_000),  # the sum is 1.3e-6 s beyond 100000 s
        (0.0, 1e-4, 10_000),
        (-1.0, 0.1, 10),
        (1e6, 0.1, 10),
        (0.0, 1 / 3, 3),
    ],
)
def test_an_importer_that_adds_up_its_steps_reaches_the_stop_time(
    fmu: Fmu, start: float, interval: float, count: int
) -> None:
    stop, last = start + count * interval, start
    for _ in range(count - 1):
        last += interval
    if (start, interval, count) == (0.0, 0.1, 3):
        stop = 0.3
    with fmu.instance() as instance:
        assert instance.initialize(time=start, stop=stop) == OK
        assert instance.step(last, interval) == OK
        assert is_error(instance.step(last + interval, interval))


def test_a_step_beyond_the_stop_time_by_more_than_rounding_is_refused(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(stop=1.0) == OK
        assert is_error(instance.step(0.0, 1.0 + 1e-8))
        assert instance.step(0.0, 1.0) == OK


def test_without_a_stop_time_there_is_none(fmu: Fmu) -> None:
    with fmu.running() as instance:
        assert instance.step(1e6, 0.01) == OK


# FMPy takes what is within a relative 1e-9 for the stop time.
@pytest.mark.parametrize("excess", [-0.9e-9, 0.9e-9])
def test_fmpy_may_miss_the_stop_time_by_its_own_tolerance(
    fmu_path: Path, plant: Plant, excess: float
) -> None:
    result = fmpy.simulate_fmu(
        str(fmu_path), stop_time=1.0, output_interval=0.01 * (1.0 + excess), output=[plant.x]
    )
    assert len(result) == 101


@pytest.mark.parametrize(
    ("time", "stop"), [(nan, None), (inf, None), (-inf, None), (1.0, 0.0), (0.0, nan)], ids=str
)
def test_an_impossible_experiment_is_refused(fmu: Fmu, time: float, stop: float | None) -> None:
    with fmu.instance() as instance:
        assert is_error(instance.call("fmi2SetupExperiment", 0, 0.0, time, stop is not None, stop or 0.0))
        assert f"startTime = {time!r} s must be finite and not beyond stopTime" in instance.errors[0]


@pytest.mark.parametrize("time", [0.0, -0.0, 1.0, -3.0, 1e6, -1e300])
def test_an_experiment_may_end_when_it_begins(fmu: Fmu, time: float) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(time=time, stop=time) == OK
        assert instance.get(fmu.plant.x) == (fmu.plant.defaults[fmu.plant.x_start],)


def test_an_experiment_may_have_an_infinite_stop_time(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(stop=inf) == OK
        assert instance.step(1e6, 0.01) == OK


def test_reset_forgets_the_experiment(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        assert instance.initialize(stop=1.0) == OK
        assert instance.reset() == OK
        assert instance.initialize() == OK
        assert instance.step(1e6, 0.01) == OK


def test_a_parameter_is_fixed_once_initialization_has_ended(fmu: Fmu) -> None:
    for parameter in fmu.plant.parameters:
        name = parameter.name
        with fmu.running() as instance:
            before = instance.get(name)
            assert is_error(instance.set(name, 2))
            assert f"{name} is a fixed parameter" in instance.errors[0]
            assert instance.get(name) == before


@pytest.mark.parametrize("initialized", [False, True])
def test_what_is_calculated_can_never_be_set(fmu: Fmu, initialized: bool) -> None:
    for name in fmu.plant.calculated:
        with fmu.instance() as instance:
            if initialized:
                instance.initialize()
            before = instance.get(name)
            assert is_error(instance.set(name, 2))
            kind = "a local variable" if name == "solver.nfev" else "an output"
            assert f"{name} is {kind}: it cannot be set" in instance.errors[0]
            assert instance.get(name) == before


def test_parameters_can_be_set_in_initialization_mode(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        instance.call("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)
        instance.call("fmi2EnterInitializationMode")
        assert instance.set(fmu.plant.x_start, 0.25) == OK
        assert instance.get(fmu.plant.x) == (0.25,)
        assert instance.call("fmi2ExitInitializationMode") == OK
        assert instance.get(fmu.plant.x) == (0.25,)


# Value references that no variable has.
UNKNOWN: dict[str, Callable[[Plant], int]] = {
    "the next": lambda plant: len(plant.variables),
    "the first negative": lambda plant: 2**31,
    "the last": lambda plant: 2**32 - 1,
}


@pytest.mark.parametrize("access", ["Get", "Set"])
@pytest.mark.parametrize(
    ("kind", "name", "told"),
    [
        ("Real", "solver.method", "{name} (value reference {reference}) is not of type Real"),
        ("Real", "solver.nfev", "{name} (value reference {reference}) is not of type Real"),
        ("Integer", "solver.stepSize", "{name} (value reference {reference}) is not of type Integer"),
        ("Boolean", "solver.method", "{name} (value reference {reference}) is not of type Boolean"),
        ("String", "solver.stepSize", "{name} (value reference {reference}) is not of type String"),
    ]
    + [
        (kind, name, "value reference {reference} is unknown")
        for kind in ("Real", "Integer", "Boolean", "String")
        for name in UNKNOWN
    ],
)
def test_a_value_reference_of_the_wrong_type_or_unknown_is_refused(
    fmu: Fmu, access: str, kind: str, name: str, told: str
) -> None:
    reference = UNKNOWN[name](fmu.plant) if name in UNKNOWN else fmu.reference[name]
    with fmu.instance() as instance:
        if kind == "String":
            status = instance.call(f"fmi2{access}String", (c_uint * 1)(reference), 1, (c_char_p * 1)(b"1"))
        elif access == "Get":
            status, _ = instance.get_references(kind, [reference])
        else:
            status = instance.set_references(kind, [reference], [1])
        assert is_error(status)
        assert told.format(name=name, reference=reference) in instance.errors[0]


def test_a_call_with_one_wrong_reference_sets_nothing(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        references = [fmu.reference[fmu.plant.mass], fmu.reference[fmu.plant.x]]
        assert is_error(instance.set_references("Real", references, [7.0, 7.0]))
        assert instance.get(fmu.plant.mass) == (fmu.plant.defaults[fmu.plant.mass],)


CALLS = {
    "setup": ("fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0),
    "enter": ("fmi2EnterInitializationMode",),
    "exit": ("fmi2ExitInitializationMode",),
    "step": ("fmi2DoStep", 0.0, 0.01, 1),
    "end": ("fmi2Terminate",),
}


RESET = "reset the instance first"


@pytest.mark.parametrize(
    ("order", "advice"),
    [
        ("step", "initialize the instance first"),
        ("setup step", "initialize the instance first"),
        ("setup enter step", "call fmi2ExitInitializationMode first"),
        ("exit", ""),  # the mode that the call needs is the next one
        *((f"setup enter {again}", RESET) for again in ("setup", "enter")),
        *((f"setup enter exit {again}", RESET) for again in ("setup", "enter", "exit")),
        *((f"setup enter exit end {again}", RESET) for again in ("setup", "enter", "exit", "step")),
    ],
)
def test_the_last_call_is_refused_when_it_is_out_of_order(fmu: Fmu, order: str, advice: str) -> None:
    *legal, last = order.split()
    with fmu.instance() as instance:
        for call in legal:
            assert instance.call(*CALLS[call]) == OK
        reason = instance.refusal(instance.call(*CALLS[last]))
        assert "in mode" in reason
        assert reason.endswith(f": {advice}" if advice else "instantiated")


def test_after_the_end_the_outputs_can_be_read_and_nothing_can_be_set(fmu: Fmu) -> None:
    with fmu.running() as instance:
        instance.run((0.0, 0.01))
        before = instance.get(*fmu.plant.calculated)
        assert instance.call("fmi2Terminate") == OK
        for name in (fmu.plant.input, fmu.plant.mass):
            reason = instance.refusal(instance.set(name, 1.0))
            assert reason == f"{fmu.plant.system}: {name} cannot be set: the run has ended, {RESET}"
        assert instance.get(*fmu.plant.calculated) == before
