"""Every row of every study that is not about run times as a test: what the report says is what is asserted here."""

import pytest

from validation import studies
from validation.fmu import Fmu
from validation.results import Check

CASES = [
    pytest.param(name, scene, id=f"{name}-{scene.name}", marks=[pytest.mark.slow] if scene.slow else [])
    for name in studies.NAMES
    for scene in studies.load(name).SCENES
]
RACES = [
    pytest.param(
        name,
        scene,
        id=f"{name}-{scene.name}",
        marks=pytest.mark.skip(reason=f"run times: python -m validation {name} measures and judges them"),
    )
    for name in studies.NAMES
    for scene in studies.races(studies.load(name))
]


@pytest.mark.parametrize(("study", "scene"), [*CASES, *RACES])
def test_study(fmu: Fmu, study: str, scene: studies.Scene, subtests: pytest.Subtests) -> None:
    rows = [result for result in studies.load(study).run(fmu, scene) if isinstance(result, Check)]
    for row in rows:
        with subtests.test(row.name):
            assert row.holds, str(row)
