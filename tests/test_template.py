"""README's recipe for a model of one's own: a copy of the template that lacks what only the pendulum's project has."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import copy_of_the_template
from tests.plants import SPRING
from tests.toolchain import need_zig


@pytest.fixture
def project(tmp_path: Path) -> Path:
    copy_of_the_template(tmp_path / "project", SPRING)
    return tmp_path / "project"


def build(project: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "build_fmu.py", *options]
    return subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)


def test_without_a_c_file_there_is_the_fmu_with_python_alone(project: Path) -> None:
    (project / "fmu_src" / "native" / "spring.c").unlink()
    done = build(project)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in (project / "dist").iterdir()] == ["HardeningSpring.fmu"]
    done = build(project, "--native")
    assert done.returncode == 2
    assert done.stderr == (
        "build_fmu.py: --native: no C file of the model in fmu_src/native (needed: one, by the contract in model.h)\n"
    )


def test_the_c_files_of_several_models_are_one_line_and_status_2(project: Path) -> None:
    native = project / "fmu_src" / "native"
    shutil.copy(native / "spring.c", native / "other.c")
    done = build(project, "--native")
    assert done.returncode == 2
    assert done.stderr == (
        "build_fmu.py: --native: several C files of models in fmu_src/native: other.c, spring.c "
        "(needed: one, by the contract in model.h)\n"
    )
    assert build(project).returncode == 0


@pytest.mark.slow
def test_a_release_leaves_out_what_the_project_has_not(project: Path) -> None:
    need_zig()
    done = build(project, "--release", "release")
    assert done.returncode == 0, done.stderr
    found = {path.relative_to(project / "release").as_posix() for path in (project / "release").rglob("*")}
    assert found == {"HardeningSpring.fmu", "HardeningSpringNative.fmu", "LICENSE", "SHA256SUMS"}


def test_without_a_readme_there_are_no_tables_to_write(project: Path) -> None:
    done = build(project, "--readme")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line == f"build_fmu.py: --readme {project / 'README.md'}: No such file or directory"
