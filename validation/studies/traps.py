"""The traps of the nonlinear pendulum: runs that nothing stops, that look plausible, and that are wrong."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, cos, pi, radians, sin, sqrt

import numpy as np

from .. import references
from ..checks import Check, Curve, Plot, Result, formula
from ..fmu import K2, W0, W02, Experiment, Fmu, SolverMethod, swing
from ..metrics import SIGMAS, growth, largest, state_error, walk
from ..references import discrete
from ..references.methods import METHODS
from .scene import Case

TITLE = "Traps of the nonlinear pendulum"
FORMULA = (
    "k2*mean(w^2) = h/w02*mean((w02*sin(phi))^2) on a limit cycle; w = w02*sqrt(h/(2*k2)) of a spin; "
    "x + s*sin(x) = c of an implicit step"
)


NEAR = 1e-9  # distance [rad] of two neighbouring motions


def settled(fmu: Fmu, start: dict[str, float], time: float) -> dict[str, float]:
    """Return `start` with the state after `time` [s], reached in one communication step."""
    run = fmu.run(Experiment(time, time, start, record=("phi", "w")))
    return start | {"phi_start": float(run["phi"][-1]), "w_start": float(run["w"][-1])}


def _limit_cycle(fmu: Fmu) -> Iterator[Result]:
    """Show that ExplicitEuler beyond its limit neither diverges nor settles: it swings for ever."""
    k2 = 0.02
    for angle in (60, 90, 120):
        t = np.arange(400) / 400
        amplitude = radians(angle)
        q, p = references.libration(t * references.period(amplitude, W02), amplitude, W02)
        ratio = float(W02 * np.mean(p**2) / np.mean((W02 * np.sin(q)) ** 2))
        h = ratio * k2 / W02
        start = {
            "gamma": k2,
            "phi_start": amplitude / 2,
            "solver.method": SolverMethod.ExplicitEuler,
            "solver.stepSize": h,
        }
        # The amplitude settles at a rate of at least a tenth of k2, so this leaves e^-10.
        cycle = fmu.run(Experiment(4.0, h, settled(fmu, start, 100 / k2), record=("phi", "w")))
        yield Check(
            f"spurious limit cycle of ExplicitEuler at {angle} deg",
            abs(largest(np.abs(cycle["phi"])) / amplitude - 1),
            2 * (h * W0) ** 2,
            f"h*w02/k2 = {ratio:.5f} by the balance of energy; the next term in h is reversible and takes no energy, "
            "the one after it is a relative (h*w0)^2; samples miss the peak by (h*w0)^2/8",
        )
    slow = fmu.run(Experiment(1200.0, 2.0, start, record=("E",)))
    amplitudes = np.degrees(2 * np.arcsin(np.sqrt(slow["E"] / (2 * W02))))
    yield Plot(
        f"Trap: ExplicitEuler with h = {h * 1e3:.3g} ms and k2 = 0.02/s never comes to rest",
        "t [s]",
        "amplitude [deg]",
        [
            Curve("FMU, ExplicitEuler", slow.t, amplitudes),
            Curve("limit cycle in theory", slow.t[[0, -1]], [angle, angle], "--"),
            Curve("exact, about", slow.t, np.degrees(amplitude / 2) * np.exp(-k2 / 2 * slow.t), ":"),
        ],
        note=f"At {angle} deg the drag takes out as much as the method puts in. The true pendulum comes to rest.",
    )


def _permanent_spin(fmu: Fmu) -> Iterator[Result]:
    """Show that ExplicitEuler turns a small swing into a spin for ever, at a rate that looks plausible."""
    for h in (1e-3, 1e-2):
        expected = W02 * sqrt(h / (2 * K2))
        start = {"phi_start": 1e-3, "solver.method": SolverMethod.ExplicitEuler, "solver.stepSize": h}
        # The small swing grows at w02*h - k2 over two, the spin then settles at k2.
        turning = settled(fmu, start, 5000.0)
        w = fmu.run(Experiment(50.0, 0.01, turning, record=("w",)))["w"]
        yield Check(
            f"permanent spin of ExplicitEuler at h = {h:g} s",
            abs(float(np.sqrt(np.mean(w**2))) / expected - 1),
            (W02 / expected**2) ** 2,
            f"{expected:.4f} rad/s in theory; gravity modulates the rate by w02/Omega^2, which enters squared",
        )
    run = fmu.run(Experiment(2000.0, 1.0, start, record=("w",)))
    yield Plot(
        "Trap: ExplicitEuler with h = 10 ms and the default drag spins for ever",
        "t [s]",
        "w [rad/s]",
        [
            Curve("FMU", run.t, run["w"]),
            Curve(
                "w02*sqrt(h/(2*k2)), either way", run.t[[0, -1]], [np.sign(run["w"][-1]) * expected] * 2, "--"
            ),
        ],
        note="It started at rest, 0.06 deg from the lowest point; the swing grows until it goes over the top, and "
        "then spins at the rate of the theory. Nothing fails, and the rate looks plausible.",
    )


def _escape(fmu: Fmu) -> Iterator[Result]:
    """Show that RK4 throws a large swing over the top at half of the linear limit."""
    curves = []
    for h, escapes, marker in ((0.43, False, "o"), (0.46, True, "^")):
        start = swing(radians(170), h)
        run = fmu.run(Experiment(3000 * h, 5 * h, start))
        yield Check(
            f"RK4 from 170 deg at h = {h:g} s {'leaves' if escapes else 'stays in'} the well",
            largest(np.abs(run["phi"])),
            pi,
            "escape begins at h = 0.4419 s, bisected in independent arithmetic; the linear limit is 0.9032 s",
            "rad",
            at_least=escapes,
        )
        shown = fmu.run(Experiment(60 * h, h, start))
        curves.append(Curve(f"h = {h:g} s", shown.t, shown["phi"], marker=marker))
    yield Plot(
        "Trap: RK4 leaves the well at half of the linear limit",
        "t [s]",
        "phi [rad]",
        curves,
        note="Both steps are stable for small swings; from 170 deg the longer one goes over the top in its first "
        "swing.",
    )


def _stiff_amplitude(fmu: Fmu) -> Iterator[Result]:
    """Show that the linear limit is not safe above 90 deg, where gravity pushes the fast eigenvalue out."""
    k2 = 50.0
    safe = METHODS["ExplicitRungeKutta4"].real_limit / ((k2 + sqrt(k2 * k2 + 4 * W02)) / 2)
    for angle, h, diverges in ((30, 0.0559, False), (170, 0.0559, True), (170, 0.999 * safe, False)):
        start = {"gamma": k2, "phi_start": radians(angle), "solver.stepSize": h}
        w = fmu.run(Experiment(400 * h, 4 * h, start, record=("w",)))["w"]
        # Below the limit the rate never exceeds that of the overdamped fall, w02/k2.
        yield Check(
            f"RK4 with k2 = 50/s from {angle} deg at h = {h:.5g} s {'is lost' if diverges else 'is stable'}",
            largest(np.abs(w)),
            10 * W02 / k2 if diverges else W02 / k2,
            f"linear limit 0.05593 s, limit at the top {safe:.5g} s; the fall is never faster than w02/k2",
            "rad/s",
            at_least=diverges,
        )


def _several_roots(fmu: Fmu) -> Iterator[Result]:
    """Show that long steps of backward Euler have several roots, and that the FMU divides them until there is one."""
    for h, expected in ((1.0, 7), (2.0, 25)):
        s, c = h * h * W02, 2.0 + h * 1.3
        x = np.linspace(c - s - 1, c + s + 1, 2_000_001)
        roots = int(np.sum(np.diff(np.sign(x + s * np.sin(x) - c)) != 0))
        yield formula(
            f"roots of one step of backward Euler at h = {h:g} s beyond the known {expected}",
            abs(roots - expected),
            0,
            f"x + s*sin(x) = c with s = {s:.4g}, c = {c:.4g} has {expected} roots",
        )
    single = 1 / W0  # s = h^2*w02 < 1 without drag
    for h, phi0 in ((0.6, 2.0), (2.0, 2.0), (0.65, pi - 1e-3), (1.0, pi - 1e-3)):
        n = round(12 / h)
        start = swing(phi0, h, SolverMethod.ImplicitEuler)
        run = fmu.run(Experiment(n * h, h, start, record=("phi", "w")))
        divided = h / ceil(h / single)
        exact, near = (
            discrete.motion(SolverMethod.ImplicitEuler.name, run.t.tolist(), x, 0.0, 0.0, W02, divided)
            for x in (phi0, phi0 - NEAR)
        )
        grown = float(np.max(growth(exact, near, W0)))
        yield Check(
            f"ImplicitEuler from {phi0:.6g} rad divides solver.stepSize = {h:g} s",
            state_error(run["phi"], run["w"], exact),
            walk(n * h / divided) * pi * grown,
            f"against its discrete motion with steps of {divided:.4g} s, below 1/w0 = {single:.4g} s, where x + "
            f"s*sin(x) = c has one root; {SIGMAS:g} sigma of rounding, grown {grown:.3g}-fold at most, as neighbouring "
            "motions grow apart",
            "rad",
        )
    fine = divided * np.arange(round(run.t[-1] / divided) + 1)
    method = SolverMethod.ImplicitEuler.name
    yield Plot(
        "Trap: undivided steps of backward Euler would stay upright",
        "t [s]",
        "phi [rad]",
        [
            Curve(f"FMU, {method}, solver.stepSize = {h:g} s", run.t, run["phi"], "", "o"),
            Curve(
                f"{method}, steps of {divided:g} s",
                fine,
                discrete.motion(method, fine.tolist(), phi0, 0.0, 0.0, W02, divided)[0],
            ),
            Curve(
                f"undivided steps of {h:g} s, nearest root", run.t, _undivided(phi0, h, len(run.t)), "--", "s"
            ),
        ],
        note="Both start at rest, 1e-3 rad beside the top. Steps above 2/w0 = 0.639 s, solved for the root next to "
        "the last angle, make the upright position stable; the FMU divides them, and falls. The method then takes "
        "the energy out.",
    )


def _undivided(phi: float, h: float, n: int) -> list[float]:
    """Return n angles [rad] of backward Euler from rest, each by Newton's method from the one before."""
    angles, w, s = [phi], 0.0, h * h * W02
    for _ in range(n - 1):
        c = x = phi + h * w
        for _ in range(20):
            x -= (x + s * sin(x) - c) / (1 + s * cos(x))
        phi, w = x, (x - phi) / h
        angles.append(phi)
    return angles


SCENES = (
    Case("spurious limit cycle", _limit_cycle),
    Case("permanent spin", _permanent_spin),
    Case("escape from the well", _escape),
    Case("stiff drag at large angles", _stiff_amplitude),
    Case("several roots", _several_roots),
)
