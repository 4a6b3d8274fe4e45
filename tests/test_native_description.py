"""What the native FMU and its sources say of themselves."""

import re
from pathlib import Path
from xml.etree import ElementTree

from fmpy.validation import validate_fmu

import build_fmu
from damped_pendulum.interface import VARIABLES
from native import build as native


def test_the_description_differs_in_what_the_binary_can_do_alone(native_path: Path, fmu_path: Path) -> None:
    native_root, root = (
        ElementTree.fromstring(build_fmu.read_entries(path)["modelDescription.xml"])
        for path in (native_path, fmu_path)
    )
    for section in ("UnitDefinitions", "TypeDefinitions", "DefaultExperiment"):
        texts = {
            re.sub(r"\s+", " ", ElementTree.tostring(r.find(section), "unicode")) for r in (native_root, root)
        }
        assert len({text.replace("> <", "><").strip() for text in texts}) == 1
    for node, other in zip(native_root.iter("ScalarVariable"), root.iter("ScalarVariable"), strict=True):
        assert node.attrib == other.attrib
        node[0].attrib.pop("derivative", None)
        assert (node[0].tag, node[0].attrib) == (other[0].tag, other[0].attrib)
    flags, others = (r.find("CoSimulation").attrib for r in (native_root, root))
    assert {name: value for name, value in flags.items() if others.get(name) != value} == {
        "modelIdentifier": "DampedPendulumNative",
        "needsExecutionTool": "false",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "1",
        "providesDirectionalDerivative": "true",
    }


def test_the_fmu_is_valid_complete_and_the_same_bytes_each_time(native_path: Path, tmp_path: Path) -> None:
    assert validate_fmu(str(native_path)) == []
    again = build_fmu.build_native(tmp_path / "again.fmu", native.host_binary)
    assert again.read_bytes() == native_path.read_bytes()
    entries = build_fmu.read_entries(native_path)
    assert not [name for name in entries if name.endswith(".py") or name.startswith("resources/")]
    page = entries["documentation/index.html"].decode()
    assert "<!--" not in page
    assert "fmi2SetRealInputDerivatives" in page
    assert "documentation/licenses/third_party.txt" in entries


def test_the_fmu_with_python_has_nothing_of_the_native_one(fmu_path: Path) -> None:
    assert not [name for name in build_fmu.read_entries(fmu_path) if "native" in name.lower()]


def test_ranges_are_those_of_the_header() -> None:
    header = native.header("")
    for variable in VARIABLES:
        if variable.range is not None:
            assert f'"{variable.name}"' in header
            for bound in (variable.range.lowest, variable.range.highest):
                assert variable.allows(bound)
                assert repr(float(bound)) in header


def test_the_description_names_the_categories_of_the_messages(native_path: Path) -> None:
    root = ElementTree.fromstring(build_fmu.read_entries(native_path)["modelDescription.xml"])
    assert [node.get("name") for node in root.iter("Category")] == [
        "logStatusWarning",
        "logStatusDiscard",
        "logStatusError",
    ]
