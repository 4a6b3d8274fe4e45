"""Largest stable steps, growth per period and the stability function of small motions, measured through the FMU."""

from __future__ import annotations

import re
from cmath import phase
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache, partial
from math import factorial, floor, hypot, isfinite, isnan, log, nan, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from ..checks import Check, Curve, Note, Plot, Result, Table, formula
from ..fmu import W0, W02, Experiment, Fmu, SolverMethod
from ..metrics import NEXT, SAFETY, UNIT, Array, largest, six_digits
from ..references.methods import METHODS, linear_radius
from ..styles import STYLES
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
UNDAMPED_LIMITS = (  # h*w0 = y > 0 with |R(iy)| = 1
    (SolverMethod.ExplicitRungeKutta4, "2.82842712474619010", "2*sqrt(2)"),
    (SolverMethod.TaylorSeries, "3.32481311853851442", "by mpmath, R of degree 16"),
)
# a and b of R(z) = a - b/z + ... where the drag is so strong that a step is far beyond the time of its decay
ASYMPTOTIC = (
    (SolverMethod.ImplicitEuler, 0.0, 1.0),
    (SolverMethod.ImplicitTrapezoid, -1.0, 4.0),
    (SolverMethod.TRBDF2, 0.0, -2 - 2 * sqrt(2)),
    (SolverMethod.SDIRK4, 0.0, 28 / 3),
)
UNLIMITED = tuple(method for method in SolverMethod if METHODS[method.name].stable)
RESOLUTION = 2.5e-11  # relative, of a bisection
# Rounding of a small map: some ten of a substep, those of the start, the quotient and the eigenvalue.
MAP = 16 * UNIT
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
            flat = _flatness(partial(linear_radius, method, k2, W02), limit)
            uncertain = RESOLUTION + flat + _last_digit(digits) / limit
            reason = f"{digits} s in 40 digits, to its last digit; bisected to {RESOLUTION:g}, rounding of R {flat:.1e}"
            yield Check(name, abs(measured / limit - 1), uncertain, reason)
            yield formula(f"{name}: |R| <= 1", abs(theory / limit - 1), uncertain, reason)
            yield Check(
                f"{name}: in the warning",
                abs(warned / limit - 1),
                six_digits(limit) + _last_digit(digits) / limit,
                f"{digits} s; the message has six digits: half a unit of the last one",
            )
            # A quarter of the length and twice the drag halve all times, without a rounding.
            above, below = (
                _warned_limit(fmu, self.method, 2 * k2, limit / 2 * (1 + x), L=0.25)
                for x in (uncertain, -uncertain)
            )
            yield Check(
                f"{name}: where the warning begins, at half of it for L = 0.25 m and twice this drag",
                float(isfinite(above)) + float(isnan(below)),
                2,
                f"{digits} s; a relative {uncertain:.1e} above its half there is one, as much below it there is none",
                at_least=True,
            )
            rows.append((f"{k2:g}", f"{measured:.10g}", f"{warned:.6g}", f"{theory:.10g}"))
        if self.method is SolverMethod.ExplicitRungeKutta4:
            *others, last = (method.name for method in UNLIMITED)
            yield Note(
                f"Stability: ExplicitRungeKutta4 is stable up to h = {rows[0][1]:.6} s with the default drag and "
                f"{float(rows[-1][1]) * DAMPING_RATES[-1]:.5g}*m/gamma with strong drag, and the FMU warns of longer "
                f"steps; {', '.join(others)} and {last} have no limit.",
                headline=True,
            )
        yield Table(
            f"Largest stable step of {self.method.name}",
            ("k2 [1/s]", "measured through the FMU [s]", "in the FMU's warning [s]", "from |R| <= 1 [s]"),
            rows,
        )


def _last_digit(digits: str) -> float:
    return float(Decimal(1).scaleb(int(Decimal(digits).as_tuple().exponent)))


def _flatness(radius: Callable[[float], float], limit: float) -> float:
    """Return how far, relative to a `limit` [s] of the step, the roundings of a map move where its radius passes 1."""
    above, below = (radius(limit * (1 + x)) for x in (1e-4, -1e-4))
    return MAP / ((above - below) / 2e-4)


