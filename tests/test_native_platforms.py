"""The native FMU on other platforms: its runs, states and answers under emulators, where these are installed."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import build_fmu
from native import build as native
from tests.driver import Fmu
from tests.toolchain import COMPILER, HERE, need_zig, needs_compiler, on_linux, output_of

OPTIONS = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", f"-I{native.FMI_HEADERS}"]
SHAPE = (8 * 2 * 200, 8)  # of the output of native_trajectories.c: methods, free and driven, steps; columns
# Of Debian's libc6-arm64-cross and its like elsewhere; QEMU takes another from its own variable.
ARM_LIBRARIES = Path(os.environ.get("QEMU_LD_PREFIX", "/usr/aarch64-linux-gnu"))
QEMU = next(filter(None, map(shutil.which, ("qemu-aarch64-static", "qemu-aarch64"))), None)
WINE = next(filter(None, map(shutil.which, ("wine64", "wine", "/usr/lib/wine/wine64"))), None)

pytestmark = [on_linux, needs_compiler, pytest.mark.slow]


class Machine(NamedTuple):
    """What runs the programs of another platform: the target of the compiler, and the command before a program."""

    platform: str
    triple: str
    emulator: list[str]
    environment: dict[str, str]
    root: str = ""  # before paths

    def output(self, fmu: Fmu, source: str, folder: Path, *arguments: Path) -> str:
        """Compile a host, which takes a library, a GUID and the arguments; return what it prints."""
        program = folder / f"host_on_{self.platform}.exe"
        zig = [sys.executable, "-m", "ziglang", "cc", "-target", self.triple]
        with native.zig_environment() as environment:
            output_of([*zig, *OPTIONS, HERE / source, "-o", program], env=environment)
        suffix = next(target.suffix for target in native.TARGETS if target.platform == self.platform)
        library = fmu.folder / "binaries" / self.platform / f"{native.MODEL_NAME}{suffix}"
        paths = [f"{self.root}{path}" for path in (library, *arguments)]
        command = [*self.emulator, program, paths[0], fmu.description.guid, *paths[1:]]
        return output_of(command, env=os.environ | self.environment)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    need_zig()
    folder = tmp_path_factory.mktemp("platforms")
    return Fmu(build_fmu.build_native(folder / "all.fmu"), folder / "extracted")


@pytest.fixture(scope="module")
def arm() -> Machine:
    if QEMU is None:
        pytest.skip("qemu-aarch64 is not installed (on Debian: qemu-user-static)")
    if not (ARM_LIBRARIES / "lib" / "ld-linux-aarch64.so.1").exists():
        pytest.skip(f"no C library for ARM in {ARM_LIBRARIES} (on Debian: libc6-arm64-cross)")
    return Machine("aarch64-linux", "aarch64-linux-gnu.2.34", [QEMU, "-L", str(ARM_LIBRARIES)], {})


@pytest.fixture(scope="module")
def windows(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    if WINE is None:
        pytest.skip("wine is not installed (on Debian: wine64)")
    environment = {
        "WINEPREFIX": str(tmp_path_factory.mktemp("wine")),
        "WINEARCH": "win64",
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree,mshtml=",  # no offer to install them
    }
    # Drive Z: is the root of this machine.
    return Machine("win64", "x86_64-windows-gnu", [WINE], environment, root="Z:")


@pytest.fixture(scope="module")
def here(fmu: Fmu, tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the runs on this machine."""
    program = tmp_path_factory.mktemp("here") / "host"
    output_of([COMPILER, *OPTIONS, HERE / "native_trajectories.c", "-o", program, "-ldl"])
    library = fmu.folder / "binaries" / "linux64" / f"{native.MODEL_NAME}.so"
    return output_of([program, library, fmu.description.guid])


def test_runs_and_states_on_arm_are_the_same_bits(arm: Machine, fmu: Fmu, tmp_path: Path, here: str) -> None:
    assert np.loadtxt(here.splitlines()).shape == SHAPE
    assert arm.output(fmu, "native_trajectories.c", tmp_path) == here


def test_runs_and_states_on_windows_differ_by_the_last_digit_of_a_sine(
    windows: Machine, fmu: Fmu, tmp_path: Path, here: str
) -> None:
    found, expected = (
        np.loadtxt(text.splitlines())
        for text in (windows.output(fmu, "native_trajectories.c", tmp_path), here)
    )
    assert found.shape == SHAPE
    np.testing.assert_array_equal(found[:, :3], expected[:, :3])
    # w02*sin(phi) off by an ulp of 9.8 in the same direction for 10 s changes w by 2e-14 rad/s and phi by 1e-13 rad,
    # which such a motion stretches less than ten times. a and E change up to w02 times as much.
    np.testing.assert_allclose(found[:, 3:5], expected[:, 3:5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 5:7], expected[:, 5:7], rtol=0, atol=1e-11)


@pytest.mark.parametrize("machine", ["arm", "windows"])
def test_answers_are_those_of_the_table(
    machine: str, fmu: Fmu, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    table = HERE / "conduct.json"
    calls = sum(len(case["calls"]) for case in json.loads(table.read_text("utf-8"))["cases"])
    printed = request.getfixturevalue(machine).output(fmu, "native_conduct.c", tmp_path, table)
    assert printed == f"calls {calls}, wrong 0\n"
