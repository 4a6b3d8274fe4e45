"""The state of an instance is all of it: what follows after restoring it has the same bits."""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Iterator, Mapping
from math import inf, nan
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from build_fmu import SOURCES, build
from methods.solvers import SolverMethod
from tests.driver import OK, Fmu, Instance, is_error
from tests.hosts import run_host
from tests.plants import PENDULUM, Plant
from tests.test_conduct_parameters import BEYOND, WRONG
from tests.twin import Twin

Values = list[tuple[float, ...]]


def follow(instance: Instance, begin: int = 5) -> Values:
    """Return the outputs of five steps with a drive that changes."""
    values = []
    for k in range(begin, begin + 5):
        assert instance.set(instance.fmu.plant.input, 0.1 * k) == OK
        assert instance.step(0.01 * k, 0.01 * (k + 1) - 0.01 * k) == OK
        values.append(instance.get(*instance.fmu.plant.calculated))
    return values


@pytest.fixture
def instance(fmu: Fmu, request: pytest.FixtureRequest) -> Iterator[Instance]:
    """An instance five steps into a run with the method that the test asks for."""
    plant = fmu.plant
    start = {plant.x_start: 2.0, plant.v_start: -1.0, plant.drag: 0.3, plant.mass: 0.7}
    with fmu.running(start | {"solver.method": request.param}) as instance:
        follow(instance, 0)
        yield instance


methods = pytest.mark.parametrize("instance", SolverMethod, indirect=True, ids=lambda method: method.name)


@methods
def test_a_restored_state_has_the_same_future(instance: Instance) -> None:
    plant = instance.fmu.plant
    now = instance.get(*plant.calculated)
    state = instance.save()
    future = follow(instance)
    for _ in range(3):
        assert instance.restore(state) == OK
        assert instance.get(*plant.calculated, plant.input) == (*now, 0.4)
        assert follow(instance) == future
    instance.free_state(state)


@methods
def test_a_state_survives_the_instance_as_bytes(fmu: Fmu, instance: Instance) -> None:
    state = instance.save()
    data = instance.serialize(state)
    instance.free_state(state)
    future = follow(instance)
    with fmu.instance("other") as other:
        assert other.restore_bytes(data) == OK
        assert other.get(fmu.plant.input, fmu.plant.mass) == (0.4, 0.7)
        assert follow(other) == future


@methods
def test_a_state_is_restored_in_another_process(fmu_path: Path, instance: Instance) -> None:
    state = instance.save()
    data = instance.serialize(state)
    instance.free_state(state)
    assert run_host("restored_future", fmu_path, data.hex()) == follow(instance)


def test_a_restored_state_replaces_everything_in_an_instance_that_ran_otherwise(fmu: Fmu) -> None:
    plant = fmu.plant
    everything = (*(parameter.name for parameter in plant.parameters), plant.input, *plant.calculated)
    starts = {plant.mass: 2.0, plant.input: 0.3}, {plant.x_start: 3.0, "solver.method": 4}
    with fmu.running(starts[0]) as one, fmu.running(starts[1]) as two:
        for running in (one, two):
            assert running.step(0.0, 0.01) == OK
        state = one.save()
        assert two.restore(state) == OK
        assert two.get(*everything) == one.get(*everything)
        assert follow(two) == follow(one)
        one.free_state(state)


def test_a_restored_state_is_the_state_that_was_saved(fmu: Fmu) -> None:
    """Its times are none of the outputs: that of the start shows in how late a host's clock may be."""
    with fmu.instance() as one, fmu.instance() as two:
        assert one.initialize({fmu.plant.mass: 2.0}, time=-2.5, stop=1e9) == OK
        assert one.step(-2.5, 0.01) == OK
        assert two.initialize(time=1.0, stop=2.0) == OK
        state = one.save()
        assert two.restore(state) == OK
        again = two.save()
        assert two.serialize(again) == one.serialize(state)
        for saved in (state, again):
            one.free_state(saved)


def test_mode_and_stop_time_belong_to_the_state(fmu: Fmu) -> None:
    mass = fmu.plant.mass
    with fmu.instance() as instance:
        before = instance.save()
        assert instance.initialize({mass: 2.0}, stop=1.0) == OK
        running = instance.save()
        assert instance.call("fmi2Terminate") == OK
        ended = instance.save()
        assert instance.restore(running) == OK
        assert instance.step(0.0, 0.01) == OK
        assert is_error(instance.step(0.01, 1.0))
        assert instance.restore(before) == OK
        assert instance.get(mass) == (fmu.plant.defaults[mass],)
        assert is_error(instance.step(0.01, 0.01))
        assert instance.initialize({mass: 3.0}) == OK
        assert instance.step(0.01, 100.0) == OK
        assert instance.restore(ended) == OK
        assert is_error(instance.step(0.01, 0.01))
        for state in (before, running, ended):
            instance.free_state(state)


