"""Largest stable steps, growth per period and the traps of the nonlinear pendulum, measured through the FMU."""

from __future__ import annotations

import re
from cmath import phase
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from math import ceil, hypot, log, nan, pi, radians, sqrt

import numpy as np

from .. import references
from ..checks import Check, Curve, Note, Plot, Result, Table, formula
from ..fmu import W0, W02, Experiment, Fmu, SolverMethod
from ..metrics import Array, largest, state_error, walk
from ..references import discrete
from ..references.methods import METHODS, linear_radius
from .scene import Case, Scene

TITLE = "Stability"
FORMULA = "|R(h*lambda)| <= 1, lambda = (-k2 +- sqrt(k2^2 - 4*w02))/2, R from the tableau of the method"

SMALL = 1e-12  # start [rad] for the one-step map: the nonlinearity is a relative SMALL^2, times e^14 in a Taylor series
DAMPING_RATES = (0.002, 1.0, 6.26, 50.0, 1e3, 1e6)
# Largest stable steps [s] at these damping rates, by bisection in 40 digits; the last digit is uncertain by one.
LIMITS = {
    SolverMethod.ExplicitEuler: (
        "0.000203943242596",
        "0.101971621298",
        "0.638342349324",
        "0.0401581495869",
        "0.00200001961368",
        "2.00000000002e-6",
    ),
    SolverMethod.ExplicitMidPoint2: (
        "0.0437889620701",
        "0.405551237508",
        "0.638977004167",
        "0.0401581495869",
        "0.00200001961368",
        "2.00000000002e-6",
    ),
    SolverMethod.ExplicitRungeKutta4: (
        "0.903417829326",
        "0.944514895109",
        "0.889722023408",
        "0.0559261177813",
        "0.00278532087834",
        "2.78529356343e-6",
    ),
    SolverMethod.TaylorSeries: (
        "1.57082051931",
        "2.26864118204",
        "2.33888927426",
        "0.147065841419",
        "0.00732440539137",
        "7.32433356286e-6",
    ),
}
RESOLUTION = 1e-10  # relative, of a bisection
EPS = 2.0**-52  # the spacing of doubles at 1
WARNED = re.compile(r"stability limit of \w+ for this pendulum is ([-+.\de]+) s")


@dataclass(frozen=True)
class LimitScene(Scene):
    """The largest stable steps of a method at the damping rates `DAMPING_RATES`."""

    TITLE = "stability limit of {0.method.name}"

    method: SolverMethod
    limits: Sequence[str]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the limit at every damping rate: of the FMU's steps, of its warning, and of |R| <= 1."""
        method = METHODS[self.method.name]
        rows = []
        for k2, digits in zip(DAMPING_RATES, self.limits, strict=True):
            limit = float(digits)
            name = f"largest stable step of {self.method.name} at k2 = {k2:g}/s"
            measured = largest_stable_step(partial(measured_radius, fmu, self.method, k2), k2)
            theory = largest_stable_step(partial(linear_radius, method, k2, W02), k2)
            warned = _warned_limit(fmu, self.method, k2)
            # The radius is known to some roundings of the map, which the flatness of |R| about 1 multiplies.
            above, below = (linear_radius(method, k2, W02, limit * (1 + x)) for x in (1e-4, -1e-4))
            flat = 8 * EPS / ((above - below) / 2e-4)
            uncertain = RESOLUTION + flat + _last_digit(digits) / limit
            reason = f"{digits} s in 40 digits, to its last digit; bisected to {RESOLUTION:g}, rounding of R {flat:.1e}"
            yield Check(name, abs(measured / limit - 1), uncertain, reason)
            yield formula(f"{name}: |R| <= 1", abs(theory / limit - 1), uncertain, reason)
            yield Check(
                f"{name}: in the warning",
                abs(warned / limit - 1),
                0.5e-5,
                f"{digits} s; the message has six digits",
            )
            rows.append((f"{k2:g}", f"{measured:.10g}", f"{warned:.6g}", f"{theory:.10g}"))
        if self.method is SolverMethod.ExplicitRungeKutta4:
            yield Note(
                f"Stability: the longest stable step of ExplicitRungeKutta4 is {rows[0][1]:.6} s with the default "
                f"drag; with strong drag it is {float(rows[-1][1]) * DAMPING_RATES[-1]:.5g}*m/gamma. The FMU warns "
                "of longer ones. ImplicitEuler has no limit.",
                headline=True,
            )
        yield Table(
            f"Largest stable step of {self.method.name}",
            ("k2 [1/s]", "measured through the FMU [s]", "in the FMU's warning [s]", "from |R| <= 1 [s]"),
            rows,
        )


