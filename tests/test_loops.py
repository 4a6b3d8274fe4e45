"""The loops that the FMUs are raced against do the same arithmetic, to the last bit."""

from math import pi
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from native.build import FLAGS as NATIVE_FLAGS
from tests.driver import Fmu
from validation import loops

H, N = 1e-3, 20_000


def motions() -> st.SearchStrategy[tuple[float, float, float, float, float]]:
    """Drive, damping rate, w02, phi, w."""
    return st.tuples(
        st.floats(-10, 10), st.floats(0, 10), st.floats(0, 100), st.floats(-4, 4), st.floats(-5, 5)
    )


@pytest.fixture(scope="module")
def c_loop(tmp_path_factory: pytest.TempPathFactory) -> loops.Loop:
    try:
        return loops.c_loop(tmp_path_factory.mktemp("loop"))
    except loops.NoCompilerError as error:
        pytest.skip(str(error))


@given(motion=motions())
def test_the_loops_in_python_and_in_c_give_the_same_bits(
    c_loop: loops.Loop, motion: tuple[float, float, float, float, float]
) -> None:
    assert loops.python_loop(*motion, H, 100) == c_loop(*motion, H, 100)


@pytest.mark.parametrize("carrier", ["pythonfmu", "native"], indirect=True, scope="session")
def test_an_fmu_gives_the_bits_of_the_loop(fmu: Fmu, carrier: str) -> None:
    with fmu.running({"tau": 0.1}) as instance:
        assert instance.step(0.0, N * H) <= 1
        (phi,) = instance.get("phi")
        # An evaluation costs time, so there may be no more of them than in the loop.
        assert instance.get("solver.nfev") == (4 * N,)
    assert loops.python_loop(0.1, 0.002, 9.80665, pi / 6, 0.0, N * H / N, N) == phi


def test_the_loop_in_c_is_compiled_as_the_native_fmu_is() -> None:
    assert set(loops.FLAGS) <= set(NATIVE_FLAGS)
    assert {flag for flag in NATIVE_FLAGS if flag.startswith(("-O", "-f", "-m", "-std"))} == set(loops.FLAGS)


def test_without_a_compiler_there_is_no_loop_in_c_and_a_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(loops.NoCompilerError, match=r"no C compiler \(cc, gcc, clang\)"):
        loops.c_loop(tmp_path)
    compiler = tmp_path / "cc"
    compiler.write_text("#!/bin/sh\necho no licence >&2\nexit 1\n", "utf-8")
    compiler.chmod(0o755)
    with pytest.raises(loops.NoCompilerError, match=r"cannot compile loop.c: no licence"):
        loops.c_loop(tmp_path)
