"""After an error the host lives, in processes of their own: a crash is an exit status."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.driver import Fmu
from tests.hosts import needs, process_of, run_host
from tests.plants import Plant
from tests.twin import Twin


def default_end(plant: Plant) -> float:
    """Return x at the end of the default experiment."""
    twin = Twin(plant)
    for k in range(1000):
        twin.step(0.01 * k, 0.01 * (k + 1) - 0.01 * k)
    return twin.x


@pytest.mark.slow
@pytest.mark.parametrize("stderr", ["open", "closed", "none"])
def test_fmpy_survives_errors_of_every_kind(fmu_path: Path, plant: Plant, stderr: str) -> None:
    assert run_host("fmpy_errors", fmu_path, stderr) == default_end(plant)


@pytest.mark.pythonfmu_only
def test_fmpy_survives_control_c_in_a_long_step(fmu_path: Path, plant: Plant) -> None:
    assert run_host("fmpy_interrupted", fmu_path) == default_end(plant)


@pytest.mark.pythonfmu_only
@pytest.mark.one_model("most of its time is in the shell, whose lines are those of any model")
@pytest.mark.slow
@pytest.mark.parametrize("instances", ["one", "each"])
def test_fmpy_survives_control_c_anywhere(fmu_path: Path, plant: Plant, instances: str) -> None:
    assert run_host("fmpy_interrupted_anywhere", fmu_path, instances) == default_end(plant)


@pytest.mark.one_model("no Python or C of a model is reached")
def test_strings_that_are_not_utf8_do_no_harm(fmu_path: Path, plant: Plant) -> None:
    assert run_host("not_utf8", fmu_path) == default_end(plant)


@pytest.mark.one_model("errors end in the shell, and FMPy shows those of any model")
@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_errors", marks=needs("libcosimpy")),
        pytest.param("ecos_errors", marks=[needs("ecospy"), pytest.mark.slow]),
    ],
)
def test_other_importers_survive_errors(fmu_path: Path, plant: Plant, program: str) -> None:
    # Their communication points differ from 0.01*k in the last bits.
    assert run_host(program, fmu_path) == pytest.approx(default_end(plant), abs=1e-12)


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_unstable", marks=needs("libcosimpy")),
        pytest.param("ecos_unstable", marks=needs("ecospy")),
    ],
)
def test_other_importers_show_a_warning_once(fmu_path: Path, program: str) -> None:
    done = process_of(program, fmu_path)
    assert (done.stdout + done.stderr).count(
        "substeps of solver.stepSize = 1000.0 s would be unstable: "
    ) == 1


INSTANTIATE_AND_FREE = """
import ctypes, sys
folder = sys.argv[1]
library = ctypes.CDLL(f"{folder}/binaries/linux64/DampedPendulum.so")
libc = ctypes.CDLL(None)
address = lambda function: ctypes.cast(function, ctypes.c_void_p).value
callbacks = (ctypes.c_void_p * 5)(None, address(libc.calloc), address(libc.free), None, None)
library.fmi2Instantiate.restype = ctypes.c_void_p
uri = f"file://{folder}/resources".encode()
component = library.fmi2Instantiate(b"pendulum", 1, b"", uri, callbacks, 0, 0)
assert component
library.fmi2FreeInstance(ctypes.c_void_p(component))
print("freed")
"""


@pytest.mark.pythonfmu_only
@pytest.mark.one_model("about the library of pythonfmu, which is the same for any model")
@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("valgrind") is None, reason="needs valgrind, which sees memory used after it is freed"
)
def test_the_wrapper_lets_go_of_its_state_before_the_process_ends(fmu: Fmu) -> None:
    done = subprocess.run(
        ["valgrind", "-q", "--error-limit=no", sys.executable, "-S", "-c", INSTANTIATE_AND_FREE, fmu.folder],
        env=os.environ | {"PYTHONMALLOC": "malloc"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "freed\n"
    assert "finalizePythonInterpreter" not in done.stderr