def _last_digit(digits: str) -> float:
    return float(Decimal(1).scaleb(int(Decimal(digits).as_tuple().exponent)))


def _warned_limit(fmu: Fmu, method: SolverMethod, k2: float) -> float:
    """Return the limit [s] that the FMU names when it warns of a step beyond it, NaN if it does not."""
    h = 100.0
    start = {"gamma": k2, "phi_start": SMALL, "solver.method": method, "solver.stepSize": h}
    warnings = " ".join(fmu.run(Experiment(1e-9, 1e-9, start, record=())).warnings)
    found = WARNED.search(warnings)
    return float(found[1]) if found else nan


@dataclass(frozen=True)
class MapScene(Scene):
    """The stability map of a method in the plane of damping rate and step."""

    TITLE = "stability map of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield how many steps are judged otherwise than by |R|, and the map."""
        method = METHODS[self.method.name]
        damping_rates = np.logspace(-2.5, 4, 24)
        steps = np.logspace(-4, 0.5, 24)
        radius = np.array([[measured_radius(fmu, self.method, k2, h) for k2 in damping_rates] for h in steps])
        expected = np.array([[linear_radius(method, k2, W02, h) for k2 in damping_rates] for h in steps])
        decided = ~(np.abs(expected - 1) <= 1e-12)  # closer to the boundary than that, rounding decides
        right = np.where(expected > 1, radius > 1, radius <= 1)  # NaN is neither
        wrong = decided & ~right
        yield Check(
            f"stability map of {self.method.name}",
            int(np.sum(wrong)),
            0,
            f"steps judged otherwise than by |R|, of {int(np.sum(decided))}: a count has no tolerance",
        )
        fine = np.logspace(-2.5, 4, 200)
        boundary = [largest_stable_step(partial(linear_radius, method, k2, W02), k2) for k2 in fine]
        warned = [_warned_limit(fmu, self.method, k2) for k2 in damping_rates]
        yield Plot(
            f"Stability of {self.method.name}",
            "k2 = gamma/m [1/s]",
            "h [s]",
            [
                Curve("|R(h*lambda)| = 1", fine, boundary),
                Curve("limit in the FMU's warning", damping_rates, warned, "", "."),
            ],
            "xy",
            note="Grey: steps that the FMU was seen to make unstable, each from two small motions; a cell is judged "
            "at its centre. They begin where theory has its boundary, and where the FMU warns.",
            y_range=(1e-4, 10**0.5),
            shade=(damping_rates, steps, radius > 1),
        )


