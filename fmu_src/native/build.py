"""Compile the native FMU: interface.h from the interface tables, one shared library for each platform.

With the package ziglang every platform is built on any machine; without it the C compiler of this machine builds for
this machine.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from math import inf
from pathlib import Path
from typing import NamedTuple

import fmpy

from fmi.second_order import Names
from fmi.tables import Range, Variable
from methods.implicit import MAX_EVALUATIONS
from methods.solvers import MAX_SUBSTEPS, METHODS, SolverMethod
from methods.taylor import ORDER as TAYLOR_ORDER
from slave import SLAVE

FOLDER = Path(__file__).resolve().parent
INTERFACE = SLAVE.interface
MODEL_NAME = f"{INTERFACE.model_name}Native"
SOURCES = ("all.c",)  # which includes the other C files
SHELL = (
    "text.c",
    "text.h",
    "scaling.c",
    "scaling.h",
    "model.h",
    "methods.c",
    "methods.h",
    "simulation.c",
    "simulation.h",
    "fmi2.c",
)
MAX_INPUT_ORDER = 3  # of the derivatives of the input; with them every method has the order 4, or its own
MAX_OUTPUT_ORDER = 1  # of the derivatives that fmi2GetRealOutputDerivatives knows
FMI_HEADERS = Path(fmpy.__file__).parent / "c-code"
FLAGS = (
    "-std=c11",
    "-DFMI2_OVERRIDE_FUNCTION_PREFIX",  # the functions of a shared library have no prefix
    "-O3",
    "-ffp-contract=off",
    "-fno-builtin-sin",  # no sincos(): the same functions as Python's
    "-fno-builtin-cos",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-pedantic",
)


class CompilerError(Exception):
    """There is no C compiler."""


class ModelFileError(Exception):
    """There is not the one C file that knows the model."""


class CompilationError(Exception):
    """The C compiler refuses the sources, with what it says."""


class Target(NamedTuple):
    """A platform of FMI 2.0, the suffix of its libraries, and how the compiler names its processors."""

    platform: str
    suffix: str
    triples: tuple[str, ...]


TARGETS = (
    Target("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    Target("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",)),
    Target("win64", ".dll", ("x86_64-windows-gnu",)),
    Target("darwin64", ".dylib", ("x86_64-macos.11.0", "aarch64-macos.11.0")),
)


def model_file() -> str:
    """Return the name of the one C file that knows the model, see model.h.

    Raises
    ------
    ModelFileError : there is none, or more than one
    """
    names = sorted({path.name for path in FOLDER.glob("*.c")} - {*SOURCES, *SHELL})
    if len(names) == 1:
        return names[0]
    place = "/".join(FOLDER.parts[-2:])
    found = (
        f"several C files of models in {place}: {', '.join(names)}"
        if names
        else f"no C file of the model in {place}"
    )
    raise ModelFileError(f"{found} (needed: one, by the contract in model.h)")


def sources(guid: str) -> dict[str, bytes]:
    """Return the C files by name, the generated one included.

    Raises
    ------
    ModelFileError : there is not the one of the model
    """
    files = {name: (FOLDER / name).read_bytes() for name in (*SOURCES, *SHELL, model_file())}
    return files | {"interface.h": header(guid).encode()}


def header(guid: str) -> str:
    """Return interface.h: interface.h.in with the interface tables filled in."""
    marks = {
        "MODEL_FILE": model_file(),
        "MODEL_NAME": MODEL_NAME,
        "GUID": guid,
        "STATE_FORMAT": INTERFACE.state_format(MODEL_NAME),
        "REFERENCES": ", ".join(f"VR_{variable.name.replace('.', '_')}" for variable in INTERFACE.variables),
        "VARIABLES": "\n".join(map(_row, INTERFACE.variables)),
        "MODEL": _model(SLAVE.names),
        "METHODS": ", ".join(f"{method.name} = {method.value}" for method in SolverMethod),
        "METHOD_ROWS": "\n".join(map(_method_row, SolverMethod)),
        "MAX_EVALUATIONS": str(MAX_EVALUATIONS),
        "MAX_STAGES": str(max(len(method.tableau) for method in METHODS.values())),
        "TAYLOR_ORDER": str(TAYLOR_ORDER),
        "MAX_SUBSTEPS": str(MAX_SUBSTEPS),
        "MAX_INPUT_ORDER": str(MAX_INPUT_ORDER),
        "MAX_OUTPUT_ORDER": str(MAX_OUTPUT_ORDER),
    }
    text = (FOLDER / "interface.h.in").read_text("utf-8")
    for mark, content in marks.items():
        text = text.replace(f"@{mark}@", content)
    return text


def _row(variable: Variable) -> str:
    kind = "REAL" if INTERFACE.is_real(variable) else "INTEGER"
    allowed = variable.range or Range("", 0.0, 0.0)
    strings = ", ".join(f'"{text}"' for text in (variable.name, INTERFACE.unit_of(variable), allowed.text))
    numbers = ", ".join(map(_c_double, (variable.start or 0.0, allowed.lowest, allowed.highest)))
    return f"    {{{strings}, {kind}, {variable.causality.upper()}, {numbers}}},"


def _model(names: Names) -> str:
    variables = (names.x, names.v, names.a, f"{names.x}_start", f"{names.v}_start", names.input)
    references = ", ".join(f"VR_{name}" for name in variables)
    return f'{references}, "{names.system}", "{names.quantity}"'


def _method_row(method: SolverMethod) -> str:
    known = METHODS[method]
    rows = ", ".join(f"{{{', '.join(map(_c_double, row))}}}" for row in known.tableau or ((0.0,),))
    facts = f'"{method.name}", {known.order}, {_c_double(known.real_limit)}, {len(known.tableau)}'
    return f"    [{method.name}] = {{{facts}, {{{rows}}}}},"


def _c_double(value: float) -> str:
    return "INFINITY" if value == inf else repr(float(value))


def binaries(guid: str) -> dict[str, bytes]:
    """Return the shared libraries by their names in the FMU.

    Raises
    ------
    CompilerError : there is no C compiler
    CompilationError : the compiler refuses the sources
    """
    if find_spec("ziglang") is None:
        return host_binary(guid)
    zig = [sys.executable, "-m", "ziglang", "cc", "-target"]
    with zig_environment() as environment:
        return {
            _place(target.platform, target.suffix): joined(
                [library([*zig, triple], guid, target.suffix, environment) for triple in target.triples]
            )
            for target in TARGETS
        }


@contextmanager
def zig_environment() -> Iterator[dict[str, str]]:
    """Yield the environment of zig: with a cache that is thrown away where that of the user cannot be written."""
    if "ZIG_GLOBAL_CACHE_DIR" in os.environ or _can_be_written(_zig_cache()):
        yield dict(os.environ)
        return
    with tempfile.TemporaryDirectory() as folder:
        yield os.environ | {"ZIG_GLOBAL_CACHE_DIR": folder}


def _zig_cache() -> Path | None:
    """Return where zig keeps its cache, None where it knows no place."""
    places = (
        [("LOCALAPPDATA", "zig")] if os.name == "nt" else [("XDG_CACHE_HOME", "zig"), ("HOME", ".cache/zig")]
    )
    known = [Path(os.environ[name], below) for name, below in places if os.environ.get(name)]
    return known[0] if known else None


def _can_be_written(folder: Path | None) -> bool:
    if folder is None:
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def host_binary(guid: str) -> dict[str, bytes]:
    """Return the shared library that the C compiler of this machine makes for it, by its name in the FMU."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        raise CompilerError("no C compiler: install the package ziglang, or cc, gcc or clang")
    suffix: str = fmpy.sharedLibraryExtension
    return {_place(fmpy.platform, suffix): library([compiler], guid, suffix)}


