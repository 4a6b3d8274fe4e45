"""Stiff and extreme cases: tiny and huge values, odd clocks, long horizons, chaos, each with its reference."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache, partial
from math import cos, expm1, inf, isfinite, log, nan, pi, sin, sqrt, ulp

import numpy as np

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import SUBSTEP, W0, W02, Experiment, Fmu, SolverMethod
from ..metrics import (
    NEXT,
    ROUNDING,
    SIGMAS,
    UNIT,
    Array,
    free_rounding,
    growth,
    largest,
    six_digits,
    state_error,
    upward_crossing,
    walk,
)
from ..references import discrete, taylor
from ..references.methods import METHODS, rk4_lag
from .methods import magnification
from .scene import Case

TITLE = "Stiff and extreme cases"
FORMULA = "closed forms where they exist, Taylor series in 50 digits elsewhere; RK4's own error by its discrete motion"

RK4 = SolverMethod.ExplicitRungeKutta4.name
EXPLICIT = (SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2, SolverMethod.ExplicitRungeKutta4)
DIVERGED = re.compile(
    r"diverged at t = (\S+) s: substep (\d+) of (\S+) s with (\w+) left the range of a double; the stability limit of "
    r"\4 for this pendulum is (\S+) s: use solver\.stepSize"
)


def relative(measured: float, exact: float) -> float:
    """Return the relative error."""
    return abs(measured / exact - 1)


def undamped(**start: float) -> dict[str, float]:
    """Return start values without drag."""
    return {"gamma": 0.0} | start


NEAR = 1e-9  # distance [rad] of two neighbouring motions


# Amplitudes from 1e-300 to pi

# Distance [rad] from the top, RK4's error [s] of 3/4 of a period with 1 ms: its discrete motion in 34 digits.
UPRIGHT = ((1e-3, -1.200237e-8), (1e-6, -1.178823e-2))


def _tiny(fmu: Fmu) -> Iterator[Result]:
    """Show that tiny swings are linear ones, however tiny."""
    h, stop = 0.01, 2.0
    exact = cos(W0 * stop)
    rk4 = float(references.rk4_evolution(round(stop / h), 1.0, 0.0, 0.0, W02, h)[0]) - exact
    for amplitude in (1e-8, 1e-160, 1e-300):
        start = undamped(phi_start=amplitude) | {"solver.stepSize": h}
        phi = fmu.run(Experiment(stop, 0.1, start))["phi"][-1]
        yield Check(
            f"swing from {amplitude:g} rad, 2 s, h = 0.01 s: error beyond that of RK4",
            abs(phi / amplitude - exact - rk4),
            free_rounding(stop, h),
            f"phi(2 s)/amplitude = cos(2*w0) = {exact:.12f}; RK4's error {rk4:.2e} by R(h*A)^n; round-off",
        )
    E = fmu.run(Experiment(0.01, 0.01, undamped(phi_start=1e-8), record=("E",)))["E"][0]
    yield Check(
        "energy at 1e-8 rad keeps its digits",
        relative(E, W02 / 2 * 1e-16),
        7 * UNIT,
        "w02*phi^2/2*(1 - phi^2/12); four roundings of the FMU, three here; 1 - cos(phi) would be 0",
    )


def _near_upright(fmu: Fmu) -> Iterator[Result]:
    """Start within 1e-3 and 1e-6 rad of the top, where rounding of the energy matters, and on it."""
    for delta, rk4 in UPRIGHT:
        amplitude = pi - delta
        exact = references.period(amplitude, W02)
        start = undamped(phi_start=amplitude)
        end = 0.8 * exact
        run = fmu.run(Experiment(end, 0.008, start, record=("phi", "w", "a")))
        crossing = upward_crossing(run.columns, run.t)
        # The first upward crossing comes after 3/4 of a period, half of which is after the first passage.
        wander = SIGMAS * _energy_walk(amplitude) / (W02 * sin(amplitude))
        yield Check(
            f"3/4 period from pi - {delta:g}: error beyond that of RK4",
            abs(crossing - 0.75 * exact - rk4),
            wander * references.period_slope(amplitude, W02) / 2,
            f"exact {0.75 * exact:.12g} s, RK4's error {rk4:.3e} s; {SIGMAS:g} sigma of the rounded energy in a "
            f"passage of the lowest point, {wander:.1e} rad at the next turning point",
            "s",
        )
    yield _at_pi(fmu)


def _at_pi(fmu: Fmu) -> Check:
    """Start at the double next to pi, 1.2e-16 rad off the top: hold how far it gets, and that it falls in the end.

    A method rounds its moves away until the rate, which grows by w02*sin(pi) per s, makes one of half of the last
    digit: for 1.9 s. From there to 1 rad it takes another 11.5 s.
    """
    h, n, end = 0.1, 30, 20.0
    shares = []
    for method in SolverMethod:
        start = undamped(phi_start=pi) | {"solver.method": method, "solver.stepSize": h}
        distance = np.abs(fmu.run(Experiment(end, h, start))["phi"] - pi)
        known = METHODS[method.name]
        R = abs(known.stability(h * W0))
        # Each stage rounds the angle; the last one sums them, and the others' roundings come with the accelerations.
        stages, weight = (1, 0.0) if known.tableau is None else (len(known.tableau.A), known.tableau.weight)
        step = SIGMAS * ulp(pi) / sqrt(12) * stages * (1 + h * W0 * weight)
        most = sin(pi) * R**n + step * sqrt((R ** (2 * n) - 1) / (R**2 - 1))
        shares.append(largest(distance[: n + 1]) / most if largest(distance) >= 1.0 else inf)
    return Check(
        f"start at math.pi, all methods: near the top for {n * h:g} s, 1 rad from it within {end:g} s",
        largest(shares),
        1.0,
        f"the distance over that of the double from pi, grown R(h*w0)-fold in each of {n} substeps, and {SIGMAS:g} "
        "sigma of the roundings of the angle, which grow with it; infinite where a method does not fall",
    )


def _energy_walk(amplitude: float) -> float:
    """Return the standard deviation of the energy per m*L^2 [1/s2] after half a swing of rounded states.

    A substep rounds phi and w by relative `ROUNDING`: the energy moves by w02*sin(phi)*phi and w*w times that.
    """
    t = np.linspace(0, references.period(amplitude, W02) / 2, 1001)
    phi, w = references.libration(t, amplitude, W02)
    return ROUNDING * sqrt(float(np.mean((W02 * phi * np.sin(phi)) ** 2 + w**4)) * t[-1] / SUBSTEP)


# Large values


def _fast_spin(fmu: Fmu) -> Iterator[Result]:
    """Spin at 1e6 rad/s, where gravity is a ripple and the angle must stay right relative to its size."""
    spin = 1e6  # [rad/s]
    phi, w = 999999.99999019334657, 999999.99999937971659  # after 1 s
    start = undamped(phi_start=0.0, w_start=spin)
    half = spin * SUBSTEP / 2  # between the stages of a substep [rad]
    # |sum of (sin(a) + 4*sin(a + half) + sin(a + 2*half))/6| over substeps, a in steps of 2*half
    sampled = abs((2 + cos(half)) / (3 * sin(half)))
    for t, exact in ((1.0, phi), (1e-3, 999.99999999020145892)):
        measured = fmu.run(Experiment(t, t, start))["phi"][-1]
        yield Check(
            f"spin at 1e6 rad/s for {t:g} s",
            relative(measured, exact),
            sampled * W02 * SUBSTEP / spin,
            f"unresolved, gravity is sampled every {half:g} rad: the sum of its sines stays below {sampled:.2f}, which "
            "times w02*h, relative to 1e6 rad/s, is what the rate is off at most",
        )
    h = 1e-6
    run = fmu.run(Experiment(1.0, 1.0, start | {"solver.stepSize": h}, record=("phi", "w")))
    yield Check(
        "spin at 1e6 rad/s, resolved with h = 1e-6 s",
        largest((relative(run["phi"][-1], phi), relative(run["w"][-1], w))),
        ulp(spin) / 2 / h / spin,
        "half an ulp of 1e6 a substep; the increments are nearly equal, so the roundings do not average out",
    )


def _huge_torque(fmu: Fmu) -> Iterator[Result]:
    for h in (0.01, 1e-3):
        start = undamped(phi_start=0.0) | {"solver.stepSize": h}
        run = fmu.run(Experiment(1.0, 1.0, start, torque=lambda t: 1e12, record=("phi", "w")))
        # A kick at the time s moves phi by 1 - s times it: the squares sum up to n/3, and half of that by the sines.
        gravity = SIGMAS * 2 * sqrt(h / 6) * W02 / 1e12
        # n sums of growing numbers round at random, by half an ulp of the result at most.
        yield Check(
            f"torque of 1e12 N.m for 1 s, h = {h:g} s",
            largest((relative(run["phi"][-1], 5e11), relative(run["w"][-1], 1e12))),
            gravity + walk(1 / h),
            f"phi = 5e11, w = 1e12 but for gravity; its kicks w02*h*sin(phi) come at angles as good as random: "
            f"{SIGMAS:g} sigma of them, a relative {gravity:.1e}, and of rounding",
        )


def _tiny_mass(fmu: Fmu) -> Iterator[Result]:
    """Take m = 1e-12 kg, k2 = 2e9/s: the rate settles at (tau - m*g*L*sin(phi))/(gamma*L^2), 500 rad/s, at once."""
    start = {"m": 1e-12, "phi_start": 0.0, "solver.method": SolverMethod.ImplicitEuler}
    run = fmu.run(Experiment(0.01, 0.01, start, torque=lambda t: 1.0, record=("phi", "w")))
    phi, w = run["phi"][-1], run["w"][-1]
    yield Check(
        "m = 1e-12 kg under 1 N.m, ImplicitEuler, w",
        relative(w, 500.0 * (1 - 1e-12 * W02 * sin(phi))),
        7 * UNIT,
        "(tau - m*g*L*sin(phi))/(gamma*L^2); four roundings of the FMU, three here",
    )
    yield Check(
        "m = 1e-12 kg under 1 N.m, ImplicitEuler, phi",
        relative(phi, 4.99999975),
        W02 / 1e12,
        "500 rad/s times the time less m/gamma = 0.5 ns, but for gravity, a relative w02/1e12 at most",
    )
    h = 1e-4
    for method in EXPLICIT:
        divided = start | {"solver.method": method, "solver.stepSize": h}
        failed = fmu.run(Experiment(0.1, 0.1, divided, torque=lambda t: 1.0))
        name = f"m = 1e-12 kg under 1 N.m, {method.name}"
        yield from _ends_in_error(name, failed.failure, 0.0, method, 0.0, 2e9, 1e12, h)


def _ends_in_error(
    name: str,
    failure: str,
    begin: float,
    method: SolverMethod,
    phi0: float,
    k2: float,
    drive: float,
    h: float,
) -> Iterator[Check]:
    """Hold what the message says of a divergence against the discrete motion from rest at `begin` [s], and |R| <= 1."""
    found = DIVERGED.search(failure)
    t, count, _, _, limit = found.groups() if found else ("nan", "nan", "", "", "nan")
    expected = _substep_that_overflows(method, phi0, k2, drive, h)
    yield Check(
        f"{name}: the error names time and substep of the divergence",
        largest((abs(float(count) - expected), abs((float(t) - begin) / h - expected))),
        4 * UNIT * (begin / h + expected),
        f"substep {expected} after {begin:g} s leaves the range of a double in the discrete motion; four roundings of "
        "the time",
    )
    known = METHODS[method.name].real_limit / references.real_roots(k2, W02)[0]
    yield Check(
        f"{name}: the error names the stability limit",
        relative(float(limit), known),
        six_digits(known),
        f"{known:.8g} s, where |R(h*lambda)| = 1; the message has six digits: half a unit of the last one",
    )


def _substep_that_overflows(method: SolverMethod, phi0: float, k2: float, drive: float, h: float) -> int:
    """Return the number of the first substep from rest whose state leaves the range of a double."""
    phi, w, count = phi0, 0.0, 0
    while isfinite(phi) and isfinite(w):
        count += 1
        try:
            state = discrete.motion(method.name, [0.0, h], phi, w, k2, W02, h, drive)
        except ValueError:  # math.sin(inf)
            break
        phi, w = (float(x[-1]) for x in state)
    return count


def _lengths(fmu: Fmu) -> Iterator[Result]:
    """Scale the length: times go with sqrt(L)."""
    for L, T0 in ((1e6, 2006.40929258904045), (1e-6, 2.00640929258904045e-3)):
        w0 = sqrt(W02 / L)
        h = T0 / 2000
        start = undamped(L=L, phi_start=1e-6) | {"solver.stepSize": h}
        run = fmu.run(Experiment(1.5 * T0, T0 / 250, start, record=("phi", "w", "a")))
        crossing = upward_crossing(run.columns, run.t)
        known = (h * w0) ** 4 / 120 + 1e-6**2 / 16  # the next terms are below rounding
        yield Check(
            f"period at L = {L:g} m: error beyond that of RK4",
            abs(crossing / (0.75 * T0) - 1 - known),
            walk(1500) / (1.5 * pi) + 4 * UNIT,
            f"T0 = {T0:.12g} s, longer by RK4's (h*w0)^4/120 and the amplitude's A^2/16, {known:.2e}; {SIGMAS:g} sigma "
            "of the phase in 1500 substeps, and four roundings",
        )


def _gravity(fmu: Fmu) -> Iterator[Result]:
    """Take gravity away, and turn it upwards."""
    k2, phi0, w0, t = 0.002, 0.3, 2.0, 100.0
    coast = {"g": 0.0, "phi_start": phi0, "w_start": w0}
    run = fmu.run(Experiment(t, 10.0, coast, record=("phi", "w")))
    rounding = walk(t / SUBSTEP)
    for name, exact in (("phi", 181.569246922018141), ("w", 1.63746150615596372)):
        yield Check(
            f"g = 0, coasting 100 s, {name}",
            relative(run[name][-1], exact),
            rounding,
            f"{exact:.15g}; {SIGMAS:g} sigma of rounding, RK4's t*k2*(h*k2)^4/120 is 1e-26",
        )
    run = fmu.run(Experiment(t, t, {"g": 0.0, "phi_start": 0.0}, torque=lambda t: 1.0))
    yield Check(
        "g = 0 under 1 N.m from rest, 100 s",
        relative(run["phi"][-1], 4682.68826949546467),
        rounding,
        f"(t + expm1(-k2*t)/k2)/k2 = 4682.68826949546; {SIGMAS:g} sigma of rounding",
    )
    k2 = 1e-12
    run = fmu.run(Experiment(1.0, 1.0, {"g": 0.0, "phi_start": 0.0, "w_start": 1.0, "gamma": k2}))
    yield Check(
        "g = 0, gamma = 1e-12 N.s/m, 1 s",
        relative(run["phi"][-1], -expm1(-k2) / k2),
        walk(1 / SUBSTEP),
        f"(1 - exp(-k2*t))/k2 by expm1 = 0.9999999999995; {SIGMAS:g} sigma of rounding",
    )
    yield from _upwards(fmu)


# Time [s], angle [rad] with g = -9.80665 m/s2 from 0.1 rad at rest, by elliptic functions; RK4's error [rad] with 1 ms:
# its discrete motion in 34 digits.
UPWARDS = (
    (1, 1.11578251237080175, -2.227474e-12),
    (2, 5.67194264344012955, -2.138948e-12),
    (5, 0.334360674260837405, 1.862585e-12),
)


def _upwards(fmu: Fmu) -> Iterator[Result]:
    """Turn gravity upwards: about the upright equilibrium the swing is that of positive gravity, turned by pi."""
    start, phi0, stop = undamped(g=-W02, phi_start=0.1), 0.1, 5.0
    run = fmu.run(Experiment(stop, 1.0, start, record=("phi", "w", "E")))
    swing = pi - phi0
    times = np.linspace(0, stop, 501)
    motion, near = (references.motion(times, swing - shift, 0.0, W02) for shift in (0.0, NEAR))
    growths = growth(motion, near, W0)
    for i, exact, rk4 in UPWARDS:
        until = times <= i
        most, grown = largest(np.abs(pi - motion[0][until])), float(growths[until][-1])
        yield Check(
            f"g = -9.80665 m/s2 from 0.1 rad, {i} s: error beyond that of RK4",
            abs(run["phi"][i] - exact - rk4),
            walk(i / SUBSTEP) * most * grown,
            f"{exact:.15g} rad; RK4's error {rk4:.3e} rad; {SIGMAS:g} sigma of rounding of up to {most:.3g} rad, grown "
            f"{grown:.3g}-fold at most, as neighbouring motions grow apart",
            "rad",
        )
    yield from _runaways(fmu)
    kinetic, potential = run["w"] ** 2 / 2, -2 * W02 * np.sin(run["phi"] / 2) ** 2
    yield Check(
        "g = -9.80665 m/s2: energy at the start and at 1 to 5 s",
        largest(np.abs(run["E"] - (kinetic + potential)) / (kinetic - potential)),
        7 * UNIT,
        "m*L^2*w^2/2 + 2*m*g*L*sin(phi/2)^2, whose second term has the sign of g, relative to both; four roundings of "
        "the FMU, three here",
    )
    h, divided = 0.6, 0.3
    start |= {"solver.method": SolverMethod.ImplicitEuler, "solver.stepSize": h}
    run = fmu.run(Experiment(3.0, h, start, record=("phi", "w")))
    t = run.t.tolist()
    own, near = (
        discrete.motion(SolverMethod.ImplicitEuler.name, t, phi0 + shift, 0.0, 0.0, -W02, divided)
        for shift in (0.0, NEAR)
    )
    grown = float(np.max(growth(own, near)))
    yield Check(
        "g = -9.80665 m/s2: ImplicitEuler divides solver.stepSize = 0.6 s",
        state_error(run["phi"], run["w"], own),
        walk(3.0 / divided) * 2 * pi * grown,
        "against its discrete motion with steps of 0.3 s; abs(s) = h^2*w02 < 1 asks for less than 0.319 s, for either "
        f"sign of g; {SIGMAS:g} sigma of rounding, grown {grown:.3g}-fold at most, as neighbouring motions grow apart",
        "rad",
    )


def _runaways(fmu: Fmu) -> Iterator[Check]:
    """Leave the unstable equilibrium of gravity upwards from 1e-200 rad, where nothing but the angle is rounded."""
    h, n, phi0 = 0.1, 30, 1e-200
    for method in SolverMethod:
        start = undamped(g=-W02, phi_start=phi0) | {"solver.method": method, "solver.stepSize": h}
        run = fmu.run(Experiment(n * h, h, start, record=("phi", "w")))
        R = METHODS[method.name].stability
        rising, falling = (R(sign * h * W0).real ** n for sign in (1, -1))
        exact = np.array([(rising + falling) / 2]), np.array([W0 * (rising - falling) / 2])
        yield Check(
            f"g = -9.80665 m/s2 from {phi0:g} rad, {method.name}, {n} substeps of {h:g} s",
            state_error(run["phi"][-1:] / phi0, run["w"][-1:] / phi0, exact) / rising,
            n * 7 * UNIT * magnification(method),
            f"(R(h*w0)^n + R(-h*w0)^n)/2 = {exact[0][0]:.6g}, and the rate, relative to R(h*w0)^n; four roundings of a "
            "substep of the FMU, three here, magnified by the coefficients with which stages enter the last one",
        )


# Stiff drag


def _overdamped(fmu: Fmu) -> Iterator[Result]:
    """Fall from 90 deg through syrup: tan(phi/2) = exp(-w02*t/k2), to a relative w02/k2^2."""
    k2 = 1e9
    fall = W02 / k2  # [1/s]
    start = {"gamma": k2, "phi_start": pi / 2, "solver.method": SolverMethod.ImplicitEuler}
    for t, exact in ((10.0, 1.57079622872839662), (1e6, 1.56098983397600066), (1e8, 0.71764934920426833)):
        h = max(SUBSTEP, t / 1e4)
        phi = fmu.run(Experiment(t, t, start | {"solver.stepSize": h}))["phi"][-1]
        # An error e moves by e' = -w02/k2*cos(phi)*e + h/2*phi'': backward Euler's local error is h^2/2*phi''.
        euler = -h * fall / 2 * sin(exact) * log(sin(exact))
        yield Check(
            f"gamma/m = 1e9/s, ImplicitEuler, {t:g} s with h = {h:g} s: error beyond its leading term",
            abs(phi - exact - euler),
            NEXT * h * fall * euler + W02 / k2**2 + ulp(pi / 2) / 2 * t / h,
            f"{exact:.15g} rad; leading term -h/2*w02/k2*sin(phi)*ln(sin(phi)) = {euler:.3e} rad, {NEXT:g} x h*w02/k2 "
            "of it, w02/k2^2, and half an ulp a substep (equal increments)",
            "rad",
        )
    for k2 in (1e4, 1e6, 1e9):
        for method in EXPLICIT:
            failed = fmu.run(
                Experiment(3.0, 1.0, {"gamma": k2, "phi_start": pi / 2, "solver.method": method}, begin=2.0)
            )
            name = f"gamma/m = {k2:g}/s, {method.name} with h = 1 ms"
            yield from _ends_in_error(name, failed.failure, 2.0, method, pi / 2, k2, 0.0, SUBSTEP)
            if method == SolverMethod.ExplicitRungeKutta4:
                told = [
                    text
                    for text in failed.warnings
                    if "would be unstable" in text and "use solver.stepSize" in text
                ]
                yield Check(
                    f"gamma/m = {k2:g}/s, RK4: warnings at initialization with the step to use, less 1",
                    abs(len(told) - 1),
                    0,
                    "a count",
                )


# Clocks


@cache
def _cut_motion(t: tuple[float, ...], amplitude: float, h: float) -> references.State:
    """Return RK4's discrete motion from rest at `amplitude` [rad] over the times `t` [s], substeps up to `h` [s]."""
    return discrete.motion(RK4, t, amplitude, 0.0, 0.0, W02, h)


