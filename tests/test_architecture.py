"""What knows FMI knows no pendulum, and the other way round; imports run one way; the validation imports no sources."""

import ast
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ROOT / "fmu_src"
TESTS = ROOT / "tests"
# Module -> what it may import: modules of its package, other packages.
ALLOWED = {
    "damped_pendulum.model": {"methods.motion"},
    "damped_pendulum.interface": {"fmi.rows", "fmi.tables"},
    "methods.motion": set(),
    "methods.explicit": {".motion"},
    "methods.implicit": {".motion"},
    "methods.taylor": {".motion"},
    "methods.solvers": {".explicit", ".implicit", ".motion", ".taylor"},
    "methods.inline": {".explicit", ".motion"},
    "methods.integration": {".inline", ".motion", ".solvers"},
    "fmi.tables": set(),
    "fmi.rows": {".tables", "methods.solvers"},
    "fmi.wrapper": set(),
    "fmi.description": {".tables", "pythonfmu"},
    "fmi.shell": {".description", ".tables", ".wrapper", "pythonfmu", "pythonfmu.enums"},
    "fmi.second_order": {".shell", "methods.integration", "methods.motion", "methods.solvers"},
    "slave": {"damped_pendulum.interface", "damped_pendulum.model", "fmi.second_order"},
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


def foreign(path: Path) -> set[str]:
    """Return the modules that `path` imports, but for those of the standard library; a dot is its own package."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add("." * node.level + (node.module or ""))
    return {name for name in found if name.partition(".")[0] not in sys.stdlib_module_names}


def test_the_table_covers_the_sources() -> None:
    packages = (path for path in SOURCES.glob("*/*.py") if path.parent.name != "native")
    modules = {f"{path.parent.name}.{path.stem}" for path in packages if path.stem != "__init__"}
    assert modules | {"slave"} == set(ALLOWED)


@pytest.mark.parametrize("module", ALLOWED)
def test_a_module_imports_only_those_below_it(module: str) -> None:
    assert foreign((SOURCES / module.replace(".", "/")).with_suffix(".py")) == ALLOWED[module]


NATIVE = SOURCES / "native"
KNOWS_THE_MODEL = NATIVE / "pendulum.c"
OF_ANY_MODEL = sorted(
    path
    for folder in ("fmi", "methods", "native")
    for path in (SOURCES / folder).glob("*.*")
    if path != KNOWS_THE_MODEL
)


@pytest.mark.parametrize("path", OF_ANY_MODEL, ids=lambda path: path.relative_to(SOURCES).as_posix())
def test_what_serves_any_model_knows_no_pendulum(path: Path) -> None:
    assert not re.findall(r"(?i)pendulum|phi|\btau\b", path.read_text("utf-8"))


@pytest.mark.parametrize("path", sorted(TESTS.glob("test_conduct_*.py")), ids=lambda path: path.name)
def test_what_conduct_must_know_of_a_model_stands_in_the_table_of_plants(path: Path) -> None:
    assert not re.findall(r"SPRING|PENDULUM\.name", path.read_text("utf-8"))


# C file and its header -> what they may include of ours.
INCLUDES = {
    "text": set(),
    "scaling": set(),
    "model": {"interface.h", "text.h"},
    "pendulum": {"model.h", "scaling.h"},
    "methods": {"model.h", "text.h"},
    "simulation": {"interface.h", "methods.h", "model.h", "text.h"},
    "fmi2": {"simulation.h", "text.h"},
}


@pytest.mark.parametrize("name", INCLUDES)
def test_a_c_file_includes_only_what_is_below_it(name: str) -> None:
    texts = [path.read_text("utf-8") for path in NATIVE.glob(f"{name}.[ch]")]
    found = {header for text in texts for header in re.findall(r'#include "(.+)"', text)}
    assert found - {f"{name}.h", "fmi2Functions.h"} == INCLUDES[name]


def test_the_one_compiled_c_file_includes_the_others_from_below() -> None:
    text = (NATIVE / "all.c").read_text("utf-8")
    text = text.replace("MODEL_FILE\n", f'"{KNOWS_THE_MODEL.name}"\n')
    order = re.findall(r'#include "(.+)\.c"', text)
    assert order == [name for name in INCLUDES if name != "model"]
    assert {f"{name}.c" for name in order} | {"all.c"} == {path.name for path in NATIVE.glob("*.c")}


VALIDATION = ROOT / "validation"
MODULES = sorted(VALIDATION.rglob("*.py"))


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(VALIDATION).with_suffix("").parts)


@pytest.mark.parametrize("path", MODULES, ids=module_name)
def test_the_validation_shares_no_code_with_the_fmu(path: Path) -> None:
    names = {name for level, name in imports(path) if level == 0}
    assert not names & {*(source.stem for source in SOURCES.iterdir()), "pythonfmu", "fmu_src", "build_fmu"}


def test_only_the_driver_knows_fmpy_and_only_the_report_matplotlib() -> None:
    users = {
        name: {module_name(path) for path in MODULES if (0, name) in imports(path)}
        for name in ("fmpy", "matplotlib", "jinja2", "rich")
    }
    assert users == {
        "fmpy": {"fmu", "quickstart"},
        "matplotlib": {"report.figures"},
        "jinja2": {"report.page"},
        "rich": {"report.screen"},
    }


@pytest.mark.parametrize("path", sorted((VALIDATION / "references").glob("*.py")), ids=module_name)
def test_the_references_know_nothing_of_the_rest(path: Path) -> None:
    own = {other.stem for other in (VALIDATION / "references").glob("*.py")} | {""}
    assert {(level, name) for level, name in imports(path) if level} <= {(1, name) for name in own}