def _place(platform: str, suffix: str) -> str:
    return f"binaries/{platform}/{MODEL_NAME}{suffix}"


def library(compiler: list[str], guid: str, suffix: str, environment: dict[str, str] | None = None) -> bytes:
    """Return the shared library that `compiler` makes, in `environment` if it is given."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in sources(guid).items():
            (folder / file).write_bytes(content)
        output = folder / f"{MODEL_NAME}{suffix}"
        hidden = [] if suffix == ".dll" else ["-fPIC", "-fvisibility=hidden"]
        options = [*FLAGS, *hidden, "-s", "-shared", f"-I{FMI_HEADERS}", "-o", output.name]
        command = [*compiler, *options, *SOURCES, "-lm"]
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            raise CompilationError(f"{' '.join(command)}:\n{done.stderr}")
        return output.read_bytes()


def joined(images: list[bytes]) -> bytes:
    """Return the image of one processor, or a universal Mach-O file of those of several."""
    if len(images) == 1:
        return images[0]
    align = 14  # as a power of 2: the pages of arm64
    at = 1 << align
    head, body = struct.pack(">II", 0xCAFEBABE, len(images)), b""
    for image in images:
        processor, variant = struct.unpack_from("<II", image, 4)
        body += b"\0" * (-len(body) % (1 << align))
        head += struct.pack(">IIIII", processor, variant, at + len(body), len(image), align)
        body += image
    return head.ljust(at, b"\0") + body
