"""The scripts of .ci find their Pythons and do not take a shim for one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
VERSION = f"{sys.version_info[0]}.{sys.version_info[1]}"
SCRIPTS = sorted((ROOT / ".ci").iterdir())


def imitation(path: Path, *lines: str) -> Path:
    """Write a program that takes the place of a Python."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(("#!/bin/sh", *lines, "")), "utf-8")
    path.chmod(0o755)
    return path


def pythons(folder: Path) -> tuple[list[str], str]:
    """Return what .ci/pythons finds where `folder` is all there is, and what it says."""
    done = subprocess.run(
        [ROOT / ".ci" / "pythons", sys.executable],
        env={"PATH": f"{folder}:/usr/bin:/bin", "PYENV_ROOT": str(folder / "pyenv"), "HOME": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    found = [line for line in done.stdout.splitlines() if line.startswith(str(folder))]
    return found, done.stderr


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_script_is_a_program_that_ends_at_its_first_error(script: Path) -> None:
    assert os.access(script, os.X_OK)
    assert "set -euo pipefail" in script.read_text("utf-8")
    subprocess.run(["bash", "-n", script], check=True)


@pytest.mark.parametrize(
    ("says", "reason"),
    [
        (['echo "pyenv: python3.14: command not found" >&2', "exit 127"], "does not start as Python 3"),
        (["echo pypy final 3.99"], "pypy, not CPython"),
        (["echo cpython alpha 3.99"], "3.99 is a prerelease (alpha)"),
        ([f"echo cpython final {VERSION}"], f"{VERSION} is there already"),
        (
            ['case "$2" in *ensurepip*) exit 1;; esac', "echo cpython final 3.99"],
            "has no module venv",
        ),
        (
            ['case "$2" in *exit*) exit 1;; esac', "echo cpython final 3.9"],
            "3.9 is older than 3.11",
        ),
    ],
)
def test_what_cannot_run_the_fmu_is_passed_over_and_the_reason_is_said(
    tmp_path: Path, says: list[str], reason: str
) -> None:
    shim = imitation(tmp_path / "python3.14", *says)
    found, said = pythons(tmp_path)
    assert found == []
    assert f"passed over: {shim} ({reason})" in said


def test_each_version_is_found_once_on_the_path_and_in_pyenv(tmp_path: Path) -> None:
    on_path = imitation(tmp_path / "python3.14", "echo cpython final 3.99")
    # The numbers are those of no real Python of the machine.
    again = imitation(
        tmp_path / "pyenv" / "versions" / "3.14.2" / "bin" / "python", "echo cpython final 3.99"
    )
    newer = imitation(
        tmp_path / "pyenv" / "versions" / "3.15.0" / "bin" / "python", "echo cpython final 3.98"
    )
    found, said = pythons(tmp_path)
    assert found == [str(on_path), str(newer)]
    assert f"passed over: {again} (3.99 is there already)" in said
