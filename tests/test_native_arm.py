"""The native FMU on another processor: its runs, states and answers on 64-bit ARM are those on x86-64, bit for bit."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

import build_fmu
from native import build as native
from tests.driver import Fmu
from tests.toolchain import COMPILER, HERE, need_zig, needs_compiler, on_linux, output_of

EMULATOR = next(filter(None, map(shutil.which, ("qemu-aarch64-static", "qemu-aarch64"))), None)
# Of Debian's libc6-arm64-cross and its like elsewhere; QEMU takes another from its own variable.
SYSROOT = Path(os.environ.get("QEMU_LD_PREFIX", "/usr/aarch64-linux-gnu"))
OPTIONS = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]

pytestmark = [
    on_linux,
    needs_compiler,
    pytest.mark.slow,
    pytest.mark.skipif(
        EMULATOR is None, reason="qemu-aarch64 is not installed (on Debian: qemu-user-static)"
    ),
    pytest.mark.skipif(
        not (SYSROOT / "lib" / "ld-linux-aarch64.so.1").exists(),
        reason=f"no C library for ARM in {SYSROOT} (on Debian: libc6-arm64-cross)",
    ),
]


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    need_zig()
    folder = tmp_path_factory.mktemp("arm")
    return Fmu(build_fmu.build_native(folder / "all.fmu"), folder / "extracted")


def on_this_machine(fmu: Fmu, source: str, folder: Path, *arguments: Path) -> str:
    program = folder / "host"
    output_of([COMPILER, *OPTIONS, HERE / source, "-o", program, "-ldl"])
    return output_of([program, library(fmu, "linux64"), fmu.description.guid, *arguments])


def on_arm(fmu: Fmu, source: str, folder: Path, *arguments: Path) -> str:
    program = folder / "host_on_arm"
    zig: list[Any] = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux-gnu.2.34"]
    with native.zig_environment() as environment:
        output_of([*zig, *OPTIONS, HERE / source, "-o", program, "-ldl"], env=environment)
    emulator = [EMULATOR, "-L", SYSROOT]
    return output_of([*emulator, program, library(fmu, "aarch64-linux"), fmu.description.guid, *arguments])


def library(fmu: Fmu, platform: str) -> Path:
    return fmu.folder / "binaries" / platform / f"{native.MODEL_NAME}.so"


def test_runs_and_states_are_the_same_bits(arm: Fmu, tmp_path: Path) -> None:
    runs = on_arm(arm, "native_trajectories.c", tmp_path)
    assert len(runs.splitlines()) == 8 * 2 * 200  # methods, free and driven, steps
    assert runs == on_this_machine(arm, "native_trajectories.c", tmp_path)


def test_answers_are_those_of_the_table(arm: Fmu, tmp_path: Path) -> None:
    table = HERE / "conduct.json"
    calls = sum(len(case["calls"]) for case in json.loads(table.read_text("utf-8"))["cases"])
    assert on_arm(arm, "native_conduct.c", tmp_path, table) == f"calls {calls}, wrong 0\n"
