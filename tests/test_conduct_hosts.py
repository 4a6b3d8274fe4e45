"""After an error the host lives, in processes of their own: a crash is an exit status."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hosts import needs, run_host
from tests.twin import Twin


def default_angle() -> float:
    """Return phi at the end of the default experiment."""
    twin = Twin()
    for k in range(1000):
        twin.step(0.01 * k, 0.01 * (k + 1) - 0.01 * k)
    return twin.phi


@pytest.mark.slow
@pytest.mark.parametrize("stderr", ["open", "closed", "none"])
def test_fmpy_survives_errors_of_every_kind(fmu_path: Path, stderr: str) -> None:
    assert run_host("fmpy_errors", fmu_path, stderr) == default_angle()


def test_fmpy_survives_control_c_in_a_long_step(fmu_path: Path) -> None:
    assert run_host("fmpy_interrupted", fmu_path) == default_angle()


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_errors", marks=needs("libcosimpy")),
        pytest.param("ecos_errors", marks=[needs("ecospy"), pytest.mark.slow]),
    ],
)
def test_other_importers_survive_errors(fmu_path: Path, program: str) -> None:
    # Their communication points differ from 0.01*k in the last bits.
    assert run_host(program, fmu_path) == pytest.approx(default_angle(), abs=1e-12)