def _communication(fmu: Fmu) -> Iterator[Result]:
    """Show that the answer does not depend on how the importer cuts the time."""
    amplitude, stop, h = pi / 2, 6.0, 5e-3
    exact = references.libration(stop, amplitude, W02)
    start = undamped(phi_start=amplitude) | {"solver.stepSize": h}
    rng = np.random.default_rng(1)
    cuts = {
        "1 s": np.arange(0.0, 6.5, 1.0),
        "0.0137 s, not a multiple of h": np.append(np.arange(0.0, stop, 0.0137), stop),
        "0.25 ms, below h": np.append(np.arange(24000) * 0.25e-3, stop),
        "60 Hz": np.arange(361) / 60,
        "60 Hz with noise of 1e-9 s": np.append(
            np.arange(360) / 60 + np.append(0.0, rng.uniform(-1e-9, 1e-9, 359)), stop
        ),
        "random": np.append(0.0, np.append(np.sort(rng.uniform(0, stop, 200)), stop)),
        "from 1e6 s": 1e6 + np.arange(0.0, 6.5, 0.5),
        "from -1e6 s": -1e6 + np.arange(0.0, 6.5, 0.5),
    }
    T = references.period(amplitude, W02)
    # A rounding of the amplitude moves the phase by what the period makes of it.
    runaway = 2 * pi * stop / T * amplitude * references.period_slope(amplitude, W02) / T
    for name, times in cuts.items():
        t = tuple(times.tolist())
        run = fmu.run(Experiment(stop, SUBSTEP, start, record=("phi", "w"), points=t))
        own = _cut_motion(t, amplitude, h)
        truncation = state_error(own[0][-1:], own[1][-1:], exact)
        substeps = float(np.sum(np.ceil(np.diff(times) / h)))
        yield Check(
            f"communication step {name}: error beyond that of RK4",
            state_error(run["phi"], run["w"], own),
            2 * walk(substeps) * amplitude * (1 + runaway),
            f"at all points against RK4's discrete motion with h = {h:g} s, {truncation:.3e} rad off at the end, over "
            f"the same steps, which carry the rounding of the clock; {SIGMAS:g} sigma of rounding, of both runs",
            "rad",
        )