@dataclass(frozen=True)
class GrowthScene(Scene):
    """Growth and frequency shift per period without damping: R(i*z), and its leading terms (factor, exponent) in z."""

    TITLE = "growth per period of {0.method.name}"

    method: SolverMethod
    growth: tuple[float, int]
    shift: tuple[float, int]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield both for three steps, against R and against the leading terms."""
        rows = []
        for z in (0.05, 0.1, 0.2):
            R = METHODS[self.method.name].stability(1j * z)
            measured = _per_period(one_step_map(fmu, self.method, 0.0, z / W0), z)
            expected = (2 * pi / phase(R) * log(abs(R)), phase(R) / z - 1)
            row = [z]
            for i, (what, (factor, power)) in enumerate(
                (("ln of the amplitude factor", self.growth), ("relative frequency shift", self.shift))
            ):
                name = f"{what} per period, {self.method.name}, h*w0 = {z:g}"
                leading = factor * z**power
                yield Check(
                    name,
                    abs(measured[i] - expected[i]),
                    8 * EPS * 2 * pi / z,
                    f"{expected[i]:.6e} from R(i*z); roundings of the map, of which a period has 2*pi/z steps; where "
                    "both round alike, nothing is left",
                )
                yield formula(
                    f"{name}: leading term",
                    abs(expected[i] / leading - 1),
                    2 * z * z,
                    f"{leading:.4e}; the next term is a relative z^2 with a factor below 2",
                )
                row += [measured[i], expected[i], leading]
            rows.append(tuple(row))
        yield Table(
            f"Growth and frequency shift per period of {self.method.name}",
            (
                "h*w0",
                *(
                    f"{what}: {of}"
                    for what in ("ln amplitude", "shift")
                    for of in ("FMU", "R(i*z)", "leading term")
                ),
            ),
            rows,
        )


def _per_period(matrix: Array, z: float) -> tuple[float, float]:
    """Return the logarithm of the growth per period and the relative frequency shift of a one-step map."""
    with np.errstate(all="ignore"):
        sine = np.sqrt(-matrix[0, 1] * matrix[1, 0])
        angle = np.arctan2(sine, (matrix[0, 0] + matrix[1, 1]) / 2)
        growth = 2 * pi / angle * np.log(spectral_radius(matrix))
        return float(growth), float(angle / z - 1)


@dataclass(frozen=True)
class DriftScene(Scene):
    """Energy drift per period of large undamped swings; `h` [s] is rounded so that it divides the period."""

    TITLE = "energy drift of {0.method.name}"

    method: SolverMethod
    h: float
    next_term: Callable[[float], float]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        method = METHODS[self.method.name]
        for angle in (30, 90, 150):
            amplitude = radians(angle)
            T = references.period(amplitude, W02)
            n = round(T / self.h)
            h = T / n
            start = {
                "gamma": 0.0,
                "phi_start": amplitude,
                "solver.method": self.method,
                "solver.stepSize": h,
            }
            energy = fmu.run(Experiment(T, T, start, record=("E",)))["E"]
            # The trapezoidal rule over a whole period converges exponentially.
            orbit = references.libration(np.arange(400) * T / 400, amplitude, W02)
            predicted = T * method.energy_drift(h, orbit, W02)
            yield Check(
                f"energy drift per period of {self.method.name} at {angle} deg",
                abs((energy[-1] - energy[0]) / predicted - 1),
                self.next_term(h * W0),
                f"{predicted / energy[0]:.4e} of E in theory; the next term bounds it, h*w0 = {h * W0:.3g}",
            )


# The one-step map


def one_step_map(fmu: Fmu, method: SolverMethod, k2: float, h: float) -> Array:
    """Return the matrix of one step of small motions in (phi, w/w0), measured from two starts."""
    columns = []
    for phi, w in ((SMALL, 0.0), (0.0, SMALL * W0)):
        start = {"gamma": k2, "phi_start": phi, "w_start": w, "solver.method": method, "solver.stepSize": h}
        run = fmu.run(Experiment(h, h, start, record=("phi", "w")))
        columns.append((run["phi"][-1] / SMALL, run["w"][-1] / (SMALL * W0)))
    return np.array(columns).T


def spectral_radius(matrix: Array) -> float:
    """Return the larger modulus of the eigenvalues of a 2x2 matrix; of a complex pair it is sqrt(det)."""
    half_trace = (matrix[0, 0] + matrix[1, 1]) / 2
    # (a - d)^2/4 + b*c instead of trace^2/4 - det: near a double eigenvalue the latter cancels.
    discriminant = ((matrix[0, 0] - matrix[1, 1]) / 2) ** 2 + matrix[0, 1] * matrix[1, 0]
    if discriminant < 0:
        return hypot(half_trace, sqrt(-discriminant))
    return float(abs(half_trace) + sqrt(discriminant))


def measured_radius(fmu: Fmu, method: SolverMethod, k2: float, h: float) -> float:
    """Return the spectral radius of one step of small motions."""
    return spectral_radius(one_step_map(fmu, method, k2, h))


def largest_stable_step(radius: Callable[[float], float], k2: float) -> float:
    """Return the step [s] beyond which `radius` exceeds 1, by bisection, NaN if short steps have that, or none."""
    stable = 1e-5 / max(W0, k2)
    if not radius(stable) <= 1:
        return nan
    unstable = 1.5 * stable
    while radius(unstable) <= 1:
        stable, unstable = unstable, 1.5 * unstable
        if unstable * max(W0, k2) > 1e3:
            return nan
    while unstable - stable > RESOLUTION / 4 * stable:
        middle = (stable + unstable) / 2
        if radius(middle) <= 1:
            stable = middle
        else:
            unstable = middle
    return stable


# Traps


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
        swing = fmu.run(Experiment(4.0, h, settled(fmu, start, 100 / k2), record=("phi", "w")))
        yield Check(
            f"spurious limit cycle of ExplicitEuler at {angle} deg",
            abs(largest(np.abs(swing["phi"])) / amplitude - 1),
            2 * (h * W0) ** 2,
            f"h*w02/k2 = {ratio:.5f} by the balance of energy; the next term in h is reversible and takes no energy, "
            "the one after it is a relative (h*w0)^2; samples miss the peak by (h*w0)^2/8",
        )
    slow = fmu.run(Experiment(1200.0, 2.0, start, record=("E",)))
    swing_of = np.degrees(2 * np.arcsin(np.sqrt(slow["E"] / (2 * W02))))
    yield Plot(
        f"Trap: ExplicitEuler with h = {h * 1e3:.3g} ms and k2 = 0.02/s never comes to rest",
        "t [s]",
        "amplitude [deg]",
        [
            Curve("FMU, ExplicitEuler", slow.t, swing_of),
            Curve("limit cycle in theory", slow.t[[0, -1]], [angle, angle], "--"),
            Curve("exact, about", slow.t, np.degrees(amplitude / 2) * np.exp(-k2 / 2 * slow.t), ":"),
        ],
        note=f"At {angle} deg the drag takes out as much as the method puts in. The true pendulum comes to rest.",
    )


def _permanent_spin(fmu: Fmu) -> Iterator[Result]:
    """Show that ExplicitEuler turns a small swing into a spin for ever, at a rate that looks plausible."""
    for h in (1e-3, 1e-2):
        expected = W02 * sqrt(h / (2 * 0.002))
        start = {"phi_start": 1e-3, "solver.method": SolverMethod.ExplicitEuler, "solver.stepSize": h}
        # The small swing grows at w02*h - k2 over two, the spin then settles at k2.
        turning = settled(fmu, start, 9000.0)
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
        note="It started at rest, 0.06 deg from the lowest point. Nothing fails, and the rate looks plausible.",
    )


def _escape(fmu: Fmu) -> Iterator[Result]:
    """Show that RK4 throws a large swing over the top at half of the linear limit."""
    curves = []
    for h, escapes in ((0.43, False), (0.46, True)):
        start = {"gamma": 0.0, "phi_start": radians(170), "solver.stepSize": h}
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
        curves.append(Curve(f"h = {h:g} s", shown.t, shown["phi"], "-", "."))
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
    safe = 2.7852935634052816 / ((k2 + sqrt(k2 * k2 + 4 * W02)) / 2)
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
    for h, phi0, grows in ((0.6, 2.0, 1.0), (2.0, 2.0, 1.0), (0.65, pi - 1e-3, 1e3), (1.0, pi - 1e-3, 1e3)):
        start = {
            "gamma": 0.0,
            "phi_start": phi0,
            "solver.method": SolverMethod.ImplicitEuler,
            "solver.stepSize": h,
        }
        n = round(12 / h)
        run = fmu.run(Experiment(n * h, h, start, record=("phi", "w")))
        divided = h / ceil(h / single)
        exact = discrete.motion(SolverMethod.ImplicitEuler.name, run.t.tolist(), phi0, 0.0, 0.0, W02, divided)
        yield Check(
            f"ImplicitEuler from {phi0:.6g} rad divides solver.stepSize = {h:g} s",
            state_error(run["phi"], run["w"], exact),
            walk(n * h / divided) * pi * grows,
            f"against its discrete motion with steps of {divided:.4g} s, below 1/w0 = {single:.4g} s, where x + "
            f"s*sin(x) = c has one root; a rounding grows {grows:g}-fold at most, from 1e-3 rad beside the top or not "
            "at all",
            "rad",
        )
    yield Plot(
        "Trap: undivided steps of backward Euler would stay upright",
        "t [s]",
        "phi [rad]",
        [
            Curve("FMU, ImplicitEuler, solver.stepSize = 1 s", run.t, run["phi"], "", "o"),
            Curve("its discrete motion, h = 0.25 s", run.t, exact[0]),
        ],
        note="Steps above 0.639 s make the upright position stable; the FMU divides them, and falls. The method then "
        "takes the energy out.",
    )


@dataclass(frozen=True)
class UnlimitedScene(Scene):
    """A method that no step makes unstable."""

    TITLE = "{0.method.name} has no limit"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the radius from short to very long steps."""
        method = METHODS[self.method.name]
        weight = sum(abs(b) for b in method.tableau.b) if method.tableau else 1.0
        radii = [
            (measured_radius(fmu, self.method, k2, h), linear_radius(method, k2, W02, h))
            for k2 in (0.0, *DAMPING_RATES)
            for h in (1e-3, 0.3)
        ]
        yield Check(
            f"spectral radius of {self.method.name}",
            largest(abs(measured - exact) for measured, exact in radii),
            8 * EPS * weight,
            "|R| with steps of 1 ms and 0.3 s, damping up to 1e6/s; roundings of a map below 1, times the sum of "
            "abs(b)",
        )


