"""Every row of every study that is not about run times as a test: what the report says is what is asserted here."""

import pytest

from validation import studies
from validation.checks import Check
from validation.fmu import Fmu

STUDIES = [studies.load(name) for name in studies.NAMES]
CASES = [
    pytest.param(scene, id=f"{study.name}-{scene.name}", marks=[pytest.mark.slow] if scene.slow else [])
    for study in STUDIES
    for scene in study.scenes
]
RACES = [
    pytest.param(
        scene,
        id=f"{study.name}-{scene.name}",
        marks=pytest.mark.skip(
            reason=f"run times: python -m validation {study.name} measures and judges them"
        ),
    )
    for study in STUDIES
    for scene in study.races
]


@pytest.mark.parametrize("scene", [*CASES, *RACES])
def test_study(fmu: Fmu, scene: studies.Scene, subtests: pytest.Subtests) -> None:
    rows = [result for result in scene.run(fmu) if isinstance(result, Check)]
    for row in rows:
        with subtests.test(row.name):
            assert row.holds, str(row)
