import re
from math import inf, nan, pi
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.model_description import ModelDescription, ScalarVariable

import build_fmu
from damped_pendulum.interface import INTERFACE, TYPES, VARIABLES
from fmi.tables import Variable
from methods.solvers import SolverMethod
from validation import fmu as of_validation

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def description(fmu_path: Path) -> ModelDescription:
    return fmpy.read_model_description(str(fmu_path), validate=True)


@pytest.fixture(scope="module")
def in_fmu(description: ModelDescription) -> dict[str, ScalarVariable]:
    return {variable.name: variable for variable in description.modelVariables}


def test_the_interface_is_the_agreed_one(in_fmu: dict[str, ScalarVariable]) -> None:
    assert list(in_fmu) == [
        *("m", "L", "gamma", "g", "phi_start", "w_start", "solver.method", "solver.stepSize"),
        "tau",
        *("phi", "w", "a", "E", "solver.nfev"),
    ]


@pytest.mark.parametrize("variable", VARIABLES, ids=lambda variable: variable.name)
def test_a_variable_is_described_as_in_its_table(
    variable: Variable, in_fmu: dict[str, ScalarVariable]
) -> None:
    found = in_fmu[variable.name]
    assert found.description == variable.description
    assert found.causality == variable.causality
    assert (found.unit or "") == INTERFACE.unit_of(variable)
    variability = "continuous" if found.type == "Real" else "discrete"
    assert found.variability == ("fixed" if variable.causality == "parameter" else variability)
    assert found.initial == ("calculated" if variable.causality in ("output", "local") else "exact")
    if variable.start is None:
        assert found.start is None
    else:
        assert float(found.start) == variable.start  # to the last bit


SMALLEST, LARGEST = 5e-324, 1.7976931348623157e308  # positive doubles
# The ends of each range: values that are allowed, and their neighbours that are not.
ENDS: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "> 0": ((SMALLEST, LARGEST), (0.0, -0.0, -SMALLEST, inf, nan)),
    ">= 0": ((0.0, -0.0, SMALLEST, LARGEST), (-SMALLEST, inf, nan)),
    "finite": ((-LARGEST, -SMALLEST, 0.0, SMALLEST, LARGEST), (-inf, inf, nan)),
    "1..8": ((1, 8), (0, 9, -1)),
}
RANGES = {
    "m": "> 0",
    "L": "> 0",
    "gamma": ">= 0",
    "g": "finite",
    "phi_start": "finite",
    "w_start": "finite",
    "solver.method": "1..8",
    "solver.stepSize": "> 0",
    "tau": "finite",
}


@pytest.mark.parametrize("variable", VARIABLES, ids=lambda variable: variable.name)
def test_a_range_ends_where_its_text_says(variable: Variable) -> None:
    assert (variable.range.text if variable.range else None) == RANGES.get(variable.name)
    if variable.range is not None:
        allowed, refused = ENDS[variable.range.text]
        assert all(map(variable.allows, allowed))
        assert not any(map(variable.allows, refused))


def test_every_unit_and_type_is_defined_and_used() -> None:
    units = {unit.name for unit in INTERFACE.units}
    assert {type_.unit for type_ in TYPES} == units
    used = {variable.type for variable in VARIABLES} - {"SolverMethod", "Integer"}
    assert {type_.name for type_ in TYPES} == used


@pytest.mark.parametrize(
    ("unit", "definition"),
    [
        ("N.m", "kg.m.m/s/s"),
        ("N.s/m", "kg/s"),
        ("J", "kg.m.m/s/s"),
        ("m/s2", "m/s/s"),
        ("rad/s2", "rad/s/s"),
    ],
)
def test_base_units_multiply_to_the_unit(unit: str, definition: str) -> None:
    powers: dict[str, int] = {}
    for sign, base in re.findall(r"(^|[./])([a-z]+)", definition):
        powers[base] = powers.get(base, 0) + (-1 if sign == "/" else 1)
    assert next(u for u in INTERFACE.units if u.name == unit).base == powers


def test_degrees_are_shown_for_angles_only(description: ModelDescription) -> None:
    rad = next(unit for unit in description.unitDefinitions if unit.name == "rad")
    (deg,) = rad.displayUnits
    assert deg.name == "deg"
    assert deg.factor * pi == 180
    assert {v.name for v in description.modelVariables if v.displayUnit} == {"phi_start", "phi"}


def test_the_enumeration_comes_first_and_has_the_methods(fmu_path: Path) -> None:
    root = ElementTree.fromstring(build_fmu.read_entries(fmu_path)["modelDescription.xml"])
    first = root.find("TypeDefinitions")[0]
    assert first.get("name") == "SolverMethod"
    items = {item.get("name"): int(item.get("value")) for item in first.iter("Item")}
    assert items == {method.name: method.value for method in SolverMethod}
    assert list(items.values()) == [1, 2, 3, 4, 5, 6, 7, 8]


def test_the_validation_knows_the_methods_and_defaults_of_the_fmu(in_fmu: dict[str, ScalarVariable]) -> None:
    """It shares no code with the FMU, so that its table is one of its own."""
    assert dict(of_validation.SolverMethod.__members__) == dict(SolverMethod.__members__)
    of_kind = {kind: [v for v in in_fmu.values() if v.causality == kind] for kind in ("parameter", "output")}
    assert {v.name: float(v.start) for v in of_kind["parameter"]} == of_validation.DEFAULTS
    assert tuple(v.name for v in of_kind["output"]) == of_validation.OUTPUTS


def test_outputs_say_what_they_depend_on(description: ModelDescription) -> None:
    outputs = {u.variable.name: {v.name for v in u.dependencies} for u in description.outputs}
    assert outputs == {"phi": set(), "w": set(), "a": {"tau"}, "E": set()}
    initial = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    assert initial["phi"] == {"phi_start"}
    assert initial["a"] == {"m", "L", "gamma", "g", "phi_start", "w_start", "tau"}


def test_dates_and_flags_are_truthful(description: ModelDescription) -> None:
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", description.generationDateAndTime)
    flags = description.coSimulation
    assert flags.needsExecutionTool
    assert flags.canHandleVariableCommunicationStepSize
    assert flags.canGetAndSetFMUstate
    assert flags.canSerializeFMUstate
    assert not flags.canInterpolateInputs


def test_start_values_can_be_given_in_degrees(fmu_path: Path) -> None:
    result = fmpy.simulate_fmu(str(fmu_path), stop_time=0.01, start_values={"phi_start": (90, "deg")})
    assert result["phi"][0] == pytest.approx(pi / 2, rel=1e-15, abs=0)


def test_fmpy_simulates_the_default_experiment_without_options(fmu_path: Path) -> None:
    result = fmpy.simulate_fmu(str(fmu_path))
    assert result.dtype.names == ("time", "phi", "w", "a", "E")
    assert len(result) == 1001
    assert result["time"][-1] == 10.0


def test_fmpy_records_the_evaluations_where_they_are_asked_for(fmu_path: Path) -> None:
    result = fmpy.simulate_fmu(str(fmu_path), output=["solver.nfev"])
    assert result["solver.nfev"][-1] == 4 * 10_000


def test_the_tables_of_readme_are_those_of_the_interface() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    assert "solver.stepSize" in readme
    assert build_fmu.readme_with_tables(readme) == readme, "run python build_fmu.py --readme"