# Orbits and energies


ORBITS = (  # method, h [s]: steps at which the errors show
    (SolverMethod.ExplicitEuler, 0.01),
    (SolverMethod.ImplicitEuler, 0.01),
    (SolverMethod.ExplicitMidPoint2, 0.1),
    (SolverMethod.ExplicitRungeKutta4, 0.2),
)


def _orbits(fmu: Fmu) -> Iterator[Result]:
    """Draw what the methods do to an undamped swing from 90 deg."""
    amplitude, stop = radians(90), 20.0
    T = references.period(amplitude, W02)
    exact = references.libration(np.linspace(0, T, 201), amplitude, W02)
    top = np.linspace(-pi, pi, 201)
    separatrix = 2 * W0 * np.cos(top / 2)
    orbits = [
        Curve("exact", np.degrees(exact[0]), exact[1]),
        Curve("separatrix", np.degrees(np.append(top, top[::-1])), np.append(separatrix, -separatrix), ":"),
    ]
    energies, errors = [], []
    for method, h in ORBITS:
        start = {"gamma": 0.0, "phi_start": amplitude, "solver.method": method, "solver.stepSize": h}
        run = fmu.run(Experiment(stop, h, start, record=("phi", "w", "E")))
        shown = run.t <= 4 * T
        label = f"{method.name}, h = {1e3 * h:g} ms"
        line = "-" if h < 0.05 else ""
        orbits.append(Curve(label, np.degrees(run["phi"][shown]), run["w"][shown], line, "." * (not line)))
        energies.append(Curve(label, run.t, run["E"] / run["E"][0]))
        error = np.abs(run["phi"] - references.libration(run.t, amplitude, W02)[0])
        errors.append(Curve(label, run.t[1:], error[1:]))
    yield Plot(
        "Phase portrait of the methods, undamped, from 90 deg",
        "phi [deg]",
        "w [rad/s]",
        orbits,
        note="Four periods. ExplicitEuler spirals out towards the separatrix, ImplicitEuler in; the methods of "
        "higher order stay close to the exact orbit, with steps ten and twenty times as long.",
    )
    yield Plot(
        "Energy against time by method, undamped, from 90 deg",
        "t [s]",
        "E/E(0)",
        energies,
        note="The exact energy is 1. Below: error of the angle against the elliptic solution.",
        below=errors,
        below_label="|error| [rad]",
        below_logarithmic="y",
    )


