"""The C code in programs of this machine: linked in, short of memory, strange, at random under sanitizers."""

import os
import re
import subprocess
import sys
from pathlib import Path
from shutil import unpack_archive
from typing import Any
from xml.etree import ElementTree

import pytest

from native import build as native
from tests.plants import PENDULUM, PLANTS, SPRING, Plant
from tests.toolchain import COMPILER, COMPILERS, HERE, need, needs_compiler, on_linux, output_of, symbols

CALLS = 1_500_000  # of a seed of the random calls: about a minute of them in all


def standard_headers(folder: Path) -> Path:
    """Write the headers as the standard has them, with the prefix that those of FMPy leave out."""
    folder.mkdir()
    for path in native.FMI_HEADERS.glob("fmi2*.h"):
        text = path.read_text("utf-8")
        if path.name == "fmi2Functions.h":
            text, count = re.subn(
                r"^#define fmi2FullName\(name\).*$",
                "#if !defined(FMI2_OVERRIDE_FUNCTION_PREFIX) && defined(FMI2_FUNCTION_PREFIX)\n"
                "#define fmi2Paste(a,b) a ## b\n"
                "#define fmi2PasteB(a,b) fmi2Paste(a,b)\n"
                "#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)\n"
                "#else\n"
                "#define fmi2FullName(name) name\n"
                "#endif",
                text,
                flags=re.MULTILINE,
            )
            assert count == 1
        (folder / path.name).write_text(text, "utf-8")
    return folder


def global_names(file: Path) -> set[str]:
    return {line.split()[-1] for line in output_of(["nm", "-g", "--defined-only", file]).splitlines()}


@needs_compiler
@on_linux
def test_the_sources_of_two_fmus_link_into_one_program(folder: Path, tmp_path: Path) -> None:
    need("nm")
    headers, sources = standard_headers(tmp_path / "fmi"), folder / "sources"
    listed = ElementTree.parse(folder / "modelDescription.xml").getroot().iter("File")
    assert [node.get("name") for node in listed] == ["all.c"]
    names = {}
    for name, flags in {
        "A_": ["-DFMI2_FUNCTION_PREFIX=A_"],
        "B_": ["-DFMI2_FUNCTION_PREFIX=B_"],
        f"{native.MODEL_NAME}_": [],
        "": ["-DFMI2_OVERRIDE_FUNCTION_PREFIX"],
    }.items():
        output = tmp_path / f"{name}.o"
        options = ["-std=c11", "-O0", "-Wall", "-Wextra", "-Werror", "-pedantic", *flags, f"-I{headers}"]
        output_of([COMPILER, *options, "-c", sources / "all.c", "-o", output])
        names[name] = global_names(output)
    assert len(names[""]) == 34
    for prefix, found in names.items():
        assert found == {prefix + name for name in names[""]}
    program = tmp_path / "program"
    command = [COMPILER, "-std=c11", f"-I{headers}", f"-I{sources}", HERE / "native_linked_twice.c"]
    command += [tmp_path / "A_.o", tmp_path / "B_.o", "-lm", "-o", program]
    output_of(command)
    assert output_of([program]) == "2.0 2.0 21\n"
    # The library of the build, with headers of either kind, has the names of the standard.
    for include in (headers, native.FMI_HEADERS):
        library = tmp_path / "library.so"
        flags = [*native.FLAGS, "-fPIC", "-fvisibility=hidden", "-shared", f"-I{include}"]
        output_of([COMPILER, *flags, sources / "all.c", "-lm", "-o", library])
        assert symbols(library)[0] == names[""]


@needs_compiler
def test_an_instance_that_there_is_no_memory_for_is_reported(folder: Path, tmp_path: Path) -> None:
    program, sources = tmp_path / "program", folder / "sources"
    command = [COMPILER, "-std=c11", "-Dcalloc=failing_calloc", f"-I{native.FMI_HEADERS}", f"-I{sources}"]
    command += [
        HERE / "native_no_memory.c",
        *(sources / name for name in native.SOURCES),
        "-lm",
        "-o",
        program,
    ]
    output_of(command)
    assert output_of([program]) == "poor 3 logStatusError there is no memory for an instance\n"


