import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from validation.fmu import Fmu

ROOT = Path(__file__).resolve().parent.parent


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fmu", type=Path, help="validate this FMU instead of a fresh build")


@pytest.fixture(scope="session")
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fmu]:
    path = request.config.getoption("--fmu")
    if path is None:
        path = tmp_path_factory.mktemp("dist") / "DampedPendulum.fmu"
        subprocess.run([sys.executable, ROOT / "build_fmu.py", "--output", path], check=True)
    with Fmu(path) as fmu:
        yield fmu
