"""Both FMUs answer the call sequences of conduct.json as it says, which other programs can read, too."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.driver import Fmu, Instance, plant_of

TABLE = json.loads(Path(__file__).with_name("conduct.json").read_text("utf-8"))
STATUSES = ("OK", "Warning", "Discard", "Error", "Fatal")


def answer(instance: Instance, call: dict[str, Any]) -> tuple[int, dict[str, float]]:
    """Make a call of the table; return its status and, under "value", what it got."""
    function = call["call"]
    number = {name: float(call[name]) for name in ("value", "start", "stop", "time", "step") if name in call}
    if function in ("fmi2GetReal", "fmi2GetInteger"):
        status, values = instance.get_references(function.removeprefix("fmi2Get"), [call["reference"]])
        return status, {"value": values[0]} if status == 0 else {}
    if function == "fmi2SetReal":
        return instance.set_references("Real", [call["reference"]], [number["value"]]), {}
    if function == "fmi2SetInteger":
        return instance.set_references("Integer", [call["reference"]], [call["value"]]), {}
    if function == "fmi2SetupExperiment":
        return instance.set_up(number["start"], number.get("stop")), {}
    if function == "fmi2DoStep":
        return instance.step(number["time"], number["step"]), {}
    return instance.call(function), {}


@pytest.mark.parametrize("case", TABLE["cases"], ids=lambda case: case["name"])
def test_an_fmu_answers_as_the_table_says(fmu: Fmu, case: dict[str, Any]) -> None:
    returned = TABLE["statuses"][fmu.name]
    with fmu.instance(TABLE["instance_name"]) as instance:
        for call in case["calls"]:
            instance.log.clear()
            status, got = answer(instance, call)
            assert STATUSES[status] == returned[call["status"]], call
            assert [entry.text for entry in instance.log] == (
                [call["message"]] if "message" in call else []
            ), call
            if got:
                assert got["value"] == call["value"]  # to the last bit


def test_the_references_are_those_of_the_variables(fmu: Fmu) -> None:
    named = [call for case in TABLE["cases"] for call in case["calls"] if "variable" in call]
    assert named
    for call in named:
        assert call["reference"] == fmu.reference[call["variable"]]
    assert plant_of(fmu.description).system == TABLE["instance_name"]
