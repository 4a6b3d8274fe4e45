"""A second run of the validation gives the numbers of the first, to the last digit; run times aside."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
# Closed forms, discrete motions, decimal series, quadrature and counts; with torque and without.
STUDIES = ("impulse_response", "methods", "traps", "crawford", "errata")


@pytest.mark.slow
def test_a_second_run_gives_the_numbers_of_the_first(native_path: Path, tmp_path: Path) -> None:
    folders = {seed: tmp_path / seed for seed in ("1", "2")}
    command = [
        sys.executable,
        "-m",
        "validation",
        *STUDIES,
        "--no-faults",
        "--no-plots",
        "--fmu",
        native_path,
    ]
    runs = [
        subprocess.Popen(
            [*command, "--output", folder],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.DEVNULL,
        )
        for seed, folder in folders.items()
    ]
    assert [run.wait() for run in runs] == [0, 0]
    first, second = (
        {file.name: file.read_bytes() for file in folder.glob("*.csv")} for folder in folders.values()
    )
    assert len(first["checks.csv"].splitlines()) > 200
    assert first == second
