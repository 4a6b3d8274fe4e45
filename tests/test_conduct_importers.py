"""Real importers agree with FMPy, and a static checker finds nothing to complain about."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import simulate_fmu

from tests.driver import Fmu
from tests.hosts import needs, run_host
from tests.plants import Plant
from tests.toolchain import need

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
COPY = "org.apache.maven.plugins:maven-dependency-plugin:3.6.1:copy-dependencies"


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_run", marks=needs("libcosimpy")),
        pytest.param("ecos_run", marks=needs("ecospy")),
    ],
)
def test_the_default_experiment_agrees_with_fmpy(fmu_path: Path, plant: Plant, program: str) -> None:
    expected = simulate_fmu(str(fmu_path), output=[plant.x])[plant.x][-1]
    # They form their communication points otherwise: 1000 steps, each with a rounding of the clock of ulp(10 s) =
    # 1.8e-15 s at a speed below 2, if all had the same sign. The substeps are the same.
    assert run_host(program, fmu_path) == pytest.approx(expected, rel=0.0, abs=1e-12)


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
