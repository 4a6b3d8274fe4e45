"""Programs that run as processes of their own: hosts in which errors happen. `python -m tests.hosts NAME FMU`.

Each prints "survived" and the result of a legal run; a crash shows in the exit status of the process.
"""

from __future__ import annotations

import gc
import os
import resource
import subprocess
import sys
import tempfile
import zipfile
from ast import literal_eval
from importlib.util import find_spec
from math import isnan, nan
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from tests.driver import OK, Fmu, Instance, collect, is_error

ROOT = Path(__file__).resolve().parents[1]
TIMES = (
    30  # the wrapper's bookkeeping of references used to break after a few errors, at the latest after ten
)


def run_host(name: str, fmu: Path, *arguments: str) -> Any:
    """Run a program of this module in a process of its own, which must survive, and return its result."""
    # libtbb of the `tbb` package, which Ecos needs, lies in the lib folder of the environment.
    libraries = os.pathsep.join(filter(None, [f"{sys.prefix}/lib", os.environ.get("LD_LIBRARY_PATH")]))
    done = subprocess.run(
        [sys.executable, "-m", "tests.hosts", name, str(fmu), *arguments],
        cwd=ROOT,
        env=os.environ
        | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'fmu_src'}", "LD_LIBRARY_PATH": libraries},
        capture_output=True,
        text=True,
        timeout=100.0,
        check=False,
    )
    assert done.returncode == 0, f"exit status {done.returncode}: {done.stderr[-2000:]}"
    word, result = done.stdout.split(maxsplit=1)
    assert word == "survived", done.stdout
    return literal_eval(result)


def needs(module: str) -> pytest.MarkDecorator:
    """Return the mark that skips a test where the importer `module` is missing."""
    return pytest.mark.skipif(
        find_spec(module) is None, reason=f"{module} is not installed: pip install '.[importers]'"
    )


def fmpy_errors(path: Path, stderr: str = "open") -> float:
    """Errors of every kind in FMPy, each followed by calls, freeing and collecting."""
    from tests.test_conduct_reports import FAULTS

    if stderr == "closed":
        sys.stderr.close()
    elif stderr == "none":
        sys.stderr = None  # type: ignore[assignment]  # as under pythonw
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(path, Path(folder))
        gc.freeze()  # what is imported need not be searched
        for _ in range(TIMES if stderr == "open" else 3):
            with fmu.instance("other") as other:
                for fault in FAULTS.values():
                    with fmu.instance() as instance:
                        for _ in range(3):
                            instance.reset()
                            assert is_error(fault(instance))
                            fault(instance)
                            instance.get_references("Real", [0, 9, 10, 11, 12])
                            instance.step(0.0, 0.01)
                            instance.free_state(instance.save())
                        fault(other)
            collect()
        with fmu.running() as instance:
            instance.run([0.01 * k for k in range(1001)])
            return instance.get("phi")[0]


def libcosimpy_run(path: Path, start: dict[str, float] | None = None) -> float:
    """Run the default experiment in libcosimpy; return phi, NaN if a step failed."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.FATAL)
    reference = references(path)
    execution = CosimExecution.from_step_size(10_000_000)  # ns
    slave = execution.add_local_slave(CosimLocalSlave(str(path), "pendulum"))
    for name, value in (start or {}).items():
        assert execution.real_initial_value(slave, reference[name], value)
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    if not all(execution.step() for _ in range(1000)):
        return nan
    return float(observer.last_real_values(slave, [reference["phi"]])[0])


def ecos_run(path: Path, start: dict[str, float] | None = None, steps: int = 1000) -> float:
    """Run the default experiment, or its first `steps` steps, in Ecos; return phi."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("pendulum", str(path))
        structure.add_parameter_set(
            "start", {f"pendulum::{name}": value for name, value in (start or {}).items()}
        )
        with EcosSimulation(structure=structure, step_size=0.01) as simulation:
            simulation.init(parameter_set="start")
            simulation.step(steps)
            return float(simulation.get_real("pendulum::phi"))


def libcosimpy_errors(path: Path) -> float:
    """Divergence in libcosimpy. (It aborts on an error of any FMU during initialization.)"""
    for _ in range(TIMES):
        assert isnan(libcosimpy_run(path, {"gamma": 1e5}))
        collect()
    return libcosimpy_run(path)


def ecos_errors(path: Path) -> float:
    """Errors in Ecos, which takes no notice of them and goes on with the state before."""
    starts: list[dict[str, float]] = [{"m": -1.0}, {"tau": nan}, {"gamma": 1e5}]
    for k in range(TIMES):
        ecos_run(path, starts[k % 3], steps=10)
        collect()
    return ecos_run(path)


def restored_future(path: Path, state: str) -> list[tuple[float, ...]]:
    """Return what follows after a state of another process."""
    from tests.test_conduct_state import follow

    with tempfile.TemporaryDirectory() as folder, Fmu(path, Path(folder)).instance() as instance:
        assert instance.restore_bytes(bytes.fromhex(state)) == OK
        return follow(instance)


def many_in_sequence(path: Path, count: str) -> tuple[int, float]:
    """Return the growth of the memory [KiB] over so many instances, and phi of the last one."""
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(path, Path(folder))
        keeper = Instance(fmu)  # keeps the library loaded
        for k in range(int(count) + 300):
            if k == 300:  # by then the caches are filled
                before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            keeper.slave.instantiate(callbacks=keeper.slave.callbacks)
            assert keeper.initialize() == OK
            assert keeper.step(0.0, 0.01) == OK
            (phi,) = keeper.get("phi")
            keeper.slave.fmi2FreeInstance(keeper.slave.component)
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before, phi


def references(path: Path) -> dict[str, int]:
    with zipfile.ZipFile(path) as packed:
        root = ElementTree.fromstring(packed.read("modelDescription.xml"))
    return {node.attrib["name"]: int(node.attrib["valueReference"]) for node in root.iter("ScalarVariable")}


if __name__ == "__main__":
    _, program, fmu, *arguments = sys.argv
    print("survived", repr(globals()[program](Path(fmu), *arguments)))
