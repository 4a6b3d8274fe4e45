"""The C compiler of this machine, for what the native FMU is raced against."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

COMPILERS = ("cc", "gcc", "clang")
# Those of the native FMU that bear on the numbers and on the speed.
FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fno-builtin-sin", "-fno-builtin-cos")


class NoCompilerError(Exception):
    """There is no C compiler that makes the library, with the reason."""


def shared_library(source: Path, folder: Path, *flags: str) -> Path:
    """Compile `source` into a shared library in `folder` and return its path.

    Raises
    ------
    NoCompilerError : there is no C compiler, or it fails
    """
    library = folder / f"{source.stem}.so"
    command = [compiler(), *FLAGS, *flags, "-fPIC", "-shared", str(source), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NoCompilerError(f"{command[0]} cannot compile {source.name}: {done.stderr.strip()}")
    return library


def compiler() -> str:
    """Return the path of the C compiler.

    Raises
    ------
    NoCompilerError : there is none
    """
    found = next(filter(None, map(shutil.which, COMPILERS)), None)
    if found is None:
        raise NoCompilerError(f"no C compiler ({', '.join(COMPILERS)})")
    return found


def compiler_version() -> str:
    """Return what the compiler calls itself, or that there is none."""
    try:
        done = subprocess.run([compiler(), "--version"], capture_output=True, text=True, check=False)
    except NoCompilerError as error:
        return str(error)
    return done.stdout.partition("\n")[0]
