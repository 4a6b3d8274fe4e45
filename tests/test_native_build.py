"""The libraries of the native FMU, and what is told where none can be built."""

import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu

import build_fmu
from native import build as native
from tests.toolchain import (
    COMPILER,
    COMPILERS,
    need,
    need_zig,
    needs_compiler,
    on_linux,
    output_of,
    symbols,
)


@on_linux
def test_the_library_exports_the_functions_of_fmi_alone(folder: Path) -> None:
    need("nm")
    exported, needed = symbols(folder / "binaries" / "linux64" / "DampedPendulumNative.so")
    header = (native.FMI_HEADERS / "fmi2Functions.h").read_text("utf-8")
    common, _, co_simulation = re.split("Functions for FMI2 for (?:Model Exchange|Co-Simulation)", header)[:3]
    assert exported == set(re.findall(r"#define (fmi2\w+) +fmi2FullName", common + co_simulation))
    assert not [name for name in needed if "Py" in name]


@needs_compiler
@on_linux
def test_no_global_can_change(folder: Path, tmp_path: Path) -> None:
    """Instances in several threads share constants alone."""
    need("nm")
    for source in native.SOURCES:
        output = tmp_path / "object.o"
        options = ["-std=c11", "-O0", "-fno-pic", f"-I{native.FMI_HEADERS}", "-c"]
        output_of([COMPILER, *options, source, "-o", output], cwd=folder / "sources")
        assert not re.findall(r"^\S* [bBcCdDgGsS] .*$", output_of(["nm", output]), re.MULTILINE)


def images(universal: bytes) -> list[bytes]:
    """Return the images in a universal Mach-O file."""
    count = struct.unpack_from(">I", universal, 4)[0]
    places = [struct.unpack_from(">II", universal, 8 + 20 * i + 8) for i in range(count)]
    return [universal[at : at + size] for at, size in places]


def least_macos(image: bytes) -> tuple[int, int]:
    """Return the oldest version of macOS that a 64-bit Mach-O image runs on."""
    at = 32
    for _ in range(struct.unpack_from("<I", image, 16)[0]):
        command, size, first, second = struct.unpack_from("<IIII", image, at)
        if command in (0x24, 0x32):  # LC_VERSION_MIN_MACOSX, LC_BUILD_VERSION
            version = first if command == 0x24 else second
            if command == 0x32:
                version = struct.unpack_from("<I", image, at + 12)[0]
            return version >> 16, version >> 8 & 0xFF
        at += size
    raise AssertionError("no version")


@pytest.mark.slow
def test_every_platform_is_built_on_this_machine(tmp_path: Path, native_path: Path) -> None:
    need_zig()
    path = build_fmu.build_native(tmp_path / "all.fmu")
    entries = build_fmu.read_entries(path)
    binaries = {name.split("/")[1]: data for name, data in entries.items() if name.startswith("binaries/")}
    magic = {
        "linux64": b"\x7fELF",
        "aarch64-linux": b"\x7fELF",
        "win64": b"MZ",
        "darwin64": b"\xca\xfe\xba\xbe\0\0\0\2",
    }
    assert {platform: data[: len(magic[platform])] for platform, data in binaries.items()} == magic
    assert validate_fmu(str(path)) == []
    assert build_fmu.build_native(tmp_path / "again.fmu").read_bytes() == path.read_bytes()
    assert [least_macos(image) for image in images(binaries["darwin64"])] == [(11, 0), (11, 0)]
    host, everywhere = (build_fmu.read_entries(p)["modelDescription.xml"] for p in (native_path, path))
    assert host == everywhere  # the GUID is that of the sources
    if sys.platform.startswith("linux"):
        library = tmp_path / "library.so"
        library.write_bytes(binaries["linux64"])
        exported, needed = symbols(library)
        assert {name[:4] for name in exported} == {"fmi2"}
        versions = {tuple(map(int, name.split("GLIBC_")[1].split("."))) for name in needed if "GLIBC" in name}
        assert max(versions) <= (2, 17)
        runs = [fmpy.simulate_fmu(str(p), output=["phi", "w", "a", "E"]) for p in (native_path, path)]
        assert (runs[0] == runs[1]).all()


@needs_compiler
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_sources_compile_without_a_warning(folder: Path, compiler: str) -> None:
    need(compiler)
    options = ["-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow"]
    options += ["-Wcast-qual", "-Wnull-dereference", "-c", "-o", os.devnull]
    for standard, level in (("c11", "-O0"), ("c11", "-O3"), ("c17", "-O2")):
        command = [compiler, f"-std={standard}", level, *options, f"-I{native.FMI_HEADERS}", *native.SOURCES]
        output_of(command, cwd=folder / "sources")


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
def test_the_sources_refuse_to_be_compiled_without_nan(folder: Path, compiler: str, flag: str) -> None:
    need(compiler)
    command = [compiler, "-std=c11", flag, "-fsyntax-only", f"-I{native.FMI_HEADERS}", *native.SOURCES]
    done = subprocess.run(command, cwd=folder / "sources", capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "those take out the tests for NaN and infinity" in done.stderr


def test_without_a_compiler_there_is_one_line_and_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "find_spec", lambda name: None)
    monkeypatch.setattr(native.shutil, "which", lambda name: None)
    with pytest.raises(SystemExit) as raised:
        build_fmu.main(["--native", "--output", str(tmp_path / "x.fmu")])
    assert raised.value.code == 2
    assert capsys.readouterr().err == (
        "build_fmu.py: --native: no C compiler: install the package ziglang, or cc, gcc or clang\n"
    )
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_what_the_compiler_refuses_is_printed_and_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(native, "find_spec", lambda name: None)
    monkeypatch.setattr(native, "FLAGS", (*native.FLAGS, "-DVARIABLE_COUNT="))
    assert build_fmu.main(["--native", "--output", str(tmp_path / "x.fmu")]) == 1
    assert "VARIABLE_COUNT" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_zig_has_a_cache_where_that_of_the_user_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "ZIG_GLOBAL_CACHE_DIR"
    file = tmp_path / "file"  # below which no user can write
    file.write_text("", "utf-8")
    for variable in (name, "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(variable, raising=False)
    for home in (file, None):
        if home is None:
            monkeypatch.delenv("HOME")
        else:
            monkeypatch.setenv("HOME", str(home))
        with native.zig_environment() as environment:
            folder = Path(environment[name])
            (folder / "written").write_text("", "utf-8")
        assert not folder.exists()
    monkeypatch.setenv("LOCALAPPDATA" if os.name == "nt" else "HOME", str(tmp_path))
    with native.zig_environment() as environment:
        assert name not in environment
    monkeypatch.setenv(name, "where the user wants it")
    monkeypatch.setenv("HOME", str(file))
    with native.zig_environment() as environment:
        assert environment[name] == "where the user wants it"


@on_linux
@pytest.mark.slow
def test_zig_compiles_without_a_home_that_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need_zig()
    file = tmp_path / "file"
    file.write_text("", "utf-8")
    for variable in ("ZIG_GLOBAL_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(file))
    monkeypatch.setattr(native, "TARGETS", native.TARGETS[:1])
    assert list(native.binaries("guid")) == ["binaries/linux64/DampedPendulumNative.so"]
