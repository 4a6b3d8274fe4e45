"""The native FMU in importers other than FMPy, none of which loads Python for it."""

import json
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


def host(fmu: Fmu, source: str, folder: Path, argument: Any) -> list[Any]:
    """Compile a host of a library and a GUID; return the command that runs it, too, with one more argument."""
    program = folder / "host"
    options = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    output_of([COMPILER, *options, HERE / source, "-o", program, "-ldl"])
    library = fmu.folder / "binaries" / fmpy.platform / f"{native.MODEL_NAME}{fmpy.sharedLibraryExtension}"
    return [program, library, fmu.description.guid, argument]


@on_linux
@needs_compiler
def test_a_host_in_c_needs_no_python(native_fmu: Fmu, tmp_path: Path, final_angle: float) -> None:
    command = host(native_fmu, "native_host.c", tmp_path, str(PENDULUM.reference["phi"]))
    assert printed_angle(command) == pytest.approx(final_angle, abs=1e-12)


@on_linux
@needs_compiler
def test_a_host_in_c_gets_the_answers_of_the_table(native_fmu: Fmu, tmp_path: Path) -> None:
    table = HERE / "conduct.json"
    calls = sum(len(case["calls"]) for case in json.loads(table.read_text("utf-8"))["cases"])
    printed = output_of(host(native_fmu, "native_conduct.c", tmp_path, table))
    assert printed == f"calls {calls}, wrong 0\n"


@on_linux
@needs_compiler
def test_the_host_in_c_sees_a_wrong_answer(native_fmu: Fmu, tmp_path: Path) -> None:
    text = (HERE / "conduct.json").read_text("utf-8")
    got = '"fmi2GetReal", "variable": "g", "reference": 3, "value": '
    for old, new in (("kg (allowed", "g (allowed"), (f"{got}9.0", f"{got}9.5")):
        assert old in text
        (tmp_path / "wrong.json").write_text(text.replace(old, new), "utf-8")
        command = host(native_fmu, "native_conduct.c", tmp_path, tmp_path / "wrong.json")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 1
        assert not done.stdout.endswith("wrong 0\n")


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
