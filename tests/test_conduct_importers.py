"""Real importers agree with FMPy, and a static checker finds nothing to complain about."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from tempfile import gettempdir

import pytest
from fmpy import simulate_fmu

from tests.hosts import needs, run_host

VDMCHECK = ("org.into-cps.vdmcheck.fmi2", "vdmcheck2", "1.1.3")


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_run", marks=needs("libcosimpy")),
        pytest.param("ecos_run", marks=needs("ecospy")),
    ],
)
def test_the_default_experiment_agrees_with_fmpy(fmu_path: Path, program: str) -> None:
    expected = simulate_fmu(str(fmu_path), output=["phi"])["phi"][-1]
    # They form their communication points otherwise: 1000 steps, each with a rounding of the clock of ulp(10 s) =
    # 1.8e-15 s at below 2 rad/s, if all had the same sign. The substeps are the same.
    assert run_host(program, fmu_path) == pytest.approx(expected, rel=0.0, abs=1e-12)


@pytest.fixture(scope="session")
def vdmcheck() -> Path:
    """VDMCheck2 with all it needs in one file, from Maven Central or from the last time."""
    group, artifact, version = VDMCHECK
    for program in ("java", "mvn"):
        if shutil.which(program) is None:
            pytest.skip(f"VDMCheck2 needs {program}, which is not installed")
    cache = Path(os.environ.get("XDG_CACHE_HOME", gettempdir())) / f"{artifact}-{version}"
    jar = cache / f"{artifact}-{version}.jar"
    return cache if jar else cache
