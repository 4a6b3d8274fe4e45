"""The state of an instance is all of it: what follows after restoring it has the same bits."""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Iterator
from math import inf, nan
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from build_fmu import SOURCES, build
from damped_pendulum.interface import INTERFACE
from methods.solvers import SolverMethod
from tests.driver import OK, Fmu, Instance, is_error
from tests.hosts import run_host
from tests.twin import OUTPUTS, VR, Twin

Values = list[tuple[float, ...]]


def follow(instance: Instance, begin: int = 5) -> Values:
    """Return the outputs of five steps with a torque that changes."""
    values = []
    for k in range(begin, begin + 5):
        assert instance.set("tau", 0.1 * k) == OK
        assert instance.step(0.01 * k, 0.01 * (k + 1) - 0.01 * k) == OK
        values.append(instance.get(*OUTPUTS))
    return values


@pytest.fixture
def instance(fmu: Fmu, request: pytest.FixtureRequest) -> Iterator[Instance]:
    """An instance five steps into a run with the method that the test asks for."""
    start = {"phi_start": 2.0, "w_start": -1.0, "gamma": 0.3, "L": 0.7, "solver.method": request.param}
    with fmu.running(start) as instance:
        follow(instance, 0)
        yield instance


methods = pytest.mark.parametrize("instance", SolverMethod, indirect=True, ids=lambda method: method.name)


@methods
def test_a_restored_state_has_the_same_future(instance: Instance) -> None:
    now = instance.get(*OUTPUTS)
    state = instance.save()
    future = follow(instance)
    for _ in range(3):
        assert instance.restore(state) == OK
        assert instance.get(*OUTPUTS, "tau") == (*now, 0.4)
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
        assert other.get("tau", "L") == (0.4, 0.7)
        assert follow(other) == future


@methods
def test_a_state_is_restored_in_another_process(fmu_path: Path, instance: Instance) -> None:
    state = instance.save()
    data = instance.serialize(state)
    instance.free_state(state)
    assert run_host("restored_future", fmu_path, data.hex()) == follow(instance)


def test_a_restored_state_replaces_everything_in_an_instance_that_ran_otherwise(fmu: Fmu) -> None:
    with fmu.running({"m": 2.0, "tau": 0.3}) as one, fmu.running({"L": 3.0, "solver.method": 4}) as two:
        for running in (one, two):
            assert running.step(0.0, 0.01) == OK
        state = one.save()
        assert two.restore(state) == OK
        assert two.get("m", "L", "solver.method", *OUTPUTS) == one.get("m", "L", "solver.method", *OUTPUTS)
        assert follow(two) == follow(one)
        one.free_state(state)


def test_mode_and_stop_time_belong_to_the_state(fmu: Fmu) -> None:
    with fmu.instance() as instance:
        before = instance.save()
        assert instance.initialize({"m": 2.0}, stop=1.0) == OK
        running = instance.save()
        assert instance.call("fmi2Terminate") == OK
        ended = instance.save()
        assert instance.restore(running) == OK
        assert instance.step(0.0, 0.01) == OK
        assert is_error(instance.step(0.01, 1.0))
        assert instance.restore(before) == OK
        assert instance.get("m") == (1.0,)
        assert is_error(instance.step(0.01, 0.01))
        assert instance.initialize({"m": 3.0}) == OK
        assert instance.step(0.01, 100.0) == OK
        assert instance.restore(ended) == OK
        assert is_error(instance.step(0.01, 0.01))
        for state in (before, running, ended):
            instance.free_state(state)


def test_reset_forgets_the_run(fmu: Fmu) -> None:
    with fmu.running({"m": 2.0, "tau": 1.0, "solver.method": 4}) as instance:
        follow(instance)
        assert instance.reset() == OK
        assert instance.get("m", "tau", "solver.method", "solver.nfev") == (1.0, 0.0, 3, 0)
        assert instance.initialize() == OK
        twin = Twin()
        twin.step(0.0, 0.01)
        assert instance.step(0.0, 0.01) == OK
        assert instance.get(*OUTPUTS) == twin.outputs


@pytest.fixture(scope="module")
def data(fmu: Fmu) -> bytes:
    return saved_bytes(fmu)


def refused(fmu: Fmu, data: bytes, reason: str) -> bool:
    """Return whether an instance refuses `data` for `reason` and goes on with the state it had."""
    twin = Twin(tau=0.5)
    with fmu.running({"tau": 0.5}) as instance:
        status = instance.restore_bytes(data)
        told = bool(instance.errors) and f"cannot restore the state: {reason}" in instance.errors[0]
        twin.step(0.0, 0.01)
        assert instance.step(0.0, 0.01) == OK
        return is_error(status) and told and instance.get(*OUTPUTS) == twin.outputs


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
    return Fmu(build(folder / "DampedPendulum.fmu", sources), folder / "extracted")


def saved_bytes(fmu: Fmu) -> bytes:
    with fmu.running() as instance:
        state = instance.save()
        data = instance.serialize(state)
        instance.free_state(state)
    return data


