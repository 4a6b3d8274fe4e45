"""The loops that the FMUs are raced against do the same arithmetic, to the last bit."""

from math import pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from native.build import FLAGS as NATIVE_FLAGS
from tests.driver import Fmu
from validation import loops
from validation.fmu import SolverMethod
from validation.race import compiler

H, N = 1e-3, 2000
EXACT = [method for method in SolverMethod if method != SolverMethod.TaylorSeries]  # to the last bit


def motions() -> st.SearchStrategy[tuple[float, float, float, float, float]]:
    """Drive, damping rate, w02, phi, w."""
    return st.tuples(
        st.floats(-10, 10), st.floats(0, 10), st.floats(0, 100), st.floats(-4, 4), st.floats(-5, 5)
    )


@pytest.fixture(scope="module")
def c_loops() -> dict[str, loops.Loop]:
    try:
        return loops.c_loops()
    except compiler.NoCompilerError as error:
        pytest.skip(str(error))


def test_there_is_a_loop_for_each_method() -> None:
    assert list(loops.PYTHON_LOOPS) == [method.name for method in SolverMethod]


@pytest.mark.parametrize("method", EXACT, ids=lambda method: method.name)
@given(motion=motions())
def test_the_loops_in_python_and_in_c_give_the_same_bits(
    c_loops: dict[str, loops.Loop], method: SolverMethod, motion: tuple[float, float, float, float, float]
) -> None:
    assert loops.PYTHON_LOOPS[method.name](*motion, H, 100) == c_loops[method.name](*motion, H, 100)


def running(fmu: Fmu, method: SolverMethod) -> tuple[float, int]:
    """Return the angle after `N` substeps under a torque, and the evaluations."""
    with fmu.running({"tau": 0.1, "solver.method": method, "solver.stepSize": H}) as instance:
        assert instance.step(0.0, N * H) <= 1
        return instance.get("phi")[0], int(instance.get("solver.nfev")[0])


def angle(loop: loops.Loop) -> float:
    return loop(0.1, 0.002, 9.80665, pi / 6, 0.0, N * H / N, N)


@pytest.mark.parametrize("carrier", ["pythonfmu", "native"], indirect=True, scope="session")
@pytest.mark.parametrize("method", EXACT, ids=lambda method: method.name)
def test_an_fmu_gives_the_bits_of_the_loop(fmu: Fmu, carrier: str, method: SolverMethod) -> None:
    assert running(fmu, method)[0] == angle(loops.PYTHON_LOOPS[method.name])


def test_rk4_needs_no_more_evaluations_than_its_loop(fmu: Fmu) -> None:
    assert running(fmu, SolverMethod.ExplicitRungeKutta4)[1] == 4 * N


def test_the_taylor_series_of_the_loops_is_that_of_the_fmu_but_for_rounding(
    fmu: Fmu, c_loops: dict[str, loops.Loop]
) -> None:
    method = SolverMethod.TaylorSeries
    expected = running(fmu, method)[0]
    for loop in (loops.PYTHON_LOOPS[method.name], c_loops[method.name]):
        # Each of the substeps rounds the angle, of less than 1 rad, by a few half ulps, which need not cancel.
        assert angle(loop) == pytest.approx(expected, rel=0, abs=N * 4 * 1.1e-16)


def test_the_loops_in_c_are_compiled_as_the_native_fmu_is() -> None:
    assert set(compiler.FLAGS) <= set(NATIVE_FLAGS)
    assert {flag for flag in NATIVE_FLAGS if flag.startswith(("-O", "-f", "-m", "-std"))} == set(
        compiler.FLAGS
    )


def test_without_a_compiler_there_is_no_loop_in_c_and_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(compiler.NoCompilerError, match=r"no C compiler \(cc, gcc, clang\)"):
        compiler.shared_library(loops.SOURCE, tmp_path)
    fake = tmp_path / "cc"
    fake.write_text("#!/bin/sh\necho no licence >&2\nexit 1\n", "utf-8")
    fake.chmod(0o755)
    with pytest.raises(compiler.NoCompilerError, match=r"cannot compile loop.c: no licence"):
        compiler.shared_library(loops.SOURCE, tmp_path)
