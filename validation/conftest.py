import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from validation.fmu import DEFAULT_PATH, NATIVE_NAME, Fmu

ROOT = Path(__file__).resolve().parent.parent


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fmu", type=Path, help="validate this FMU instead of a fresh build")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "fmu" in metafunc.fixturenames:
        given = metafunc.config.getoption("--fmu")
        metafunc.parametrize(
            "fmu", ["pythonfmu", "native"] if given is None else [given], indirect=True, scope="session"
        )


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dist")


@pytest.fixture(scope="session")
def fmu(request: pytest.FixtureRequest, folder: Path) -> Iterator[Fmu]:
    path = request.param
    if not isinstance(path, Path):
        native = request.param == "native"
        path = folder / (NATIVE_NAME if native else DEFAULT_PATH.name)
        command = [sys.executable, str(ROOT / "build_fmu.py"), "--output", str(path), *["--native"] * native]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if "no C compiler" in done.stderr:
            pytest.skip(done.stderr.strip())
        assert done.returncode == 0, done.stderr
    with Fmu(path) as fmu:
        yield fmu