SCENES = (
    *(LimitScene(method, limits) for method, limits in LIMITS.items()),
    *(UnlimitedScene(method) for method in SolverMethod if METHODS[method.name].stable),
    *(MapScene(method) for method in LIMITS),
    GrowthScene(SolverMethod.ExplicitEuler, (pi, 1), (-1 / 3, 2)),
    GrowthScene(SolverMethod.ImplicitEuler, (-pi, 1), (-1 / 3, 2)),
    GrowthScene(SolverMethod.ExplicitMidPoint2, (pi / 4, 3), (1 / 6, 2)),
    GrowthScene(SolverMethod.ExplicitRungeKutta4, (-pi / 72, 5), (-1 / 120, 4)),
    DriftScene(SolverMethod.ExplicitEuler, 1e-4, lambda z: pi * z),
    DriftScene(SolverMethod.ImplicitEuler, 1e-4, lambda z: pi * z),
    DriftScene(SolverMethod.ExplicitMidPoint2, 5e-3, lambda z: z * z),
    DriftScene(SolverMethod.ExplicitRungeKutta4, 0.02, lambda z: z * z),
    Case("orbits and energies", _orbits),
    Case("spurious limit cycle", _limit_cycle),
    Case("permanent spin", _permanent_spin),
    Case("escape from the well", _escape),
    Case("stiff drag at large angles", _stiff_amplitude),
    Case("several roots", _several_roots),
)