def _substeps(fmu: Fmu) -> Iterator[Result]:
    """Count the substeps of communication steps as long as 1 to 100 of them, and a little longer or shorter."""
    for name, begin, more, expected in (
        ("", 0.0, 0.0, range(1, 101)),
        (", each half a one shorter", 0.0, -0.5, range(1, 101)),
        (", each 1e-14 s longer", 0.0, 1e-11, range(2, 102)),
        (" from 1e6 s, rounded to 1.2e-10 s", 1e6, 0.0, range(1, 101)),
        (" from 1e6 s, each 1e-6 s longer", 1e6, 1e-3, range(2, 102)),
    ):
        lengths = (np.arange(1, 101) + more) * SUBSTEP
        times = (begin + np.append(0.0, np.cumsum(lengths))).tolist()
        run = fmu.run(Experiment(times[-1], SUBSTEP, undamped(), points=times, record=()))
        yield Check(
            f"evaluations of RK4 in communication steps of 1 to 100 substeps{name}",
            abs(run.nfev - 4 * sum(expected)),
            0,
            "four a substep, substeps as few as are not longer than solver.stepSize but for that rounding: a count",
        )


# Long horizons and chaos


def _long_horizon(fmu: Fmu) -> Iterator[Result]:
    """Show that RK4 takes energy out like h^5*t, which shifts the phase like h^5*t^2 beside the lag h^4*t."""
    h, amplitude = 0.01, pi / 6
    T = references.period(amplitude, W02)
    z = h * W0
    start = undamped() | {"solver.stepSize": h}
    E0 = 2 * W02 * sin(amplitude / 2) ** 2
    orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
    loss = -METHODS[RK4].energy_drift(h, orbit, W02) / E0  # relative, per s
    # Whole periods end where the ripple of the energy is the same as at the start.
    ends = {periods: periods * T for periods in (2500, 10_000)}
    swings = {time: time + np.arange(0, 4 * T, 0.05) for time in (2e3, 1e4, 2e4)}
    points = sorted([0.0, *ends.values(), *np.concatenate(list(swings.values())).tolist()])
    run = fmu.run(Experiment(0, 0, start, record=("phi", "w", "a", "E"), points=points))
    energies = dict(zip(run.t.tolist(), run["E"].tolist(), strict=True))
    for periods, stop in ends.items():
        energy = energies.get(stop, nan)
        yield Check(
            f"energy lost in {periods} periods with h = 0.01 s",
            abs((energy / E0 - 1) / (-loss * stop) - 1),
            z * z + loss * stop,
            f"predicted {-loss * stop:.4e}; next terms (h*w0)^2 and the loss itself",
        )
    rows = []
    for stop, times in swings.items():
        during = np.isin(run.t, times)
        swing = {name: column[during] for name, column in run.columns.items()}
        crossing = upward_crossing(swing, run.t[during], -1)
        measured = float(np.round(crossing / T - 0.75)) + 0.75 - crossing / T
        # dT/dE*dE/dt, integrated twice: a smaller swing is faster. The lag is the period's own h^4 error.
        dT = references.period_slope(amplitude, W02) * loss * E0 / (W02 * sin(amplitude))
        lead, lag = dT / T * crossing**2 / (2 * T), rk4_lag(amplitude) * z**4 * crossing / T
        rows.append((stop, measured, lead - lag, lead, lag))
        yield Check(
            f"phase after {stop:g} s with h = 0.01 s",
            abs(measured - (lead - lag)),
            (z * z + loss * stop) * (lead + lag),
            f"h^5*t^2 lead {lead:.4e}, h^4*t lag {lag:.4e}; next terms (h*w0)^2, and what the loss changes",
            "cycles",
        )
    yield Table(
        "Phase of RK4 with h = 0.01 s from 30 deg",
        ("t [s]", "measured [cycles]", "predicted", "h^5*t^2 lead", "h^4*t lag"),
        rows,
    )


