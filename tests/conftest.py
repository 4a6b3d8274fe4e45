import shutil
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import build_fmu
from native.build import CompilerError, host_binary
from tests.driver import Fmu, Instance
from tests.plants import PENDULUM, PLANTS, SPRING, Plant

# Both are clocks: how long an example takes says how busy the machine is.
settings.register_profile("no clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no clock")

CARRIERS = ("pythonfmu", "native")
# Module -> the models on whose carriers its tests run.
MODELS = {
    "test_conduct": tuple(PLANTS),
    "test_pendulum": (PENDULUM.name,),
    "test_second_model": (SPRING.name,),
}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run the tests of conduct on both carriers of all models, and those of one model on both of its carriers."""
    module = metafunc.module.__name__.rpartition(".")[2]
    models = next((models for prefix, models in MODELS.items() if module.startswith(prefix)), ())
    choices = {"model": models, "carrier": CARRIERS}
    if metafunc.definition.get_closest_marker("one_model") is not None:
        choices["model"] = models[:1]
    if metafunc.definition.get_closest_marker("pythonfmu_only") is not None:
        choices["carrier"] = CARRIERS[:1]
    if metafunc.definition.get_closest_marker("native_only") is not None:
        choices["carrier"] = CARRIERS[1:]
    names = [name for name in choices if name in metafunc.fixturenames]
    if models and names:
        metafunc.parametrize(
            names, list(product(*(choices[name] for name in names))), indirect=True, scope="session"
        )


@pytest.fixture(scope="session")
def model(request: pytest.FixtureRequest) -> str:
    return getattr(request, "param", PENDULUM.name)


@pytest.fixture(scope="session")
def plant(model: str) -> Plant:
    return PLANTS[model]


@pytest.fixture(scope="session")
def carrier(request: pytest.FixtureRequest) -> str:
    return getattr(request, "param", "pythonfmu")


class Builds:
    """The FMUs of the tests, each built when it is first asked for; both carriers of a model lie in one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.paths: dict[tuple[str, str], Path] = {}

    def path(self, model: str, carrier: str) -> Path:
        key = (model, carrier)
        if key not in self.paths:
            build = self.pendulum if model == PENDULUM.name else self.copy
            self.paths[key] = build(PLANTS[model], f"{model}{'Native' * (carrier == 'native')}.fmu", carrier)
        return self.paths[key]

    def pendulum(self, _: Plant, name: str, carrier: str) -> Path:
        path = self.folder / "dist" / name
        if carrier == "pythonfmu":
            return build_fmu.build(path)
        try:
            return build_fmu.build_native(path)
        except CompilerError as error:
            pytest.skip(str(error))

    def copy(self, plant: Plant, name: str, carrier: str) -> Path:
        """Build as README tells to make a FMU of one's own."""
        project = self.folder / plant.name
        if not project.exists():
            copy_of_the_template(project, plant)
        options = ["--native"] * (carrier == "native")
        done = subprocess.run(
            [sys.executable, "build_fmu.py", *options],
            cwd=project,
            capture_output=True,
            text=True,
            check=False,
        )
        if "no C compiler" in done.stderr:
            pytest.skip(done.stderr.strip())
        assert done.returncode == 0, done.stderr
        return project / "dist" / name


def copy_of_the_template(project: Path, plant: Plant) -> None:
    """Copy what README's recipe copies, and put `plant` in the place of the pendulum."""
    project.mkdir()
    for name in ("build_fmu.py", "LICENSE"):
        shutil.copy(build_fmu.ROOT / name, project)
    ignored = shutil.ignore_patterns("__pycache__", "damped_pendulum", "pendulum.c", "reference_results")
    shutil.copytree(build_fmu.SOURCES, project / "fmu_src", ignore=ignored)
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(plant.folder, project / "fmu_src", ignore=ignored, dirs_exist_ok=True)


@pytest.fixture(scope="session")
def builds(tmp_path_factory: pytest.TempPathFactory) -> Builds:
    return Builds(tmp_path_factory.mktemp("builds"))


@pytest.fixture(scope="session")
def fmu_path(model: str, carrier: str, builds: Builds) -> Path:
    return builds.path(model, carrier)


@pytest.fixture(scope="session")
def fmu(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(fmu_path, tmp_path_factory.mktemp("extracted"))


@pytest.fixture(scope="session")
def carriers(model: str, builds: Builds, tmp_path_factory: pytest.TempPathFactory) -> list[Fmu]:
    """Return both FMUs of the model."""
    return [Fmu(builds.path(model, carrier), tmp_path_factory.mktemp("extracted")) for carrier in CARRIERS]


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
