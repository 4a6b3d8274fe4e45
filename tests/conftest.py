from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import build_fmu
from native.build import CompilerError, host_binary
from tests.driver import Fmu, Instance

# Both are clocks: how long an example takes says how busy the machine is.
settings.register_profile("no clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no clock")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run the tests of conduct on both carriers of the model."""
    if "carrier" in metafunc.fixturenames and metafunc.module.__name__.rpartition(".")[2].startswith(
        "test_conduct"
    ):
        both = metafunc.definition.get_closest_marker("pythonfmu_only") is None
        metafunc.parametrize("carrier", ["pythonfmu", "native"][: 1 + both], indirect=True, scope="session")


@pytest.fixture(scope="session")
def carrier(request: pytest.FixtureRequest) -> str:
    return getattr(request, "param", "pythonfmu")


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {"pythonfmu": build_fmu.build(tmp_path_factory.mktemp("dist") / "DampedPendulum.fmu")}


@pytest.fixture(scope="session")
def fmu_path(carrier: str, built: dict[str, Path]) -> Path:
    if carrier not in built:
        try:
            built[carrier] = build_fmu.build_native(built["pythonfmu"].with_name("DampedPendulumNative.fmu"))
        except CompilerError as error:
            pytest.skip(str(error))
    return built[carrier]


@pytest.fixture(scope="session")
def fmu(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(fmu_path, tmp_path_factory.mktemp("extracted"))


@pytest.fixture(scope="session")
def native_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the native FMU for this machine alone."""
    try:
        return build_fmu.build_native(tmp_path_factory.mktemp("dist") / "native.fmu", host_binary)
    except CompilerError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def native_fmu(native_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(native_path, tmp_path_factory.mktemp("extracted"))


@pytest.fixture(scope="session")
def folder(native_fmu: Fmu) -> Path:
    """Return the folder of the extracted native FMU."""
    return native_fmu.folder


@pytest.fixture
def instance(native_fmu: Fmu) -> Iterator[Instance]:
    """Yield a new instance of the native FMU."""
    with native_fmu.instance() as instance:
        yield instance


@pytest.fixture(scope="module")
def shared(native_fmu: Fmu) -> Iterator[Instance]:
    """Yield an instance of the native FMU for the examples of Hypothesis, which reset it."""
    with native_fmu.instance() as instance:
        yield instance