def format_of(data: bytes) -> str:
    return str(json.loads(data[8:])["format"])


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(
    ("old", "new"),
    [
        (f'version="{INTERFACE.version}"', 'version="99.0.0"'),
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
    with other_fmu.running({"tau": 0.5}) as instance:
        assert is_error(instance.restore_bytes(data))
        assert f"it is of '{ours}', this is '{theirs}'" in instance.errors[0]


def sealed(state: object) -> bytes:
    """Return `state` as the bytes of a state, with the right checksum."""
    body = (state if isinstance(state, str) else json.dumps(state)).encode()
    return f"{zlib.crc32(body):08x}".encode() + body


def forged(data: bytes, **entries: object) -> bytes:
    """Return `data` with other entries; a name of a variable stands for its value."""
    state = json.loads(data[8:])
    for name, entry in entries.items():
        if name in VR and name not in state:
            state["values"][VR[name]] = entry
        else:
            state[name] = entry
    return sealed(state)


WRONG_TYPES = (None, "1", True, [1.0], {}, 10**400)
FORGED = {
    f"{name} = {str(entry)[:20]}": ({name: entry}, told)
    for name, entries, told in (
        ("m", (-1.0, 0.0, nan, inf), "m = "),
        ("L", (-1.0, nan), "L = "),
        ("gamma", (-5e-324, inf), "gamma = "),
        ("g", (nan, -inf), "g = "),
        ("m", (*WRONG_TYPES, 1), "values"),
        ("tau", WRONG_TYPES, "values"),
        ("phi_start", (*WRONG_TYPES, 1), "values"),
        ("phi_start", (nan, inf), "phi_start = "),
        ("solver.method", (0, 5, -1), "solver.method = "),
        ("solver.method", (*WRONG_TYPES, 3.0, 2**31), "values"),
        ("solver.stepSize", (0.0, -1.0, nan), "solver.stepSize = "),
        ("a", (1.0, "x"), "values"),
        ("solver.nfev", (7,), "values"),
        ("values", (None, [], {}, "x", [1.0] * 13, [1.0] * 15), "values"),
        ("phi", (*WRONG_TYPES, 1, nan, inf), "phi"),
        ("w", (*WRONG_TYPES, 1, nan, -inf), "w"),
        ("nfev", (-5, 2**31, 1.0, None, "7", True, [7], 10**400), "nfev"),
        ("mode", ("flying", "", 3, None, ["stepping"], {"a": 1}), "mode"),
        ("start_time", (*WRONG_TYPES, nan, inf, -inf), "start_time"),
        ("stop_time", (*WRONG_TYPES, nan, -1.0), "stop_time"),
        ("latest_end", (1.0,), "latest_end"),
    )
    for entry in entries
}


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(("entries", "told"), FORGED.values(), ids=FORGED)
def test_a_forged_state_is_refused_whole(
    fmu: Fmu, data: bytes, entries: dict[str, object], told: str
) -> None:
    assert refused(fmu, forged(data, **entries), "no instance can be in it")
    with fmu.running() as instance:
        instance.restore_bytes(forged(data, **entries))
        assert told in instance.errors[0].partition("no instance can be in it")[2]


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize("entry", ["values", "phi", "w", "nfev", "mode", "start_time", "stop_time"])
def test_a_state_that_lacks_an_entry_is_refused(fmu: Fmu, data: bytes, entry: str) -> None:
    state = json.loads(data[8:])
    del state[entry]
    assert refused(fmu, sealed(state), f"no instance can be in it ({entry})")


@pytest.mark.pythonfmu_only
@pytest.mark.parametrize(
    "entries",
    [{"phi": 1.0}, {"w": -0.0}, {"nfev": 4}, {"mode": "initialization", "phi": 0.25}],
    ids=["phi", "w", "nfev", "initialization"],
)
def test_before_the_first_step_a_state_is_that_of_the_start_values(
    fmu: Fmu, data: bytes, entries: dict[str, object]
) -> None:
    assert refused(fmu, forged(data, **{"mode": "instantiated", **entries}), "no instance can be in it")


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
    with fmu.instance() as instance:
        for name, value in {
            "m": -1.0,
            "phi_start": nan,
            "w_start": -0.0,
            "tau": inf,
            "solver.method": 9,
        }.items():
            instance.set(name, value)
        for call in ("fmi2EnterInitializationMode", "fmi2Terminate"):
            assert instance.call(call) == OK
            state = instance.save()
            assert instance.restore(state) == OK
            assert instance.restore_bytes(instance.serialize(state)) == OK, instance.errors
            instance.free_state(state)


torques = st.just(0.0) | st.floats(-20.0, 20.0)
durations = st.sampled_from((1e-3, 0.01, 1 / 60, 1 / 3)) | st.floats(1e-9, 0.1)


class Rollback(RuleBasedStateMachine):
    """Random sequences of calls, against the twin bit for bit."""

    saved = Bundle("saved")

    def __init__(self, fmu: Fmu) -> None:
        super().__init__()
        self.instance = Instance(fmu)
        self.states: list[object] = []

    @initialize(
        method=st.sampled_from(SolverMethod),
        phi=st.floats(-10.0, 10.0),
        w=st.floats(-10.0, 10.0),
        gamma=st.just(0.0) | st.floats(0.0, 5.0),
        h=st.floats(1e-3, 0.05),
        time=st.sampled_from((0.0, -3.0, 1e6)),
    )
    def start(self, method: SolverMethod, phi: float, w: float, gamma: float, h: float, time: float) -> None:
        self.values = {
            "phi_start": phi,
            "w_start": w,
            "gamma": gamma,
            "solver.method": method,
            "solver.stepSize": h,
        }
        self.begin = time
        self.begin_run()

    def begin_run(self) -> None:
        self.time = self.begin
        assert not is_error(self.instance.initialize(self.values, time=self.begin))
        self.twin = Twin(**self.values)
        self.compare()

    def compare(self) -> None:
        assert self.instance.get(*OUTPUTS, "tau") == (*self.twin.outputs, self.twin.tau)

    @rule(tau=torques)
    def set_torque(self, tau: float) -> None:
        assert self.instance.set("tau", tau) == OK
        self.twin.tau = tau
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
