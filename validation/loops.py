"""RK4 for one pendulum alone, written by hand: the shortest loops that give the numbers of the FMU, to race it against.

A loop advances the angle `phi` [rad] and its rate `w` [rad/s] under a held drive [1/s2] by `n` substeps of `h` [s] and
returns the angle.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from math import sin
from pathlib import Path

Loop = Callable[[float, float, float, float, float, float, int], float]

SOURCE = Path(__file__).resolve().parent / "loop.c"
COMPILERS = ("cc", "gcc", "clang")
# Those of the native FMU that bear on the numbers and on the speed.
FLAGS = ("-std=c11", "-O3", "-ffp-contract=off", "-fno-builtin-sin", "-fno-builtin-cos")


def python_loop(
    drive: float, damping_rate: float, w02: float, phi: float, w: float, h: float, n: int
) -> float:
    """Run the loop in Python, without a call in it but the sine."""
    drag, gravity = -damping_rate, -w02
    half, sixth = h / 2, h / 6
    half_half, half_h, sixth_h = half * half, half * h, sixth * h
    for _ in range(n):
        middle = phi + half * w
        end = phi + h * w
        a1 = drive + drag * w + gravity * sin(phi)
        a2 = drive + drag * (w + half * a1) + gravity * sin(middle)
        a3 = drive + drag * (w + half * a2) + gravity * sin(middle + half_half * a1)
        a4 = drive + drag * (w + h * a3) + gravity * sin(end + half_h * a2)
        a23 = a2 + a3
        a123 = a1 + a23
        phi = end + sixth_h * a123
        w += sixth * (a123 + a23 + a4)
    return phi


class NoCompilerError(Exception):
    """There is no C compiler that makes a library of the loop, with the reason."""


def c_loop(folder: Path) -> Loop:
    """Compile the loop in C into `folder` and return it.

    Raises
    ------
    NoCompilerError : there is no C compiler, or it fails
    """
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise NoCompilerError(f"no C compiler ({', '.join(COMPILERS)})")
    library = folder / "loop.so"
    command = [compiler, *FLAGS, "-fPIC", "-shared", str(SOURCE), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NoCompilerError(f"{compiler} cannot compile {SOURCE.name}: {done.stderr.strip()}")
    function = ctypes.CDLL(str(library)).loop
    function.argtypes, function.restype = [ctypes.c_double] * 6 + [ctypes.c_int], ctypes.c_double
    loop: Loop = function
    return loop
