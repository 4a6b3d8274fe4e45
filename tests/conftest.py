from pathlib import Path

import pytest

import build_fmu
from tests.driver import Fmu


@pytest.fixture(scope="session")
def fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_fmu.build(tmp_path_factory.mktemp("dist") / "DampedPendulum.fmu")


@pytest.fixture(scope="session")
def fmu(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(fmu_path, tmp_path_factory.mktemp("extracted"))