def test_reset_forgets_the_run(fmu: Fmu) -> None:
    plant = fmu.plant
    with fmu.running({plant.mass: 2.0, plant.input: 1.0, "solver.method": 4}) as instance:
        follow(instance)
        assert instance.reset() == OK
        started = (plant.mass, plant.input, "solver.method")
        assert instance.get(*started, "solver.nfev") == (*map(plant.defaults.__getitem__, started), 0)
        assert instance.initialize() == OK
        twin = Twin(plant)
        twin.step(0.0, 0.01)
        assert instance.step(0.0, 0.01) == OK
        assert instance.get(*plant.calculated) == twin.calculated


@pytest.fixture(scope="module")
def data(fmu: Fmu) -> bytes:
    return saved_bytes(fmu)


def refused(fmu: Fmu, data: bytes, reason: str) -> bool:
    """Return whether an instance refuses `data` for `reason` and goes on with the state it had."""
    start = {fmu.plant.input: 0.5}
    twin = Twin(fmu.plant, start)
    with fmu.running(start) as instance:
        status = instance.restore_bytes(data)
        told = bool(instance.errors) and f"cannot restore the state: {reason}" in instance.errors[0]
        twin.step(0.0, 0.01)
        assert instance.step(0.0, 0.01) == OK
        return is_error(status) and told and instance.get(*fmu.plant.calculated) == twin.calculated


DAMAGED = "the bytes are damaged"


def test_a_state_with_a_damaged_byte_is_refused(fmu: Fmu, data: bytes) -> None:
    for i in range(0, len(data), 7):
        assert refused(fmu, data[:i] + bytes([data[i] ^ 1]) + data[i + 1 :], DAMAGED)


def test_a_state_that_was_cut_off_is_refused(fmu: Fmu, data: bytes) -> None:
    for length in (0, 1, 7, 8, 9, len(data) // 2, len(data) - 1):
        assert refused(fmu, data[:length], DAMAGED)
    assert refused(fmu, data + b"}", DAMAGED)


@given(st.binary(max_size=300) | st.just(b"00000000") | st.just(b"00000000{}"))
@settings(max_examples=50)
def test_bytes_that_are_no_state_are_refused(fmu: Fmu, noise: bytes) -> None:
    assert refused(fmu, noise, DAMAGED)


def changed_fmu(folder: Path, old: str, new: str) -> Fmu:
    """Return the FMU whose interface table differs in one place."""
    sources = shutil.copytree(SOURCES, folder / "fmu_src", ignore=shutil.ignore_patterns("__pycache__"))
    interface = sources / "damped_pendulum" / "interface.py"
    text = interface.read_text("utf-8")
    assert old in text
    interface.write_text(text.replace(old, new), "utf-8")
    return Fmu(build(folder / "changed.fmu", sources), folder / "extracted")


def saved_bytes(fmu: Fmu) -> bytes:
    with fmu.running() as instance:
        state = instance.save()
        data = instance.serialize(state)
        instance.free_state(state)
    return data


def format_of(data: bytes) -> str:
    return str(json.loads(data[8:])["format"])


@pytest.mark.pythonfmu_only
@pytest.mark.one_model("changes the sources of the pendulum; the comparison is the shell's")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        (f'version="{PENDULUM.interface.version}"', 'version="99.0.0"'),
        ('"m", "Mass"', '"m", "Energy"'),
        ("1.0, POSITIVE", "1.0, FINITE"),
    ],
    ids=["version", "type", "range"],
)
def test_a_state_of_another_interface_is_refused_in_both_directions(
    fmu: Fmu, data: bytes, tmp_path: Path, old: str, new: str
) -> None:
    other_fmu = changed_fmu(tmp_path, old, new)
    other = saved_bytes(other_fmu)
    ours, theirs = format_of(data), format_of(other)
    assert ours != theirs
    assert refused(fmu, other, f"it is of '{theirs}', this is '{ours}'")
    with other_fmu.running({fmu.plant.input: 0.5}) as instance:
        assert is_error(instance.restore_bytes(data))
        assert f"it is of '{ours}', this is '{theirs}'" in instance.errors[0]


