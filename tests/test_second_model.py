"""Shell, methods and build serve another model: what is in second_model replaces what knows the pendulum."""

from __future__ import annotations

import shutil
import subprocess
import sys
from math import cos, exp, sin, sqrt
from pathlib import Path
from random import Random

import pytest
from fmpy.validation import validate_fmu
from scipy.special import ellipj, ellipk

from tests.driver import OK, WARNING, Fmu, is_error
from tests.walk import Walk

ROOT = Path(__file__).resolve().parent.parent
SECOND = Path(__file__).resolve().parent / "second_model"
OUTPUTS = ("x", "v", "a", "E", "solver.nfev")
EULER, MIDPOINT, RK4, IMPLICIT = 1, 2, 3, 4


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project with the second model in the place of the pendulum, as README tells to make one."""
    folder = tmp_path_factory.mktemp("project")
    for name in ("build_fmu.py", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    ignored = shutil.ignore_patterns("__pycache__", "damped_pendulum", "pendulum.c")
    shutil.copytree(ROOT / "fmu_src", folder / "fmu_src", ignore=ignored)
    shutil.copytree(SECOND, folder / "fmu_src", dirs_exist_ok=True)
    return folder


@pytest.fixture(scope="module", params=["pythonfmu", "native"])
def fmu(request: pytest.FixtureRequest, project: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    native = request.param == "native"
    options = ["--native"] if native else []
    command = [sys.executable, "build_fmu.py", *options]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    if native and done.returncode == 2:
        pytest.skip(done.stderr.strip())  # no compiler
    assert done.returncode == 0, done.stderr
    return Fmu(
        project / "dist" / f"HardeningSpring{'Native' if native else ''}.fmu", tmp_path_factory.mktemp("fmu")
    )


def test_the_fmu_is_valid_and_all_its_own(fmu: Fmu) -> None:
    assert validate_fmu(str(fmu.path)) == []
    assert list(fmu.reference) == [
        "m",
        "c",
        "k",
        "k3",
        "x_start",
        "v_start",
        *("solver.method", "solver.stepSize"),
        "F",
        *OUTPUTS,
    ]
    page = (fmu.folder / "documentation" / "index.html").read_text("utf-8")
    assert "Hardening of the spring" in page
    assert "<!--" not in page
    assert (fmu.folder / "model.png").read_bytes() == (SECOND / "documentation" / "model.png").read_bytes()
    named = [path for path in fmu.folder.rglob("*pendulum*") if path.suffix != ".so"]
    assert named == []


def test_small_swings_are_those_of_the_linear_spring(fmu: Fmu) -> None:
    m, c, k, amplitude, end = 2.0, 0.4, 9.0, 1e-5, 5.0
    start = {"m": m, "c": c, "k": k, "k3": 3.0, "x_start": amplitude, "solver.method": RK4}
    with fmu.running(start) as instance:
        instance.run([0.01 * i for i in range(501)])
        x, v = instance.get("x", "v")
    decay, w0 = c / (2 * m), sqrt(k / m)
    w = sqrt(w0**2 - decay**2)
    assert x == pytest.approx(
        amplitude * exp(-decay * end) * (cos(w * end) + decay / w * sin(w * end)),
        abs=bound(amplitude, w0, end),
    )
    assert v == pytest.approx(
        -amplitude * exp(-decay * end) * w0**2 / w * sin(w * end), abs=w0 * bound(amplitude, w0, end)
    )


def bound(amplitude: float, w0: float, end: float, h: float = 1e-3) -> float:
    """Return what RK4 and rounding change in `end` [s], twice.

    The phase error of RK4 is w0*t*(h*w0)^4/120, that of a step's rounding eps, and k3*x^3 is a relative 1e-10 of k*x.
    """
    return 2.0 * amplitude * (w0 * end * ((h * w0) ** 4 / 120 + 1e-10) + 2.2e-16 * end / h)


def test_the_undamped_hardening_spring_has_the_period_of_the_elliptic_integral(fmu: Fmu) -> None:
    """x = A*cn(p*t, m), p^2 = (k + k3*A^2)/mass, m = k3*A^2/(2*(k + k3*A^2)): NIST DLMF 22.13."""
    mass, k, k3, A = 1.5, 10.0, 40.0, 0.8
    p = sqrt((k + k3 * A * A) / mass)
    parameter = k3 * A * A / (2 * (k + k3 * A * A))
    period = 4 * ellipk(parameter) / p
    h = period / 2000
    start = {"m": mass, "c": 0.0, "k": k, "k3": k3, "x_start": A, "solver.stepSize": h, "solver.method": RK4}
    with fmu.running(start) as instance:
        for i in range(100):  # ten steps a period
            assert instance.step(i * period / 10, period / 10) == OK
            sn, cn, dn, _ = ellipj(p * period * (i + 1) / 10, parameter)
            x, v = instance.get("x", "v")
            # RK4 errs by less than (h*w)^4 a radian, w = p the largest rate of the motion.
            error = A * p * period * (i + 1) / 10 * (h * p) ** 4
            assert x == pytest.approx(A * cn, abs=error)
            assert v == pytest.approx(-A * p * sn * dn, abs=2 * p * error)


@pytest.mark.parametrize("method", [EULER, MIDPOINT, RK4, IMPLICIT])
def test_both_carriers_give_the_same_bits(
    project: Path, method: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    paths = [project / "dist" / f"HardeningSpring{name}.fmu" for name in ("", "Native")]
    if not all(path.exists() for path in paths):
        pytest.skip("there is no native FMU: no compiler")
    runs = []
    for path in paths:
        start = {"c": 0.3, "x_start": 1.5, "v_start": -0.7, "solver.method": method, "solver.stepSize": 0.02}
        values = []
        with Fmu(path, tmp_path_factory.mktemp("fmu")).running(start) as instance:
            for i in range(50):
                instance.set("F", 0.1 * (i % 7))
                assert instance.step(0.05 * i, 0.05) == OK
                values.append(instance.get(*OUTPUTS))
        runs.append(values)
    assert runs[0] == runs[1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_random_walk_over_all_calls_ends_with_a_host_that_works(fmu: Fmu, seed: int) -> None:
    walk = Walk(fmu, Random(seed))
    for _ in range(2000):
        walk.call()
    walk.end()
    assert (
        0.1 < walk.errors / walk.calls < 0.9
    )  # neither a walk that is stuck in errors nor one that makes none


def test_conduct_is_that_of_the_shell(fmu: Fmu) -> None:
    with fmu.instance("spring") as instance:
        assert is_error(instance.initialize({"m": -1.0, "k3": -2.0}))
        assert instance.errors == [
            "spring: cannot initialize: m = -1.0 kg (allowed: > 0); k3 = -2.0 N/m3 (allowed: >= 0)"
        ]
    with fmu.instance("spring") as instance:
        start = {"c": 0.0, "solver.method": EULER}
        assert instance.initialize(start, stop=1.0) <= WARNING
        assert instance.warnings[0].text == (
            "solver.stepSize = 0.001 s is unstable: ExplicitEuler has no stable step size for this spring "
            "(stability limit 0 s): use ExplicitRungeKutta4 or ImplicitEuler"
        )
        assert is_error(instance.step(0.0, 2.0))
        assert is_error(instance.set("x", 1.0))
        assert instance.errors[1] == "spring: x is an output: it cannot be set"
    with fmu.running({"x_start": 1.0}) as instance:
        assert instance.step(0.0, 0.01) == OK
        state = instance.save()
        instance.run([0.01, 0.02, 0.03])
        future = instance.get(*OUTPUTS)
        data = instance.serialize(state)
        assert instance.restore_bytes(data) == OK
        instance.run([0.01, 0.02, 0.03])
        assert instance.get(*OUTPUTS) == future
        instance.free_state(state)
