"""A wrong kernel makes every study fail: what the studies assert is not true of any FMU."""

import shutil
from collections.abc import Iterator

import pytest

import build_fmu
from validation import studies
from validation.checks import Check
from validation.fmu import Fmu

pytestmark = pytest.mark.slow

# file, what is written there, what a mistaken author would write
MUTATIONS = {
    "wrong sign of damping": (
        "damped_pendulum/model.py",
        "return self.drive, -self.damping_rate, -self.w02",
        "return self.drive, self.damping_rate, -self.w02",
    ),
    "k for k^2": (
        "damped_pendulum/model.py",
        "return Motion(self.gamma / self.m,",
        "return Motion((self.gamma / self.m) ** 0.5,",
    ),
    "dropped torque": ("damped_pendulum/model.py", "drive = tau / J", "drive = 0.0 * tau"),
    "third-order weights": (
        "methods/explicit.py",
        "v += sixth * (a123 + a23 + a4)",
        "v += sixth * (a1 + 4 * a2 + a4)",
    ),
    "half a step": ("methods/integration.py", "h = duration / n", "h = 0.5 * duration / n"),
}
ON_MOTION = ("third-order weights", "half a step")
ON_DRAG = ("wrong sign of damping", "k for k^2", *ON_MOTION)
CAUGHT = {
    "elliptic_period": ON_MOTION,
    "impulse_response": tuple(MUTATIONS),
    "trajectory": ON_MOTION,
    "crawford": ON_MOTION,
    "grillo": tuple(MUTATIONS),
    "inputs": tuple(MUTATIONS),
    "errata": tuple(MUTATIONS),
    "work_precision": tuple(MUTATIONS),
    "methods": tuple(MUTATIONS),
    "atlas": ON_MOTION,
    "stability": ON_DRAG,
    "traps": ON_DRAG,
    "stiff_extreme": tuple(MUTATIONS),
}


@pytest.fixture(scope="module")
def mutants(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Fmu]]:
    folder = tmp_path_factory.mktemp("mutants")
    built = {}
    for i, (name, (file, right, wrong)) in enumerate(MUTATIONS.items()):
        sources = folder / f"sources{i}"
        shutil.copytree(build_fmu.SOURCES, sources, ignore=shutil.ignore_patterns("__pycache__"))
        text = (sources / file).read_text("utf-8")
        assert text.count(right) == 1, name
        (sources / file).write_text(text.replace(right, wrong), "utf-8")
        built[name] = Fmu(build_fmu.build(folder / f"mutant{i}.fmu", sources))
    yield built
    for fmu in built.values():
        fmu.close()


def rows(fmu: Fmu, study: str) -> Iterator[Check]:
    # The driven scenes show most mutations, so they come first.
    for scene in sorted(studies.load(study).scenes, key=lambda scene: "pulse" not in scene.name):
        yield from (r for r in scene.run(fmu) if isinstance(r, Check))


def test_every_study_is_put_to_the_test() -> None:
    assert set(CAUGHT) == set(studies.NAMES)


@pytest.mark.parametrize(("study", "mutation"), [(s, m) for s, ms in CAUGHT.items() for m in ms])
def test_a_study_fails_on_a_wrong_kernel(mutants: dict[str, Fmu], study: str, mutation: str) -> None:
    assert not all(row.holds for row in rows(mutants[mutation], study))
