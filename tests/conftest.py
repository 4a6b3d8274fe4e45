from pathlib import Path

import pytest

import build_fmu


@pytest.fixture(scope="session")
def fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_fmu.build(tmp_path_factory.mktemp("dist") / "DampedPendulum.fmu")
