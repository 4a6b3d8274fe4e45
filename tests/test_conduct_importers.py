"""Real importers agree with FMPy, and a static checker finds nothing to complain about."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import simulate_fmu

from tests.driver import Fmu
from tests.hosts import needs, run_host
from tests.plants import Plant
from tests.toolchain import need, output_of

VERSION = "1.1.3"
POM = f"""
<project>
  <modelVersion>4.0.0</modelVersion>
  <groupId>local</groupId>
  <artifactId>vdmcheck</artifactId>
  <version>1</version>
  <dependencies>
    <dependency>
      <groupId>org.into-cps.vdmcheck.fmi2</groupId>
      <artifactId>vdmcheck2</artifactId>
      <version>{VERSION}</version>
    </dependency>
  </dependencies>
</project>
"""
COFMUPY = (
    "cofmupy==1.0.0",
    "fmpy==0.3.20",
    "confluent-kafka",
    "joblib",
    "narwhals",
    "networkx",
    "pandas",
    "plotly",
)
COPY = "org.apache.maven.plugins:maven-dependency-plugin:3.6.1:copy-dependencies"


def default_end(path: Path, plant: Plant) -> float:
    """Return x at the end of the default experiment in FMPy."""
    return float(simulate_fmu(str(path), output=[plant.x])[plant.x][-1])


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_run", marks=needs("libcosimpy")),
        pytest.param("ecos_run", marks=needs("ecospy")),
    ],
)
def test_the_default_experiment_agrees_with_fmpy(fmu_path: Path, plant: Plant, program: str) -> None:
    # They form their communication points otherwise: 1000 steps, each with a rounding of the clock of ulp(10 s) =
    # 1.8e-15 s at a speed below 2, if all had the same sign. The substeps are the same.
    assert run_host(program, fmu_path) == pytest.approx(default_end(fmu_path, plant), rel=0.0, abs=1e-12)


@pytest.fixture(scope="session")
def cofmupy(pytestconfig: pytest.Config) -> Path:
    """Return a folder with CoFmuPy and those of its requirements that it imports, from the index or from the last time.

    They exclude the versions of FMPy and pythonfmu that the tests have.
    """
    pytest.importorskip("matplotlib", reason="CoFmuPy needs matplotlib: pip install '.[report]'")
    folder = pytestconfig.cache.mkdir(f"{COFMUPY[0]}-{sys.implementation.cache_tag}")
    if not (folder / "cofmupy").is_dir():
        command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", folder]
        done = subprocess.run([*command, *COFMUPY], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            pytest.skip(f"CoFmuPy cannot be installed: {done.stderr.strip().splitlines()[-1]}")
    return folder


@pytest.mark.slow
def test_cofmupy_agrees_with_fmpy(fmu_path: Path, plant: Plant, cofmupy: Path) -> None:
    host = Path(__file__).with_name("cofmupy_host.py")
    printed = output_of(
        [sys.executable, host, fmu_path, plant.x], env=os.environ | {"PYTHONPATH": str(cofmupy)}
    )
    (found,) = re.findall(rf"^{plant.x} (.*)$", printed, re.MULTILINE)
    # It adds up its steps.
    assert float(found) == pytest.approx(default_end(fmu_path, plant), rel=0.0, abs=1e-12)


@pytest.fixture(scope="session")
def vdmcheck(pytestconfig: pytest.Config) -> Path:
    """Return VDMCheck2 laid out as in its distribution, from Maven Central or from the last time."""
    need("java", "mvn")
    folder = pytestconfig.cache.mkdir(f"vdmcheck2-{VERSION}")
    if not (folder / "fmi2schema").is_dir():
        (folder / "pom.xml").write_text(POM)
        options = [COPY, f"-DoutputDirectory={folder}", "-Dmdep.stripVersion=true"]
        done = subprocess.run(
            ["mvn", "-q", "-B", "-f", folder / "pom.xml", *options],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            pytest.skip(f"VDMCheck2 cannot be fetched from Maven Central: {done.stdout.splitlines()[0]}")
        for jar in ("rule-model.jar", "static-model.jar", "vdmcheck2.jar"):
            shutil.unpack_archive(folder / jar, folder, "zip")
    return folder / "vdmcheck2.jar"


def complaints(vdmcheck: Path, description: Path) -> str:
    done = subprocess.run(
        ["java", "-jar", vdmcheck, description], capture_output=True, text=True, check=False
    )
    return done.stdout


@pytest.mark.slow
def test_vdmcheck_finds_nothing_to_complain_about(fmu_path: Path, vdmcheck: Path) -> None:
    assert complaints(vdmcheck, fmu_path) == "No errors found.\n"


@pytest.mark.one_model("about VDMCheck2")
@pytest.mark.slow
def test_vdmcheck_does_find_what_a_stock_fmu_has(fmu: Fmu, vdmcheck: Path, tmp_path: Path) -> None:
    root = ElementTree.parse(fmu.folder / "modelDescription.xml")
    root.getroot().set("generationDateAndTime", "2026-11-22T00:00:00+00:00")
    root.write(tmp_path / "modelDescription.xml")
    assert "validGenerationDateAndTime" in complaints(vdmcheck, tmp_path / "modelDescription.xml")