def sealed(state: object) -> bytes:
    """Return `state` as the bytes of a state, with the right checksum."""
    body = (state if isinstance(state, str) else json.dumps(state)).encode()
    return f"{zlib.crc32(body):08x}".encode() + body


def forged(plant: Plant, data: bytes, entries: Mapping[str, object]) -> bytes:
    """Return `data` with other entries; a name of a variable stands for its value."""
    state = json.loads(data[8:])
    for name, entry in entries.items():
        if name in plant.reference and name not in state:
            state["values"][plant.reference[name]] = entry
        else:
            state[name] = entry
    return sealed(state)


def is_refused_for(fmu: Fmu, forgery: bytes, told: str) -> bool:
    """Return whether an instance that goes on refuses a state that no instance can be in, and says `told`."""
    if not refused(fmu, forgery, "no instance can be in it"):
        return False
    with fmu.running() as instance:
        instance.restore_bytes(forgery)
        return told in instance.errors[0].partition("no instance can be in it")[2]


WRONG_TYPES = (None, "1", True, [1.0], {}, 10**400)
# Entry, or what the plant calls it -> values that it cannot have, and by what the refusal names it.
FORGED: tuple[tuple[str, tuple[object, ...], str], ...] = (
    ("mass", (*WRONG_TYPES, 1), "values"),
    ("input", WRONG_TYPES, "values"),
    ("x_start", (*WRONG_TYPES, 1), "values"),
    ("solver.method", (*WRONG_TYPES, 3.0, 2**31), "values"),
    ("a", (1.0, "x"), "values"),
    ("solver.nfev", (7,), "values"),
    ("values", (None, [], {}, "x", [1.0] * 13, [1.0] * 15), "values"),
    ("x", (*WRONG_TYPES, 1, nan, inf), "{name}"),
    ("v", (*WRONG_TYPES, 1, nan, -inf), "{name}"),
    ("nfev", (-5, 2**31, 1.0, None, "7", True, [7], 10**400), "nfev"),
    ("mode", ("flying", "", 3, None, ["stepping"], {"a": 1}), "mode"),
    ("start_time", (*WRONG_TYPES, nan, inf, -inf), "start_time"),
    ("stop_time", (*WRONG_TYPES, nan, -1.0), "stop_time"),
    ("latest_end", (1.0,), "latest_end"),
)


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(("entry", "values", "told"), FORGED, ids=[entry for entry, *_ in FORGED])
def test_a_forged_state_is_refused_whole(
    fmu: Fmu, data: bytes, entry: str, values: tuple[object, ...], told: str
) -> None:
    name = getattr(fmu.plant, entry, entry)
    for value in values:
        forgery = forged(fmu.plant, data, {name: value})
        assert is_refused_for(fmu, forgery, f"({told.format(name=name)})"), value


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize("allowed", BEYOND)
def test_a_state_with_a_parameter_out_of_its_range_is_refused(fmu: Fmu, data: bytes, allowed: str) -> None:
    for parameter in fmu.plant.with_range(allowed):
        for value in (*BEYOND[allowed], *WRONG[allowed]):
            forgery = forged(fmu.plant, data, {parameter.name: value})
            told = "values" if value == 2**31 else f"{parameter.name} = "
            assert is_refused_for(fmu, forgery, told), (parameter.name, value)


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize("entry", ["values", "x", "v", "nfev", "mode", "start_time", "stop_time"])
def test_a_state_that_lacks_an_entry_is_refused(fmu: Fmu, data: bytes, entry: str) -> None:
    name = getattr(fmu.plant, entry, entry)
    state = json.loads(data[8:])
    del state[name]
    assert refused(fmu, sealed(state), f"no instance can be in it ({name})")


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(
    "entries",
    [{"x": 1.0}, {"v": -0.0}, {"nfev": 4}, {"mode": "initialization", "x": 0.25}],
    ids=["x", "v", "nfev", "initialization"],
)
def test_before_the_first_step_a_state_is_that_of_the_start_values(
    fmu: Fmu, data: bytes, entries: dict[str, object]
) -> None:
    plant = fmu.plant
    named = {getattr(plant, entry, entry): value for entry, value in entries.items()}
    assert refused(fmu, forged(plant, data, {"mode": "instantiated"} | named), "no instance can be in it")


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(
    "text",
    ["[1, 2]", "7", "null", '"x"', "{", "[" * 100_000, "1" * 10_000, "\u0000", '{"format": [["x"]]}', "{}"],
    ids=lambda text: text[:12],
)
def test_json_that_is_no_state_is_refused(fmu: Fmu, text: str) -> None:
    assert refused(fmu, sealed(text), "")


