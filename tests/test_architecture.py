"""Imports run one way: model <- solvers <- inline, interface <- fmi2 <- slave; the validation imports no sources."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "fmu_src" / "damped_pendulum"
ALLOWED = {
    "model": set(),
    "solvers": {"model"},
    "inline": {"model", "solvers"},
    "interface": {"solvers"},
    "fmi2": {"interface", "pythonfmu"},
}


def imports(path: Path) -> set[tuple[int, str]]:
    """Return (level, top-level module) of every import, wherever it stands."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {(0, alias.name.partition(".")[0]) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add((node.level, (node.module or "").partition(".")[0]))
    return found


def foreign(path: Path) -> set[tuple[int, str]]:
    return {(level, name) for level, name in imports(path) if level or name not in sys.stdlib_module_names}


def test_the_tables_cover_the_package() -> None:
    assert {path.stem for path in PACKAGE.glob("*.py")} == {"__init__", *ALLOWED}


@pytest.mark.parametrize("module", ALLOWED)
def test_a_module_imports_only_those_below_it(module: str) -> None:
    allowed = {(0 if name == "pythonfmu" else 1, name) for name in ALLOWED[module]}
    assert foreign(PACKAGE / f"{module}.py") <= allowed


def test_the_slave_imports_the_package_and_pythonfmu() -> None:
    assert foreign(ROOT / "fmu_src" / "slave.py") == {(0, "damped_pendulum"), (0, "pythonfmu")}


@pytest.mark.parametrize("path", sorted((ROOT / "validation").glob("*.py")), ids=lambda path: path.stem)
def test_the_validation_shares_no_code_with_the_fmu(path: Path) -> None:
    names = {name for _, name in imports(path)}
    assert not names & {"damped_pendulum", "slave", "pythonfmu", "fmu_src", "build_fmu"}


def test_only_the_driver_knows_fmpy_and_only_the_report_matplotlib() -> None:
    users = {
        name: {path.stem for path in (ROOT / "validation").glob("*.py") if (0, name) in imports(path)}
        for name in ("fmpy", "matplotlib")
    }
    assert users == {"fmpy": {"fmu", "quickstart"}, "matplotlib": {"report"}}