# Continuous drive 1.5*cos(2*t/3) of phi'' + phi'/2 + sin(phi), from 0.2 rad at rest; 40-digit Taylor series.
CHAOS = {
    10: -5.4729087087423552,
    20: -11.4485565861348803,
    50: -28.2783023766960053,
    100: -45.9464758770395672,
}
CHAOTIC_K2, CHAOTIC_W02, CHAOTIC_START = 0.5, 1.0, 0.2
CHAOTIC = {"g": CHAOTIC_W02, "gamma": CHAOTIC_K2, "phi_start": CHAOTIC_START}


def _chaotic_drive(H: float, t: float) -> float:
    """Return the drive in the middle of the step that begins at `t`."""
    return 1.5 * cos(2 * (t + H / 2) / 3)


@cache
def _chaotic_motion(H: float) -> tuple[list[float], Array]:
    times = [i * H for i in range(round(100 / H) + 1)]
    drives = [_chaotic_drive(H, t) for t in times[:-1]]
    return times, taylor.motion(times, CHAOTIC_START, 0.0, CHAOTIC_K2, CHAOTIC_W02, drives)[0]


@cache
def _chaotic_growth(H: float) -> Array:
    """Return `growth` under the drive held over `H` [s]."""
    times, _ = _chaotic_motion(H)
    drives = [_chaotic_drive(H, t) for t in times[:-1]]
    own, near = (
        discrete.motion(RK4, times, CHAOTIC_START + shift, 0.0, CHAOTIC_K2, CHAOTIC_W02, 0.01, drives)
        for shift in (0.0, NEAR)
    )
    return growth(own, near)


