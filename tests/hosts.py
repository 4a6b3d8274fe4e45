"""Programs that run as processes of their own: hosts in which errors happen. `python -m tests.hosts NAME FMU`.

Each prints "survived" and the result of a legal run; a crash shows in the exit status of the process.
"""

from __future__ import annotations

import gc
import os
import resource
import signal
import subprocess
import sys
import tempfile
from ast import literal_eval
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from ctypes import c_char_p, c_uint
from importlib.util import find_spec
from math import isnan, nan
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any

import pytest
from fmpy import read_model_description, simulate_fmu

from tests.driver import OK, Fmu, Instance, collect, is_error, plant_of
from tests.walk import Walk

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (ROOT, ROOT / "fmu_src")
TIMES = 30
CLOCK = [0.01 * k for k in range(1001)]  # of the default experiment
HANGING = 3600.0  # a process that is not through by then [s] hangs; the longest takes seconds


def process_of(name: str, fmu: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program of this module in a process of its own, which must survive."""
    # libtbb of the `tbb` package, which Ecos needs, lies in the lib folder of the environment.
    libraries = os.pathsep.join(filter(None, [f"{sys.prefix}/lib", os.environ.get("LD_LIBRARY_PATH")]))
    done = subprocess.run(
        [sys.executable, "-m", "tests.hosts", name, str(fmu), *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, PACKAGES)), "LD_LIBRARY_PATH": libraries},
        capture_output=True,
        text=True,
        timeout=HANGING,
        check=False,
    )
    assert done.returncode == 0, f"exit status {done.returncode}: {done.stderr[-2000:]}"
    return done


def run_host(name: str, fmu: Path, *arguments: str) -> Any:
    """Run a program of this module in a process of its own, which must survive, and return its result."""
    done = process_of(name, fmu, *arguments)
    word, result = done.stdout.split(maxsplit=1)
    assert word == "survived", done.stdout
    return literal_eval(result)


def needs(module: str) -> pytest.MarkDecorator:
    """Return the mark that skips a test where the importer `module` is missing."""
    return pytest.mark.skipif(
        find_spec(module) is None, reason=f"{module} is not installed: pip install '.[importers]'"
    )


@contextmanager
def extracted(path: Path) -> Iterator[Fmu]:
    with tempfile.TemporaryDirectory() as folder:
        yield Fmu(path, Path(folder))


def legal_run(fmu: Fmu) -> float:
    """Return x at the end of the default experiment."""
    with fmu.running() as instance:
        instance.run(CLOCK)
        return instance.get(fmu.plant.x)[0]


def fmpy_errors(path: Path, stderr: str = "open") -> float:
    """Errors of every kind in FMPy, each followed by calls, freeing and collecting."""
    from tests.test_conduct_reports import FAULTS

    if stderr == "closed":
        sys.stderr.close()
    elif stderr == "none":
        sys.stderr = None  # type: ignore[assignment]  # as under pythonw
    with extracted(path) as fmu:
        names = (fmu.plant.mass, *fmu.plant.state, fmu.plant.a, fmu.plant.energy)
        read = [fmu.reference[name] for name in names]
        gc.freeze()  # what is imported need not be searched
        for _ in range(TIMES if stderr == "open" else 3):
            with fmu.instance("other", logging=False) as other:  # writes to stderr
                for fault in FAULTS.values():
                    with fmu.instance() as instance:
                        for _ in range(3):
                            instance.reset()
                            assert is_error(fault(instance))
                            fault(instance)
                            instance.get_references("Real", read)
                            instance.step(0.0, 0.01)
                            instance.free_state(instance.save())
                        fault(other)
            collect()
        return legal_run(fmu)


def fmpy_interrupted(path: Path) -> float:
    """Ctrl-C in the middle of a long step, again and again."""

    def interrupt(_: int, frame: FrameType | None) -> None:
        if frame is not None and frame.f_code.co_name == "explicit_runge_kutta4":
            raise KeyboardInterrupt
        signal.setitimer(signal.ITIMER_REAL, 0.005)  # the step has not begun

    signal.signal(signal.SIGALRM, interrupt)
    with extracted(path) as fmu:
        for _ in range(TIMES):
            with fmu.running({"solver.stepSize": 1e-7}) as instance:
                before = instance.get(*fmu.plant.calculated)
                for _ in range(3):
                    signal.setitimer(signal.ITIMER_REAL, 0.005)
                    assert is_error(instance.step(0.0, 100.0))  # minutes
                    assert "KeyboardInterrupt" in instance.errors[0]
                assert instance.get(*fmu.plant.calculated) == before
            collect()
        return legal_run(fmu)


def fmpy_interrupted_anywhere(path: Path, instances: str) -> float:
    """Ctrl-C after 3 ms of setting, stepping and reading, 1000 times, in "one" instance or "each" time in a new one."""
    interrupted = False

    def interrupt(_: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        while frame is not None:
            if frame.f_code is work.__code__:
                interrupted = True
                raise KeyboardInterrupt
            frame = frame.f_back
        signal.setitimer(signal.ITIMER_REAL, 0.003)  # the work has not begun

    def work(instance: Instance) -> None:
        plant = instance.fmu.plant
        while not interrupted:
            instance.set(plant.input, 0.1)
            instance.step(0.0, 0.01)
            instance.set(plant.input, 0.0)
            instance.step(0.0, 0.01)
            for name in (plant.x, plant.a, plant.energy):
                instance.get_references("Real", [instance.fmu.reference[name]])
            instance.free_state(instance.save())

    signal.signal(signal.SIGALRM, interrupt)
    with extracted(path) as fmu:
        instance = Instance(fmu)
        instance.initialize()
        for _ in range(1000):
            interrupted = False
            signal.setitimer(signal.ITIMER_REAL, 0.003)
            # In the host it is raised here; in the FMU it is an error, which stops the saving of a state.
            with suppress(KeyboardInterrupt, AssertionError):
                work(instance)
            instance.log.clear()
            if instances == "each":
                instance.free()
                instance = Instance(fmu)
                instance.initialize()
        collect()
        assert instance.reset() == OK
        assert instance.initialize() == OK
        instance.run(CLOCK)
        (x,) = instance.get(fmu.plant.x)
        instance.free()
        assert legal_run(fmu) == x
        return x


def libcosimpy_run(path: Path, start: dict[str, float] | None = None, shown: str = "FATAL") -> float:
    """Run the default experiment in libcosimpy; return x, NaN if a step failed."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel[shown])
    plant = plant_of(read_model_description(str(path)))
    execution = CosimExecution.from_step_size(10_000_000)  # ns
    slave = execution.add_local_slave(CosimLocalSlave(str(path), plant.system))
    for name, value in (start or {}).items():
        assert execution.real_initial_value(slave, plant.reference[name], value)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    if not all(execution.step() for _ in range(1000)):
        return nan
    return float(observer.last_real_values(slave, [plant.reference[plant.x]])[0])


def ecos_run(path: Path, start: dict[str, float] | None = None, steps: int = 1000) -> float:
    """Run the default experiment, or its first `steps` steps, in Ecos; return x."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    plant = plant_of(read_model_description(str(path)))
    with EcosSimulationStructure() as structure:
        structure.add_model(plant.system, str(path))
        structure.add_parameter_set(
            "start", {f"{plant.system}::{name}": value for name, value in (start or {}).items()}
        )
        with EcosSimulation(structure=structure, step_size=0.01) as simulation:
            simulation.init(parameter_set="start")
            simulation.step(steps)
            return float(simulation.get_real(f"{plant.system}::{plant.x}"))


def libcosimpy_errors(path: Path) -> float:
    """Divergence in libcosimpy. (It aborts on an error of any FMU during initialization.)"""
    for _ in range(TIMES):
        assert isnan(libcosimpy_run(path, {plant_of(read_model_description(str(path))).drag: 1e5}))
        collect()
    return libcosimpy_run(path)


def libcosimpy_unstable(path: Path) -> float:
    """Run with a step size that is warned of, and let libcosimpy show warnings; return x."""
    return libcosimpy_run(path, {"solver.stepSize": 1000.0}, "WARNING")


def ecos_unstable(path: Path) -> float:
    """Do the same in Ecos, which shows warnings of an FMU where it shows all that helps to debug."""
    from ecospy import EcosLib

    EcosLib.set_log_level("debug")
    return ecos_run(path, {"solver.stepSize": 1000.0}, steps=10)


def ecos_errors(path: Path) -> float:
    """Errors in Ecos, which takes no notice of them and goes on with the state before."""
    plant = plant_of(read_model_description(str(path)))
    starts: list[dict[str, float]] = [{plant.mass: -1.0}, {plant.input: nan}, {plant.drag: 1e5}]
    for k in range(TIMES):
        ecos_run(path, starts[k % 3], steps=10)
        collect()
    return ecos_run(path)


def restored_future(path: Path, state: str) -> list[tuple[float, ...]]:
    """Return what follows after a state of another process."""
    from tests.test_conduct_state import follow

    with extracted(path) as fmu, fmu.instance() as instance:
        assert instance.restore_bytes(bytes.fromhex(state)) == OK
        return follow(instance)


def many_in_sequence(path: Path, count: str) -> tuple[int, float]:
    """Return the growth of the memory [KiB] over so many instances, and x of the last one."""
    with extracted(path) as fmu:
        keeper = Instance(fmu)  # keeps the library loaded
        for k in range(int(count) + 300):
            if k == 300:  # by then the caches are filled
                before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            keeper.slave.instantiate(callbacks=keeper.slave.callbacks)
            assert keeper.initialize() == OK
            assert keeper.step(0.0, 0.01) == OK
            (x,) = keeper.get(fmu.plant.x)
            keeper.slave.fmi2FreeInstance(keeper.slave.component)
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, x


def many_runs(path: Path, count: str) -> tuple[int, int, float]:
    """Return by how much memory [KiB] and mappings grew over so many runs of the file, and x of the last one."""

    x = plant_of(read_model_description(str(path))).x

    def used() -> tuple[int, int]:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[1])
        mappings = Path("/proc/self/maps").read_text("utf-8", "surrogateescape").count("\n")
        return pages * resource.getpagesize() // 1024, mappings

    def run() -> float:
        return float(simulate_fmu(str(path), stop_time=0.01, output=[x])[x][-1])

    for _ in range(200):  # the caches are filled
        run()
    memory, mappings = used()
    for _ in range(int(count)):
        end = run()
    memory_then, mappings_then = used()
    return memory_then - memory, mappings_then - mappings, end


def not_utf8(path: Path) -> float:
    """Pass strings that are no UTF-8, which the wrapper cannot convert; return x of a legal run."""
    with extracted(path) as fmu:
        for _ in range(TIMES):
            with fmu.instance() as instance:
                for _ in range(3):
                    instance.call("fmi2SetString", (c_uint * 1)(0), 1, (c_char_p * 1)(b"\xff\xfe"))
            collect()
        return legal_run(fmu)


def fuzz(path: Path, seed: str, count: str) -> tuple[float, int, int]:
    """Walk at random over the calls of FMI; return x of a legal run and the numbers of calls and of errors."""
    with extracted(path) as fmu:
        walk = Walk(fmu, Random(int(seed)))
        for _ in range(int(count)):
            walk.call()
        walk.end()
        return legal_run(fmu), walk.calls, walk.errors


if __name__ == "__main__":
    _, program, fmu, *arguments = sys.argv
    print("survived", repr(globals()[program](Path(fmu), *arguments)))