def _warned_limit(fmu: Fmu, method: SolverMethod, k2: float, h: float = 100.0, L: float = 1.0) -> float:
    """Return the limit [s] that the FMU names when it warns of a step of `h` [s] beyond it, NaN if it does not."""
    start = {"L": L, "gamma": k2, "phi_start": SMALL, "solver.method": method, "solver.stepSize": h}
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
        boundary = _boundary(self.method, tuple(fine))
        warned = [_warned_limit(fmu, self.method, k2) for k2 in damping_rates]
        yield Plot(
            f"Stability of {self.method.name}",
            "k2 = gamma/m [1/s]",
            "h [s]",
            [
                Curve("|R(h*lambda)| = 1", fine, boundary),
                Curve("limit in the FMU's warning", damping_rates, warned, "", "o"),
            ],
            "xy",
            note="Grey: steps that the FMU was seen to make unstable, each from two small motions; a cell is judged "
            "at its centre. They begin where theory has its boundary, and where the FMU warns.",
            y_range=(1e-4, 10**0.5),
            shade=(damping_rates, steps, radius > 1),
        )


@dataclass(frozen=True)
class GrowthScene(Scene):
    """Growth and frequency shift per period without damping: R(i*z), and its leading terms in z.

    A term is a*z^p*(1 - c*z^2 + ...), given by a, p and c, from the series of ln R(i*z).
    """

    TITLE = "growth per period of {0.method.name}"

    method: SolverMethod
    growth: tuple[float, int, float]
    shift: tuple[float, int, float]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield both for three steps, against R and against the leading terms."""
        rows = []
        for z in (0.05, 0.1, 0.2):
            R = METHODS[self.method.name].stability(1j * z)
            measured = _per_period(one_step_map(fmu, self.method, 0.0, z / W0), z)
            expected = (2 * pi / phase(R) * log(abs(R)), phase(R) / z - 1)
            row = [z]
            for i, (what, (factor, power, following)) in enumerate(
                (("ln of the amplitude factor", self.growth), ("relative frequency shift", self.shift))
            ):
                name = f"{what} per period, {self.method.name}, h*w0 = {z:g}"
                leading = factor * z**power
                yield Check(
                    name,
                    abs(measured[i] - expected[i]),
                    MAP * 2 * pi / z,
                    f"{expected[i]:.6e} from R(i*z); roundings of the map, of which a period has 2*pi/z steps; where "
                    "both round alike, nothing is left",
                )
                yield formula(
                    f"{name}: leading term",
                    abs(expected[i] / leading - 1),
                    SAFETY * following * z * z,
                    f"{leading:.4e}; {SAFETY} x the next term, relative to it -{following:.4g}*z^2",
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


@cache
def _boundary(method: SolverMethod, damping_rates: Sequence[float]) -> list[float]:
    """Return the largest stable steps [s] in theory at damping rates [1/s]."""
    radius = partial(linear_radius, METHODS[method.name])
    return [largest_stable_step(partial(radius, k2, W02), k2) for k2 in damping_rates]


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
    while unstable - stable > RESOLUTION * stable:
        middle = (stable + unstable) / 2
        if radius(middle) <= 1:
            stable = middle
        else:
            unstable = middle
    return stable


# Single steps


@dataclass(frozen=True)
class RadiusScene(Scene):
    """One step of small motions against |R(h*lambda)|, R from the tableau, within and beyond the limits."""

    TITLE = "stability function of {0.method.name}"

    method: SolverMethod

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the largest difference over a grid of damping rates and steps."""
        known = METHODS[self.method.name]
        reach = 5.0
        if known.tableau is not None and known.stable:
            # Longer substeps are divided: a stage must have a single root.
            reach = 0.9 / known.tableau.A[-1][-1]
        weight = known.tableau.weight if known.tableau else _largest_term(reach)
        differences = []
        for k2 in (0.0, *DAMPING_RATES):
            parted = min(1.0, sqrt(abs(k2 * k2 / 4 - W02)) / max(W0, k2))  # how far the eigenvalues are
            for share in (0.02, 0.1, 0.3, 0.6, 1.0):
                h = share * reach / max(W0, k2)
                expected = linear_radius(known, k2, W02, h)
                difference = abs(measured_radius(fmu, self.method, k2, h) - expected)
                differences.append(difference * parted / max(1.0, expected))
        yield Check(
            f"spectral radius of a step of {self.method.name}, {len(differences)} steps and damping rates",
            largest(differences),
            MAP * weight,
            "|R(h*lambda)|; sixteen roundings of the map, times the sum of abs(b) or the largest term of the series; "
            "differences are times that of the eigenvalues, which magnifies them",
        )