def _chaos(fmu: Fmu) -> Iterator[Result]:
    """Show errors grow exponentially: the held input is followed to rounding, the smooth one to O(H^2)."""
    H = 0.1
    run = fmu.run(Experiment(100.0, H, CHAOTIC, partial(_chaotic_drive, H)))
    _, exact = _chaotic_motion(H)
    grown = _chaotic_growth(H)
    for t in CHAOS:
        i = round(t / H)
        # Rounding of the angle each substep, and RK4's h^4/120 per second of a motion with rates below 3 rad/s.
        seed = walk(t / SUBSTEP) * largest(np.abs(exact[: i + 1])) + 3 * SUBSTEP**4 / 120 * t
        yield Check(
            f"chaotic drive, held over {H} s, at {t} s",
            abs(float(run["phi"][i] - exact[i])),
            seed * grown[i],
            f"Taylor series; seed {seed:.1e} rad of rounding and RK4, grown {grown[i]:.3g}-fold at most, as two "
            "neighbouring motions grow apart",
            "rad",
        )
    fine = 1e-3
    smooth = fmu.run(Experiment(100.0, fine, CHAOTIC, partial(_chaotic_drive, fine)))
    for t, angle in CHAOS.items():
        # The held cosine, sampled in the middle, is short by (H*w)^2/24 of its amplitude 1.5.
        seed = 1.5 * (fine * 2 / 3) ** 2 / 24 * t
        yield Check(
            f"chaotic smooth drive, H = 1 ms sampled in the middle, at {t} s",
            abs(float(smooth["phi"][round(t / fine)]) - angle),
            seed * grown[round(t / H)],
            f"{angle:.12f} rad in 40 digits; (H*w)^2/24 of the drive over t, grown as before",
            "rad",
        )
    ends = list(CHAOS)
    yield Plot(
        "Chaotic drive 1.5*cos(2*t/3), k2 = 0.5/s, w02 = 1/s2",
        "t [s]",
        "phi [rad]",
        [
            Curve("FMU, RK4, drive sampled every 1 ms", smooth.t[::50], smooth["phi"][::50]),
            Curve("Taylor series, 40 digits", [0, *ends], [CHAOTIC_START, *CHAOS.values()], "", "o"),
            Curve("FMU, RK4, drive held over 0.1 s", run.t, run["phi"], ":"),
        ],
        note="The drive held over 0.1 s is another drive: from 55 s on it leads elsewhere. The FMU follows each to "
        "its own accuracy. Below: its error for the held drive, against the Taylor series in 50 digits, and what an "
        "error of rounding size grows to.",
        below=[
            Curve("FMU less Taylor series, held drive", run.t[1:], np.abs(run["phi"] - exact)[1:]),
            Curve("1e-16 rad grown", run.t[1:], 1e-16 * grown[1:], "--"),
        ],
        below_label="|error| [rad]",
        below_logarithmic="y",
    )


SCENES = (
    Case("tiny amplitudes", _tiny),
    Case("near the upright position", _near_upright),
    Case("fast spin", _fast_spin),
    Case("huge torque", _huge_torque),
    Case("tiny mass", _tiny_mass),
    Case("lengths", _lengths),
    Case("gravity", _gravity),
    Case("overdamped", _overdamped),
    Case("communication steps", _communication),
    Case("substeps", _substeps),
    Case("long horizon", _long_horizon, slow=True),
    Case("chaotic drive", _chaos),
)
