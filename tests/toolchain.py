"""The tools that the tests of the native FMU call: C compilers, binutils, build programs."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
COMPILERS = ("gcc", "clang")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler (cc, gcc, clang)")
on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux only")


def need(*tools: str, path: str | None = None) -> None:
    """Skip the test where a program is missing."""
    for tool in tools:
        if shutil.which(tool, path=path) is None:
            pytest.skip(f"{tool} is not installed")


def need_zig() -> None:
    if find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed")


def output_of(command: list[Any], **named: Any) -> str:
    """Return what a program prints, which must succeed."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, **named)
    assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def symbols(library: Path) -> tuple[set[str], set[str]]:
    """Return the names that a library defines, and those that it needs, with their versions."""
    names = [line.split()[-2:] for line in output_of(["nm", "-D", library]).splitlines()]
    return {name for kind, name in names if kind == "T"}, {name for kind, name in names if kind == "U"}
