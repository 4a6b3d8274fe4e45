"""What README tells of FMPy's commands: what may be typed, what is said, and what passes without a word."""

import subprocess
import sys
from pathlib import Path

import fmpy
import nbformat
import pytest


def command(name: str, fmu: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "fmpy", name, str(fmu), *options], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(["--start-values", "solver.method", "4", "phi_start", "1.57"], id="numbers"),
        pytest.param(["--start-values", "Gamma", "1"], id="a misspelt name"),
        pytest.param(["--start-values", "phi", "1"], id="an output"),
    ],
)
def test_passes_without_a_word(fmu_path: Path, options: list[str]) -> None:
    done = command("simulate", fmu_path, *options)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--start-values", "solver.method", "ExplicitEuler"], "invalid literal for int()"),
        (["--start-values", "phi_start", "90deg"], "could not convert string to float"),
        (["--validate", "--start-values", "Gamma", "1"], "could not be set: Gamma"),
        (["--validate", "--start-values", "phi", "1"], "could not be set: phi"),
    ],
)
def test_is_refused(fmu_path: Path, options: list[str], words: str) -> None:
    done = command("simulate", fmu_path, *options)
    assert done.returncode == 1
    assert words in done.stderr


@pytest.mark.parametrize("name", ["Gamma", "phi"])
def test_in_python_a_misspelt_name_and_an_output_are_refused(fmu_path: Path, name: str) -> None:
    with pytest.raises(Exception, match=f"could not be set: {name}"):
        fmpy.simulate_fmu(str(fmu_path), start_values={name: 1.0}, stop_time=0.01)


def test_why_a_value_is_refused_stands_above_the_traceback(fmu_path: Path) -> None:
    reason, _, _ = command("simulate", fmu_path, "--start-values", "gamma", "-1").stderr.partition(
        "Traceback"
    )
    assert "gamma = -1.0 N.s/m (allowed: >= 0)" in reason


def test_an_unstable_step_is_told_on_stderr(fmu_path: Path) -> None:
    done = command("simulate", fmu_path, "--start-values", "solver.stepSize", "1")
    assert (done.returncode, done.stdout) == (0, "")
    assert "substeps of solver.stepSize = 1.0 s would be unstable" in done.stderr


def test_a_notebook_is_written_beside_the_fmu(fmu_path: Path, tmp_path: Path) -> None:
    fmu = tmp_path / "DampedPendulum.fmu"
    fmu.write_bytes(fmu_path.read_bytes())
    done = command("create-jupyter-notebook", fmu)
    assert done.returncode == 0, done.stderr
    notebook = nbformat.reads(fmu.with_suffix(".ipynb").read_text("utf-8"), as_version=4)
    (code,) = (cell.source for cell in notebook.cells if cell.cell_type == "code")
    assert "'gamma':                        (0.002, 'N.s/m'),  # Drag coefficient of the bob" in code
