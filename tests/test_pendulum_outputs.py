"""Acceleration and energy of the pendulum are those of the formulas in many digits, not from the sources."""

from __future__ import annotations

from math import pi
from sys import float_info

import pytest
from mpmath import mp, mpf

from tests.driver import OK, Fmu

EPS = float_info.epsilon


def exact_acceleration(
    m: float, L: float, gamma: float, g: float, phi: float, w: float, tau: float
) -> tuple[mpf, mpf]:
    """Return tau/(m*L^2) - gamma/m*w - g/L*sin(phi) and the sum of the sizes of its terms."""
    with mp.workdps(40):
        terms = (
            mpf(tau) / (mpf(m) * mpf(L) ** 2),
            -mpf(gamma) / m * w,
            -mpf(g) / L * mp.sin(phi),
        )
        return sum(terms, mpf(0)), sum(map(abs, terms), mpf(0))


def exact_energy(m: float, L: float, g: float, phi: float, w: float) -> tuple[mpf, mpf]:
    """Return m*L^2*w^2/2 + m*g*L*(1 - cos(phi)) and the sum of the sizes of its terms."""
    with mp.workdps(700):  # 1 - cos(phi) loses twice the digits that phi is below 1
        terms = (mpf(m) * mpf(L) ** 2 * mpf(w) ** 2 / 2, mpf(m) * g * mpf(L) * (1 - mp.cos(phi)))
        return sum(terms, mpf(0)), sum(map(abs, terms), mpf(0))


# Half a unit for each of the products and quotients and of the sums, one for the sine: 2 in the torque, 1 in the drag,
# 2 in gravity, and 1 for the sums; in the energy 2 in the first term, 4 in the second (whose sine is squared) and 1/2
# for the sum. Products of two roundings are far below what is rounded up here.
ACCELERATION_BOUND, ENERGY_BOUND = 4 * EPS, 5 * EPS


@pytest.mark.parametrize("g", [9.80665, -9.80665, -1.62, 0.0])
@pytest.mark.parametrize("phi", [0.0, 1e-160, 1e-8, -1e-8, 1e-3, 0.5, pi / 2, -2.0, pi, 4.0, 100.0])
@pytest.mark.parametrize("w", [0.0, -1.3, 1e-5])
def test_outputs_are_those_of_the_formulas(fmu: Fmu, g: float, phi: float, w: float) -> None:
    m, L, gamma, tau = 2.5, 0.7, 0.3, -0.4
    start = {"m": m, "L": L, "gamma": gamma, "g": g, "phi_start": phi, "w_start": w, "tau": tau}
    with fmu.running(start) as instance:
        a, E = instance.get("a", "E")
        for found, (exact, size), bound in (
            (a, exact_acceleration(m, L, gamma, g, phi, w, tau), ACCELERATION_BOUND),
            (E, exact_energy(m, L, g, phi, w), ENERGY_BOUND),
        ):
            assert abs(found - exact) <= bound * size + mpf(5e-324)


@pytest.mark.parametrize("g", [9.80665, -9.80665])
def test_at_rest_the_energy_has_the_sign_of_gravity(fmu: Fmu, g: float) -> None:
    with fmu.running({"g": g, "phi_start": 3.0}) as instance:
        assert instance.get("E")[0] * g > 0.0


@pytest.mark.parametrize("g", [9.80665, -9.80665])
def test_an_undamped_swing_keeps_its_energy(fmu: Fmu, g: float) -> None:
    with fmu.running({"g": g, "gamma": 0.0, "phi_start": 2.0, "w_start": 1.0}) as instance:
        before = instance.get("E")[0]
        for k in range(100):
            assert instance.step(0.01 * k, 0.01) == OK
        # The local error of RK4 is of the order (h*w0)^5 a substep, 1000 of them; each rounds the state, too.
        scale = 0.5 + 2.0 * abs(g)
        assert abs(instance.get("E")[0] - before) <= 1000 * ((1e-3 * 3.14) ** 5 + 4 * EPS) * scale
