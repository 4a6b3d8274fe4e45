"""The reference results in the FMUs are those of the references, and both FMUs keep their bounds."""

from fractions import Fraction

import numpy as np
import pytest

from validation import references
from validation.fmu import Experiment, Fmu
from validation.reference_results import NAME, RESULTS, TARGET, ReferenceResult, files

each_result = pytest.mark.parametrize("result", RESULTS, ids=lambda result: result.name)


@pytest.fixture(scope="module")
def computed() -> dict[str, str]:
    return files()


def test_the_files_are_what_the_program_makes(computed: dict[str, str]) -> None:
    found = {
        path.relative_to(TARGET).as_posix(): path.read_text("utf-8")
        for path in TARGET.rglob("*.*")
        if path.is_file()
    }
    assert found == computed, "run python -m validation.reference_results"


@each_result
def test_the_coefficients_of_the_equation_are_exact(result: ReferenceResult) -> None:
    m, L, gamma, g = (Fraction(result.values[name]) for name in ("m", "L", "gamma", "g"))
    assert (gamma / m, g / L) == (Fraction(result.k2), Fraction(result.w02))
    assert [Fraction(result.torque(t)) / (m * L * L) for t in result.times[:-1]] == list(
        map(Fraction, result.drives)
    )


def test_the_undamped_swing_is_that_of_the_elliptic_functions() -> None:
    (result,) = (result for result in RESULTS if result.k2 == 0.0)
    phi, w = references.libration(result.times, result.values["phi_start"], result.w02)
    # The functions keep 1e-14 of their argument and of the modulus near 1, which K(k) and the rates magnify.
    np.testing.assert_allclose(result.exact[0], phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(result.exact[1], w, rtol=0, atol=1e-12)


@each_result
def test_the_fmu_keeps_the_bounds(fmu: Fmu, result: ReferenceResult) -> None:
    path = TARGET / "extra" / NAME / f"{result.name}.csv"
    table = np.genfromtxt(path, delimiter=",", names=True, deletechars='"')
    run = fmu.run(
        Experiment(
            stop=10.0,
            step=1 / result.steps_per_second,
            start=result.start,
            torque=result.torque if result.torques else None,
            record=("phi", "w"),
            points=table["time"].tolist(),
        )
    )
    assert run.failure == ""
    for name, bound in result.bounds.items():
        assert np.max(np.abs(run[name] - table[name])) <= bound
