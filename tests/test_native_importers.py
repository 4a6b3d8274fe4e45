"""The native FMU in importers other than FMPy, none of which loads Python for it."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import fmpy
import pytest

import build_fmu
from native import build as native
from tests.driver import Fmu
from tests.plants import PENDULUM
from tests.toolchain import COMPILER, HERE, need, needs_compiler, on_linux, output_of

IMPORTERS = HERE / "native_importers"


@pytest.fixture(scope="session")
def final_angle(fmu_path: Path) -> float:
    """Of the default experiment, by the FMU with Python in FMPy."""
    return float(fmpy.simulate_fmu(str(fmu_path), output=["phi"])["phi"][-1])


def printed_angle(command: list[Any]) -> float:
    return float(re.findall(r"^phi (.*)$", output_of(command), re.MULTILINE)[0])


@on_linux
@needs_compiler
def test_a_host_in_c_needs_no_python(native_fmu: Fmu, tmp_path: Path, final_angle: float) -> None:
    host = tmp_path / "host"
    options = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    output_of([COMPILER, *options, HERE / "native_host.c", "-o", host, "-ldl"])
    binaries = native_fmu.folder / "binaries" / fmpy.platform
    library = binaries / f"{native.MODEL_NAME}{fmpy.sharedLibraryExtension}"
    command = [host, library, native_fmu.description.guid, str(PENDULUM.reference["phi"])]
    assert printed_angle(command) == pytest.approx(final_angle, abs=1e-12)


@pytest.fixture(scope="session")
def jars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the Java importers of pom.xml from Maven Central."""
    need("java", "mvn")
    folder = tmp_path_factory.mktemp("jars")
    command = ["mvn", "-q", "-B", "-f", IMPORTERS / "pom.xml", "dependency:copy-dependencies"]
    command += [f"-DoutputDirectory={folder}", "-Dmdep.stripVersion=true"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"mvn cannot get the importers: {done.stdout.strip().splitlines()[:1]}")
    return folder


@on_linux
@pytest.mark.slow
@pytest.mark.parametrize("program", ["Fmi4j.java", "JavaFmi.java"])
def test_importers_in_java_agree_and_load_no_python(
    native_path: Path, jars: Path, program: str, final_angle: float
) -> None:
    # JavaFMI reaches into java.prefs for a chmod.
    options = ["--add-opens", "java.prefs/java.util.prefs=ALL-UNNAMED", "-cp", f"{jars}/*"]
    command = ["java", *options, IMPORTERS / program, native_path, str(PENDULUM.reference["phi"])]
    assert printed_angle(command) == pytest.approx(final_angle, abs=1e-12)


def test_fmpy_compile_rebuilds_the_binary(native_path: Path, tmp_path: Path, final_angle: float) -> None:
    need("cmake", path=search_path())
    copy = tmp_path / "copy.fmu"
    entries = build_fmu.read_entries(native_path)
    build_fmu.write_entries(
        copy, {name: data for name, data in entries.items() if not name.startswith("binaries/")}
    )
    program = f"import fmpy.cli, sys; sys.argv = ['fmpy', 'compile', {str(copy)!r}]; fmpy.cli.main()"
    output_of([sys.executable, "-c", program], env=os.environ | {"PATH": search_path()})
    assert fmpy.platform in fmpy.supported_platforms(str(copy))
    # The flags are not those of the build, and the bits still are.
    assert float(fmpy.simulate_fmu(str(copy), output=["phi"])["phi"][-1]) == final_angle


def search_path() -> str:
    return os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