@pytest.mark.pythonfmu_only
def test_bytes_that_are_not_utf_8_are_refused(fmu: Fmu) -> None:
    body = b"\xff\xfe{}"
    assert refused(fmu, f"{zlib.crc32(body):08x}".encode() + body, "the bytes are no state")


@pytest.mark.pythonfmu_only
def test_what_can_be_saved_can_be_restored(fmu: Fmu) -> None:
    """Values that no step takes are set before initialization, and the run may end without one."""
    plant = fmu.plant
    with fmu.instance() as instance:
        for name, value in {
            plant.mass: -1.0,
            plant.x_start: nan,
            plant.v_start: -0.0,
            plant.input: inf,
            "solver.method": 99,
        }.items():
            instance.set(name, value)
        for call in ("fmi2EnterInitializationMode", "fmi2Terminate"):
            assert instance.call(call) == OK
            state = instance.save()
            assert instance.restore(state) == OK
            assert instance.restore_bytes(instance.serialize(state)) == OK, instance.errors
            instance.free_state(state)


drives = st.just(0.0) | st.floats(-20.0, 20.0)
durations = st.sampled_from((1e-3, 0.01, 1 / 60, 1 / 3)) | st.floats(1e-9, 0.1)


class Rollback(RuleBasedStateMachine):
    """Random sequences of calls, against the twin bit for bit."""

    saved = Bundle("saved")

    def __init__(self, fmu: Fmu) -> None:
        super().__init__()
        self.plant = fmu.plant
        self.instance = Instance(fmu)
        self.states: list[object] = []

    @initialize(
        method=st.sampled_from(SolverMethod),
        x=st.floats(-10.0, 10.0),
        v=st.floats(-10.0, 10.0),
        drag=st.just(0.0) | st.floats(0.0, 5.0),
        h=st.floats(1e-3, 0.05),
        time=st.sampled_from((0.0, -3.0, 1e6)),
    )
    def start(self, method: SolverMethod, x: float, v: float, drag: float, h: float, time: float) -> None:
        plant = self.plant
        self.values = {
            plant.x_start: x,
            plant.v_start: v,
            plant.drag: drag,
            "solver.method": method,
            "solver.stepSize": h,
            **plant.plain,  # so that no run diverges
        }
        self.begin = time
        self.begin_run()

    def begin_run(self) -> None:
        self.time = self.begin
        assert not is_error(self.instance.initialize(self.values, time=self.begin))
        self.twin = Twin(self.plant, self.values)
        self.compare()

    def compare(self) -> None:
        seen = self.instance.get(*self.plant.calculated, self.plant.input)
        assert seen == (*self.twin.calculated, self.twin.input)

    @rule(drive=drives)
    def set_drive(self, drive: float) -> None:
        assert self.instance.set(self.plant.input, drive) == OK
        self.twin.input = drive
        self.compare()

    @rule(duration=durations)
    def step(self, duration: float) -> None:
        assert self.instance.step(self.time, duration) == OK
        self.twin.step(self.time, duration)
        self.time += duration
        self.compare()

    @rule(target=saved)
    def save(self) -> tuple[object, Twin, float]:
        state = self.instance.save()
        self.states.append(state)
        return state, self.twin.save(), self.time

    @rule(target=saved)
    def save_as_bytes(self) -> tuple[object, Twin, float]:
        state = self.instance.save()
        data = self.instance.serialize(state)
        self.instance.free_state(state)
        return data, self.twin.save(), self.time

    @rule(one=saved)
    def restore(self, one: tuple[object, Twin, float]) -> None:
        state, twin, self.time = one
        status = (self.instance.restore_bytes if isinstance(state, bytes) else self.instance.restore)(state)
        assert status == OK
        self.twin = twin.save()
        self.compare()

    @rule()
    def reset(self) -> None:
        assert self.instance.reset() == OK
        self.begin_run()

    def teardown(self) -> None:
        for state in self.states:
            self.instance.free_state(state)
        self.instance.free()


@pytest.mark.hypothesis
def test_random_sequences_of_steps_and_rollbacks_equal_the_twin(fmu: Fmu) -> None:
    run_state_machine_as_test(
        lambda: Rollback(fmu), settings=settings(max_examples=100, stateful_step_count=30)
    )