def _largest_term(z: float) -> float:
    """Return the largest term z^n/n! of exp(z)."""
    return z ** floor(z) / factorial(floor(z))


def _undamped_limits(fmu: Fmu) -> Iterator[Result]:
    """Show that single steps without drag begin to grow where R(i*h*w0) leaves the unit circle."""
    for method, digits, where in UNDAMPED_LIMITS:
        limit = float(digits) / W0
        flat = _flatness(partial(linear_radius, METHODS[method.name], 0.0, W02), limit)
        near = 2 * _largest_term(float(digits)) * flat
        inside, beyond = (measured_radius(fmu, method, 0.0, limit * (1 + x)) for x in (-near, near))
        yield Check(
            f"largest stable step of {method.name} without drag",
            float(inside <= 1) + float(beyond > 1),
            2,
            f"h*w0 = {digits}, {where}; a relative {near:.1e} below it, twice what rounding of R is worth, a step does "
            "not grow, as much above it it does",
            at_least=True,
        )


def _at_infinity(fmu: Fmu) -> Iterator[Result]:
    """Show what is left of a fast decay after one step far longer than it."""
    k2, h = 1e9, 1.0
    for method, limit, slope in ASYMPTOTIC:
        start = {"gamma": k2, "phi_start": 0.0, "w_start": 1.0, "g": 0.0}
        start |= {"solver.method": method, "solver.stepSize": h}
        rate = float(fmu.run(Experiment(h, h, start, record=("w",)))["w"][-1])
        tableau = METHODS[method.name].tableau
        assert tableau is not None
        yield Check(
            f"{method.name} after a step of 1e9 decay times",
            abs(rate - limit - slope / (k2 * h)),
            MAP * tableau.weight + NEXT * (slope / (k2 * h)) ** 2,
            f"R(z) = {limit:g} {-slope:+.5g}/z for z = -1e9; sixteen roundings of the map, times the sum of abs(b), "
            f"and {NEXT:g} x the square of the last term, the next one",
        )


@cache
def unit_curve(name: str, window: float) -> NDArray[np.complex128]:
    """Return z with |R(z)| = 1 from z = 0 on, R(z) = exp(i*theta), as far as it lies in |z| < `window`."""
    R = METHODS[name].stability
    step = 0.02
    points = []
    for direction in (1, -1):
        z, theta = 0j, 0.0
        while abs(z) < window and theta < 2 * pi * METHODS[name].order:
            theta += step
            for _ in range(20):
                slope = (R(z + 1e-6) - R(z - 1e-6)) / 2e-6
                correction = (R(z) - np.exp(1j * direction * theta)) / slope
                z -= correction
                if abs(correction) < 1e-12:
                    break
            points.append(z)
            if theta > pi and abs(z) < step:  # around
                break
        points = points[::-1]
    return np.array(points)


def _regions(_: Fmu) -> Iterator[Result]:
    """Draw where |R(z)| = 1."""
    curves = []
    for method in SolverMethod:
        z = unit_curve(method.name, 12.0)
        curves.append(Curve(method.name, z.real, z.imag, marker=STYLES[method.name].marker))
    yield Plot(
        "|R(z)| = 1 in the plane of z = h*lambda",
        "Re(h*lambda)",
        "Im(h*lambda)",
        curves,
        note="The explicit methods are stable inside their curves, the implicit ones outside: on all of the left "
        "side, where h*lambda of motions that decay lies. SDIRK4's curve closes beyond the picture, "
        "ImplicitTrapezoid's is the axis.",
    )


SCENES = (
    *(LimitScene(method, limits) for method, limits in LIMITS.items()),
    Case("largest stable steps without drag", _undamped_limits),
    *(RadiusScene(method) for method in SolverMethod),
    Case("fast decay", _at_infinity),
    Case("stability regions", _regions),
    *(MapScene(method) for method in LIMITS),
    GrowthScene(SolverMethod.ExplicitEuler, (pi, 1, 1 / 6), (-1 / 3, 2, 3 / 5)),
    GrowthScene(SolverMethod.ImplicitEuler, (-pi, 1, 1 / 6), (-1 / 3, 2, 3 / 5)),
    GrowthScene(SolverMethod.ExplicitMidPoint2, (pi / 4, 3, 1 / 6), (1 / 6, 2, 3 / 10)),
    GrowthScene(SolverMethod.ExplicitRungeKutta4, (-pi / 72, 5, 1 / 8), (-1 / 120, 4, 5 / 14)),
)
