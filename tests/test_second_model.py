"""Shell, methods and build serve another model: what is in second_model replaces what knows the pendulum."""

from __future__ import annotations

from math import cos, exp, sin, sqrt
from random import Random

import pytest
from fmpy.validation import validate_fmu
from scipy.special import ellipj, ellipk

from methods.solvers import METHODS, SolverMethod
from tests.driver import OK, Fmu
from tests.plants import SPRING

RK4 = SolverMethod.ExplicitRungeKutta4


def test_the_fmu_is_valid_and_all_its_own(fmu: Fmu) -> None:
    assert validate_fmu(str(fmu.path)) == []
    assert list(fmu.reference) == [
        *("m", "c", "k", "k3", "x_start", "v_start", "solver.method", "solver.stepSize"),
        "F",
        *("x", "v", "a", "E", "solver.nfev"),
    ]
    page = (fmu.folder / "documentation" / "index.html").read_text("utf-8")
    assert "Hardening of the spring" in page
    assert "<!--" not in page
    needs = (fmu.folder / "documentation" / "externalDependencies.txt").read_text("utf-8")
    assert ("the prefix HardeningSpringNative_" in " ".join(needs.split())) == fmu.native
    assert "Pendulum" not in needs
    assert (fmu.folder / "model.png").read_bytes() == (
        SPRING.folder / "documentation" / "model.png"
    ).read_bytes()
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


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
def test_without_hardening_a_motion_of_any_size_is_the_same_but_for_its_size(
    fmu: Fmu, method: SolverMethod
) -> None:
    """The equation is linear then, and a power of two changes no rounding: also where x^3 is no double."""
    ends = []
    for size in (1.0, 2.0**500):
        start = {"k3": 0.0, "x_start": size, "v_start": -0.5 * size, "solver.method": method}
        with fmu.running(start) as instance:
            instance.set("F", 0.25 * size)
            assert instance.step(0.0, 0.01) == OK
            x, v, a, E = instance.get("x", "v", "a", "E")
            ends.append((x / size, v / size, a / size, E / size / size))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("method", SolverMethod, ids=lambda method: method.name)
def test_both_carriers_give_the_same_bits(carriers: list[Fmu], method: SolverMethod) -> None:
    h = 3.0 if METHODS[method].tableau else 0.02  # long stages show a Newton step that differs
    runs = []
    for fmu in carriers:
        random, values = Random(1), []
        for _ in range(30):
            start = {name: random.uniform(0.1, 5.0) for name in ("m", "c", "k", "k3")}
            start |= {name: random.uniform(-2.0, 2.0) for name in ("x_start", "v_start")}
            with fmu.running(start | {"solver.method": method, "solver.stepSize": h}) as instance:
                for i in range(10):
                    instance.set("F", random.uniform(-5.0, 5.0))
                    assert instance.step(2.5 * h * i, 2.5 * h) == OK
                    values.append(instance.get(*fmu.plant.calculated))
        runs.append(values)
    assert runs[0] == runs[1]
