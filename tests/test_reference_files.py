"""The reference results in both FMUs, by the rules of the layered standard fmi-ls-ref."""

from __future__ import annotations

import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import fmpy
import numpy as np
import pytest
from fmpy.util import read_csv

import build_fmu
from methods.solvers import SolverMethod
from tests.driver import Fmu
from tests.toolchain import output_of

pytestmark = pytest.mark.parametrize("carrier", ["pythonfmu", "native"], indirect=True, scope="session")

SPACE = "{http://fmi-standard.org/fmi-ls-manifest}"
ROLES = (
    "(document|requirement|specification|model|parameter|system|testcase"
    "|experiment(/(smoke-test|validation|uncertainty-analysis))?"
    "|result|method|rationale|report|request|delivery|configuration|signature|serialized-state(/.*)?|meta-data|other)"
)
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"


@pytest.fixture(scope="session")
def references(fmu: Fmu) -> Path:
    return fmu.folder / "extra" / "org.fmi-standard.fmi-ls-ref"


@pytest.fixture(scope="session")
def manifest(references: Path) -> Element:
    return ElementTree.parse(references / "fmi-ls-manifest.xml").getroot()


@pytest.fixture(scope="session")
def experiments(references: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((references / "experiments.json").read_text("utf-8"))[
        "experiments"
    ]
    return found


def test_the_manifest_follows_the_layered_standard(manifest: Element) -> None:
    assert manifest.tag == "fmiReferences"
    about = "Layered Standard providing information on related files included in an FMU."
    assert manifest.attrib == {
        f"{SPACE}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
        f"{SPACE}fmi-ls-version": "1.0.0-beta.1",
        f"{SPACE}fmi-ls-description": about,
    }
    for related in manifest:
        assert related.tag == "Related"
        assert set(related.attrib) == {"type", "source", "role", "description"}
        assert re.fullmatch(ROLES, related.attrib["role"])
        assert len(related) == 0


def test_every_file_is_described_and_every_described_file_is_there(
    manifest: Element, references: Path
) -> None:
    described = [related.attrib["source"] for related in manifest]
    assert sorted([*described, "fmi-ls-manifest.xml"]) == sorted(path.name for path in references.iterdir())
    assert (references.parents[1] / "documentation" / "fmi-ls-ref.txt").is_file()


def test_the_results_in_the_manifest_are_those_of_the_experiments(
    manifest: Element, experiments: list[dict[str, Any]]
) -> None:
    results = [related.attrib["source"] for related in manifest if related.attrib["role"] == "result"]
    assert results == [experiment["result"] for experiment in experiments]


def test_parameter_sets_have_the_start_values(references: Path, experiments: list[dict[str, Any]]) -> None:
    for experiment in experiments:
        path = references / f"{experiment['name']}.ssv"
        assert path.is_file() == bool(experiment["start_values"])
        if path.is_file():
            found: dict[str, float] = {}
            for parameter in ElementTree.parse(path).getroot().iter(f"{SSV}Parameter"):
                (value,) = parameter
                text = value.attrib["value"]
                found[parameter.attrib["name"]] = (
                    SolverMethod[text] if value.tag == f"{SSV}Enumeration" else float(text)
                )
            assert found == experiment["start_values"]


def test_fmpy_meets_the_bounds_with_what_is_in_the_fmu(
    fmu: Fmu, references: Path, experiments: list[dict[str, Any]]
) -> None:
    for experiment in experiments:
        exact = read_csv(references / experiment["result"])
        torque = experiment["input"]
        found = fmpy.simulate_fmu(
            str(fmu.path),
            start_values=experiment["start_values"],
            stop_time=experiment["stop_time"],
            output_interval=experiment["communication_step"],
            input=None if torque is None else read_csv(references / torque),
            output=["phi", "w"],
        )
        assert len(found) == len(exact)
        np.testing.assert_allclose(found["time"], exact["time"], rtol=1e-15)
        for name, bound in experiment["bounds"].items():
            np.testing.assert_allclose(
                found[name], exact[name], rtol=0, atol=bound, err_msg=experiment["name"]
            )


def test_the_example_of_readme_holds(fmu: Fmu, tmp_path: Path) -> None:
    text = (build_fmu.ROOT / "README.md").read_text("utf-8").partition("## Expected numbers")[2]
    program = text.partition("```python\n")[2].partition("```")[0]
    (tmp_path / "dist").mkdir()
    shutil.copy(fmu.path, tmp_path / "dist" / "DampedPendulum.fmu")
    output_of([sys.executable, "-c", program], cwd=tmp_path)
