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
        twin.step(0.01 * k, 0.01)
    return twin.phi


@pytest.mark.slow
@pytest.mark.parametrize("stderr", ["open", "closed", "none"])
def test_fmpy_survives_errors_of_every_kind(fmu_path: Path, stderr: str) -> None:
    done = run_host("fmpy_errors", fmu_path, stderr)
    assert done.returncode == 0, done.stderr[-2000:]
    _, phi = done.stdout.split()
    # The communication points differ in the last bit from those of the twin: see the test of the clocks.
    assert float(phi) == pytest.approx(default_angle(), abs=1e-12)


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("libcosimpy_errors", marks=needs("libcosimpy")),
        pytest.param("ecos_errors", marks=[needs("ecospy"), pytest.mark.slow]),
    ],
)
def test_other_importers_survive_errors(fmu_path: Path, program: str) -> None:
    done = run_host(program, fmu_path)
    assert done.returncode == 0, done.stderr[-2000:]
    _, phi = done.stdout.split()
    assert float(phi) == pytest.approx(default_angle(), abs=1e-12)