on_both_models = pytest.mark.parametrize("model", PLANTS, indirect=True, scope="session")


@pytest.fixture(scope="session")
def sources(model: str, builds: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the C files of a model."""
    folder = tmp_path_factory.mktemp("sources")
    unpack_archive(builds.path(model, "native"), folder, "zip")
    return folder / "sources"


@pytest.fixture(scope="session")
def strange_host(sources: Path, plant: Plant, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return a function that compiles the strange host with a compiler and a level of optimization."""
    built: dict[tuple[str, str], list[str]] = {}

    def compiled(compiler: str, level: str) -> list[str]:
        if not sys.platform.startswith("linux"):
            pytest.skip("Linux only")
        need(compiler)
        if (compiler, level) not in built:
            program = tmp_path_factory.mktemp("host") / "host"
            flags = [flag for flag in native.FLAGS if not flag.startswith("-O")]
            command = [compiler, *flags, level, "-pthread", f"-I{native.FMI_HEADERS}", f"-I{sources}"]
            command += [HERE / "native_strange_host.c", *(sources / name for name in native.SOURCES)]
            output_of([*command, "-lm", "-o", program])
            built[compiler, level] = [str(program), plant.mass, plant.drag, plant.a]
        return built[compiler, level]

    return compiled


def messages_in(program: list[str], condition: str, **environment: str) -> list[str]:
    """Return what is logged in a host of a condition."""
    return output_of([*program, condition], env=os.environ | environment).splitlines()


BUILDS = [(compiler, level) for compiler in COMPILERS for level in ("-O0", "-O3")]


@on_both_models
@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_a_thread_with_a_stack_of_32_kib_can_do_all(strange_host: Any, compiler: str, level: str) -> None:
    program = strange_host(compiler, level)
    messages = messages_in(program, "plain")
    assert len(messages) == 8
    assert messages_in(program, "stack") == messages


@on_both_models
@pytest.mark.parametrize(("compiler", "level"), BUILDS)
def test_only_what_overflows_raises_floating_point_exceptions(
    strange_host: Any, compiler: str, level: str
) -> None:
    program = strange_host(compiler, level)
    assert messages_in(program, "traps") == messages_in(program, "plain")[:-2]


@pytest.mark.parametrize("rounding", ["upward", "downward", "towardzero"])
def test_numbers_in_messages_do_not_follow_the_rounding_of_the_host(strange_host: Any, rounding: str) -> None:
    program = strange_host("gcc", "-O0")
    assert messages_in(program, rounding) == messages_in(program, "plain")[1:-2]


def test_numbers_in_messages_do_not_follow_the_locale_of_the_host(strange_host: Any, tmp_path: Path) -> None:
    need("localedef")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", tmp_path / "de_DE.UTF-8"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip(f"localedef cannot make de_DE: {done.stderr.strip()[:200]}")
    program = strange_host("gcc", "-O0")
    german = {"LOCPATH": str(tmp_path), "LC_ALL": "de_DE.UTF-8"}
    assert messages_in(program, "locale", **german) == messages_in(program, "plain")


@on_linux
@pytest.mark.slow
@pytest.mark.parametrize(
    ("compiler", "model"),
    # What a compiler makes of the shell is seen with one model.
    [*((compiler, PENDULUM.name) for compiler in COMPILERS), (COMPILERS[0], SPRING.name)],
    indirect=["model"],
)
def test_random_calls_find_no_fault_under_the_sanitizers(
    sources: Path, tmp_path: Path, compiler: str
) -> None:
    need(compiler)
    program = tmp_path / "fuzz"
    options = ["-std=c11", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
    sanitizers = ["-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
    files = [HERE / "native_fuzz.c", *native.SOURCES]
    command = [compiler, *options, *sanitizers, "-I.", *files, "-o", program, "-lm"]
    output_of(command, cwd=sources)
    environment = os.environ | {"ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"}
    for seed in (1, 2):
        printed = output_of([program, str(seed), str(CALLS)], env=environment)
        counts = {name: int(count) for name, count in re.findall(r"(\w+) (\d+)", printed)}
        assert min(counts.values()) > 0, counts  # every status was reached
