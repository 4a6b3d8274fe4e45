"""Crawford's memorandum redone: the elliptic integral in four ways, the linearised motion, figures 2 to 9."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import cos, pi, radians, sin, sqrt
from pathlib import Path

import numpy as np
from scipy.integrate import quad
from scipy.special import ellipkm1

from .. import references
from ..checks import Check, Curve, Plot, Result, Table, formula
from ..fmu import SUBSTEP, W02, Experiment, Fmu, SolverMethod, swing
from ..metrics import UNIT, Array, largest, walk
from ..references import discrete
from .scene import Case, Scene

TITLE = "Crawford's memorandum: elliptic integral and figures 2 to 9"
FORMULA = (
    "T = 4/w0*F(pi/2, k), k = sin(alpha/2), by the series (17), the descent (18)-(19) corrected, the AGM (20)"
)

# Terms of (17), the 1 included, for relative errors of 1e-6 and 1e-12: from 40-digit sums. For 1e-12 at 179 deg the
# count exceeds 200000.
SERIES_LENGTHS: dict[float, Sequence[int]] = {
    1: (2, 3),
    5: (2, 4),
    10: (3, 6),
    20: (4, 8),
    30: (5, 9),
    45: (6, 13),
    60: (8, 18),
    90: (16, 34),
    120: (36, 81),
    150: (141, 329),
    170: (1239, 2944),
    175: (4879, 11702),
    179: (118366,),
}
NEAR_UPRIGHT = (179.9, 179.99, 179.999)

# Largest deviation of alpha*cos(2*pi*t/T) from the motion at t = n*T/400, relative to alpha: from 30-digit evaluation
# of the elliptic functions, to 12 decimals.
SINUSOID = {
    5: 0.000061092465,
    30: 0.002234851040,
    60: 0.009412752859,
    90: 0.023288802070,
    120: 0.048502262659,
    150: 0.100286971941,
    170: 0.189456477716,
    179: 0.352165374555,
}

FIGURE_G = 9.81  # [m/s2]
FIGURE_ANGLE = radians(30)
FIGURES = Path(__file__).resolve().parent.parent / "documents" / "crawford_figures.csv"


@dataclass(frozen=True)
class IntegralScene(Scene):
    """The complete integral at an amplitude [deg], and the lengths of its series for 1e-6 and 1e-12."""

    TITLE = "K at {0.amplitude:g} deg"

    amplitude: float
    lengths: Sequence[int] = ()

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield (20), (18)-(19) and (17) against SciPy's K of the complementary parameter."""
        amplitude = radians(self.amplitude)
        k, k1 = sin(amplitude / 2), cos(amplitude / 2)
        exact = float(ellipkm1(k1 * k1))
        rounding = UNIT * k * k / (k1 * k1) / exact
        reason = (
            f"the rounding of k moves K by {rounding:.1e}, as dK/dk is k/k'^2 at most; and eight roundings"
        )
        for name, value in (
            ("AGM (20)", references.complete_by_agm(k)),
            ("descent (18)-(19)", references.incomplete_by_descent(pi / 2, k)),
        ):
            yield formula(f"{self.name}: {name}", abs(value / exact - 1), rounding + 8 * UNIT, reason)
        if not self.lengths:
            return
        tolerances = (1e-6, 1e-12)[: len(self.lengths)]
        series = references.period_by_series(amplitude, 1.0, self.lengths[-1]) / 4
        yield formula(
            f"{self.name}: series (17), {self.lengths[-1]} terms",
            abs(series / exact - 1),
            tolerances[-1] + 8 * UNIT,
            f"that many terms are meant to reach {tolerances[-1]:g}; and eight roundings",
        )
        counts = [references.series_length(amplitude, tolerance) for tolerance in tolerances]
        yield formula(
            f"{self.name}: numbers of terms of (17)",
            largest(abs(count - length) for count, length in zip(counts, self.lengths, strict=True)),
            0,
            f"integers, {self.lengths} for {tolerances} by 40-digit sums",
        )


@dataclass(frozen=True)
class QuadratureScene(Scene):
    """The integrals (9), (10), (11) and (14) themselves, at an amplitude [deg]."""

    TITLE = "integrals at {0.amplitude:g} deg"

    amplitude: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield each integral against the AGM, and the time that (9) says for a piece of the swing."""
        alpha = radians(self.amplitude)
        k, k1 = sin(alpha / 2), cos(alpha / 2)
        T, root_g = references.period(alpha, FIGURE_G), sqrt(FIGURE_G)
        falling = _to_turning_point(lambda x: _over_root(x, alpha), alpha)
        theta = _integral(lambda x: 1 / sqrt(1 - (k * sin(x)) ** 2), pi / 2)
        # As with the AGM, the rounding of k moves the last one by k/k'^2; as K exceeds 1, that is more than relative.
        lost = UNIT * k * k / (k1 * k1)
        for name, value, moved in (
            ("(10)", sqrt(8) / root_g * falling, 0.0),
            ("(11)", 2 / root_g * sqrt(2) * falling, 0.0),
            ("(14)", 4 / root_g * theta, lost),
        ):
            yield formula(
                f"{self.name}: period by {name}",
                abs(value / T - 1),
                QUADRATURE + moved,
                f"{QUADRATURE_REASON}{f'; the rounding of k, {lost:.1e}' if moved else ''}",
            )
        t = 0.2 * T  # after the lowest point, of T/4 to the turning point
        phi = -float(references.libration(T / 4 + t, alpha, FIGURE_G)[0])
        time = _integral(lambda x: 1 / sqrt(2 * FIGURE_G * _fall(x, alpha)), phi)
        yield formula(
            f"{self.name}: time by (9) from the lowest point",
            abs(time / t - 1),
            QUADRATURE,
            f"0.2*T; {QUADRATURE_REASON}",
        )


# QUADPACK bisects until its 21 points are exact; their positive terms are summed, each rounded as is their sum.
QUADRATURE = 32 * UNIT
QUADRATURE_REASON = "sums of 21 points with a rounding each, and eleven of a point and of the factors"


def _fall(x: float, alpha: float) -> float:
    """Return cos(x) - cos(alpha) without its cancellation."""
    return 2 * sin((alpha - x) / 2) * sin((alpha + x) / 2)


def _over_root(x: float, alpha: float) -> float:
    """Return sqrt((alpha - x)/(cos(x) - cos(alpha))), finite at alpha."""
    return 1 / sqrt(float(np.sinc((alpha - x) / (2 * pi))) * sin((alpha + x) / 2))


def _integral(f: Callable[[float], float], end: float) -> float:
    return float(quad(f, 0, end, epsabs=0, epsrel=1e-13)[0])


def _to_turning_point(f: Callable[[float], float], alpha: float) -> float:
    """Return the integral of f(x)/sqrt(alpha - x) from 0 to alpha."""
    return float(quad(f, 0, alpha, weight="alg", wvar=(0, -0.5), epsabs=0, epsrel=1e-13)[0])


def _difficulty(_: Fmu) -> Iterator[Result]:
    """Show how many points Simpson's rule, Gauss's and the trapezoidal one ask for, "very difficult" in section 1."""
    rows = []
    for amplitude in (30, 90, 150, 170, 179, 179.9):
        k2, exact = sin(radians(amplitude) / 2) ** 2, references.period(radians(amplitude), 1.0) / 4
        rows.append((f"{amplitude:g}", *(f"{rule(k2, 32) / exact - 1:.1e}" for rule in RULES.values())))
    yield Table(
        "Relative errors of (14) with 32 intervals or points",
        ("alpha [deg]", *RULES),
        rows,
        "Section 1 calls simple rules very difficult. They are so close to 180 deg only.",
    )
    half = sin(radians(90) / 2) ** 2
    exact = references.period(radians(90), 1.0) / 4
    n = 16
    # 0.17, at most exp(-2*y) of the singularities at pi/2 + i*y
    strip = (sqrt(half) / (1 + sqrt(1 - half))) ** 2
    for name, truncation, why in (
        ("Simpson", strip**n, "below 0.17^n, as of the trapezoidal rule with half as many intervals"),
        (
            "Gauss",
            0.0,
            "3.1^(-2n), of the ellipse through the singularities pi/2 + 0.88*i, is below rounding",
        ),
        ("trapezoid", 0.0, "0.17^(2n) is below rounding"),
    ):
        yield formula(
            f"(14) at 90 deg by {n} intervals of {name}",
            abs(RULES[name](half, n) / exact - 1),
            truncation + 8 * UNIT,
            f"the integrand is periodic and analytic: the error {why}; and eight roundings",
        )


def _trapezoid(m: float, n: int) -> float:
    x = np.arange(n + 1) * (pi / 2 / n)
    weights = np.ones(n + 1)
    weights[[0, -1]] = 0.5
    return float(weights @ (1 / np.sqrt(1 - m * np.sin(x) ** 2))) * pi / 2 / n


def _simpson(m: float, n: int) -> float:
    return (4 * _trapezoid(m, n) - _trapezoid(m, n // 2)) / 3


def _gauss(m: float, n: int) -> float:
    x, weights = np.polynomial.legendre.leggauss(n)
    return float(np.sum(weights / np.sqrt(1 - m * np.sin((x + 1) * pi / 4) ** 2)) * pi / 4)


RULES = {"Simpson": _simpson, "Gauss": _gauss, "trapezoid": _trapezoid}


def _identities(_: Fmu) -> Iterator[Result]:
    """Yield the steps between the integrals, and those of the linear backward Euler method."""
    alpha = radians(120)
    k = sin(alpha / 2)
    theta = np.linspace(0.1, 1.5, 8)
    half = np.arcsin(k * np.sin(theta))  # phi/2
    slope = np.imag(2 * np.arcsin(k * np.sin(theta + 1e-20j))) / 1e-20  # dphi/dtheta by the complex step
    middle = 2 * k * np.cos(theta) / np.cos(half)
    right = 2 * np.sqrt(k * k - np.sin(half) ** 2) / np.sqrt(1 - (k * np.sin(theta)) ** 2)
    yield formula(
        "(12): cos(phi/2)*dphi/2 = k*cos(theta)*dtheta",
        largest(abs(slope * np.cos(half) / 2 / (k * np.cos(theta)) - 1)),
        8 * UNIT,
        "the complex step loses nothing; eight roundings",
    )
    yield formula(
        "(13), both equalities",
        largest(abs(right / middle - 1)),
        8 * UNIT / float(np.cos(theta[-1])) ** 2,
        "eight roundings, over cos(theta)^2 >= 0.005: there k^2 - sin(phi/2)^2 cancels",
    )
    t = np.linspace(0.1, 0.4, 25) * references.period(alpha, FIGURE_G)
    phi, w = references.libration(t, alpha, FIGURE_G)
    fall = 2 * np.sin((alpha - phi) / 2) * np.sin((alpha + phi) / 2)
    near = 8 * UNIT * alpha / float(alpha - np.abs(phi).max())
    why = f"eight roundings of angles, over the share {8 * UNIT / near:.2g} of alpha that is the least distance to it"
    yield formula(
        "(8): rate of the half swing that falls",
        largest(abs(np.abs(w) / np.sqrt(2 * FIGURE_G * fall) - 1)),
        near / 2,
        f"half of {why}",
    )
    yield formula(
        "(15): kinetic energy is the loss of potential",
        largest(abs(w * w / 2 / (FIGURE_G * fall) - 1)),
        near,
        why,
    )
    defects = []
    for h in (0.006, 0.03, 0.075, 0.2):
        matrix = np.array([[FIGURE_G * h, 1.0], [1.0, -h]])  # (27) times (U1, U2) at n + 1 is (U2, U1) at n
        inverse = np.array([[h, 1.0], [1.0, -FIGURE_G * h]]) / (1 + FIGURE_G * h * h)  # (28)
        defects.append(largest(np.abs(matrix @ inverse - np.eye(2)).ravel()))
    yield formula(
        "(27) times (28) is 1",
        largest(defects),
        4 * UNIT,
        "four roundings of numbers below 1",
    )
    ratio = references.period(FIGURE_ANGLE, FIGURE_G) / (2 * pi / sqrt(FIGURE_G))
    yield formula(
        "period (14) over that of (5), 30 deg",
        abs(ratio - 1.0174087975959560087),
        8 * UNIT,
        "1.0174087975959560087 by 40-digit AGM; eight roundings",
    )


@dataclass(frozen=True)
class DescentScene(Scene):
    """The incomplete integral F(angle, k), and how many descents (18) reach a relative error of 1e-10."""

    TITLE = "F({0.angle:.4g}, {0.k:g}) by (18)-(19)"

    angle: float
    k: float
    steps: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the value of all descents and of few."""
        exact = references.incomplete(self.angle, (1 - self.k) * (1 + self.k))
        yield formula(
            self.name,
            abs(references.incomplete_by_descent(self.angle, self.k) / exact - 1),
            (2 * self.steps + 8) * UNIT,
            "against Carlson's R_F; a descent has positive terms only and adds 1 + k and its product, two roundings; "
            "and eight",
        )
        errors = [
            abs(references.incomplete_by_descent(self.angle, self.k, steps) / exact - 1)
            for steps in range(1, self.steps + 1)
        ]
        enough = next((steps for steps, error in enumerate(errors, 1) if error <= 1e-10), 0)
        yield formula(
            f"{self.name}: recursions to 1e-10",
            abs(enough - self.steps),
            0,
            f'{self.steps} by 40-digit arithmetic, a count; the document: "10 or more decimal places within only a few '
            'recursions"',
        )


@dataclass(frozen=True)
class SinusoidScene(Scene):
    """The motion against a sinusoid of the exact period: amplitude [deg], largest deviation relative to it."""

    TITLE = "sinusoid with the exact period at {0.amplitude:g} deg"

    amplitude: float
    deviation: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield how far the sinusoid is from the FMU, and from the exact motion."""
        angle = radians(self.amplitude)
        T = references.period(angle, W02)
        run = fmu.run(Experiment(T, T / 400, {"gamma": 0.0, "phi_start": angle}))
        sinusoid = angle * np.cos(2 * pi * run.t / T)
        exact = references.libration(run.t, angle, W02)[0]
        deviation = largest(np.abs(exact - sinusoid)) / angle
        own = largest(np.abs(_rk4(angle) - sinusoid)) / angle
        yield Check(
            f"{self.name}: deviation of the FMU",
            abs(largest(np.abs(run["phi"] - sinusoid)) / angle - own),
            2 * _rounding(angle) / angle,
            f"{own:.6g} of alpha in RK4's discrete motion, {abs(own - deviation):.1e} off the elliptic functions; "
            "round-off of both runs",
        )
        yield formula(
            f"{self.name}: deviation of the exact motion",
            abs(deviation - self.deviation),
            0.5e-12,
            f"{self.deviation:.12f} of alpha, half a unit of its last digit",
        )
        if self.amplitude in (30, 150):
            yield Plot(
                f"Motion from {self.amplitude:g} deg and the sinusoid of the same period",
                "t [s]",
                "phi [deg]",
                [
                    Curve("FMU, RK4", run.t[::8], np.degrees(run["phi"][::8]), "", "."),
                    Curve("exact", run.t, np.degrees(exact)),
                    Curve("sinusoid", run.t, np.degrees(sinusoid), "--"),
                ],
                note='Section 4: "very closely approximated by a sinusoid". Below: how closely.',
                below=[Curve("motion less sinusoid", run.t, np.degrees(exact - sinusoid))],
                below_label="difference [deg]",
            )


@cache
def _rk4(amplitude: float) -> Array:
    """Return phi [rad] of RK4's discrete motion over a period from `amplitude` [rad], default step."""
    T = references.period(amplitude, W02)
    t = Experiment(T, T / 400).times()
    return discrete.motion(SolverMethod.ExplicitRungeKutta4.name, t, amplitude, 0.0, 0.0, W02, SUBSTEP)[0]


def _rounding(amplitude: float) -> float:
    """Return the round-off [rad] of a period from `amplitude` [rad] at the default step."""
    T = references.period(amplitude, W02)
    runaway = 2 * pi * amplitude * references.period_slope(amplitude, W02) / T
    return walk(T / SUBSTEP) * amplitude * (1 + runaway)


@dataclass(frozen=True)
class FigureScene(Scene):
    """A figure: its number, method and step [s]; `method` None is the linear method (28) as printed.

    `numbers` are by the end [s] of a window: the largest error [rad] so far against the elliptic solution, the ratio
    of the amplitude 2*asin(sqrt(E/(2*m*g*L))) of the last energy to alpha, and the relative change of the energy. They
    come from runs of an independent implementation in doubles.
    """

    TITLE = "figure {0.number}, {0.kind}, h = {0.milliseconds:g} ms"

    number: int
    method: SolverMethod | None
    step: float
    numbers: tuple[tuple[float, tuple[float, float, float]], ...]

    @property
    def kind(self) -> str:
        """What draws the figure."""
        return "printed linear (28)" if self.method is None else self.method.name

    @property
    def milliseconds(self) -> float:
        """The step in ms."""
        return 1000 * self.step

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the numbers of the figure, and draw it."""
        counts = [round(end / self.step) for end, _ in self.numbers]
        t, phi, E = (
            _linear_backward_euler(self.step, counts[-1])
            if self.method is None
            else _simulate(fmu, self.method, self.step, counts[-1])
        )
        exact = references.libration(t, FIGURE_ANGLE, FIGURE_G)[0]
        measured = [
            (
                largest(np.abs(phi - exact)[: n + 1]),
                2 * float(np.arcsin(np.sqrt(E[n] / (2 * FIGURE_G)))) / FIGURE_ANGLE,
                float(E[n] / E[0] - 1),
            )
            for n in counts
        ]
        rounding = _figure_rounding(self, t)
        check = formula if self.method is None else Check
        grown = max(1.0, *(1 + x[2] for _, x in self.numbers))  # the energy is relative to that of the start
        for i, (what, unit, factor) in enumerate(
            (("largest error", "rad", 1.0), ("amplitude ratio", "", 2.0), ("energy change", "", 2 * grown))
        ):
            yield check(
                f"{self.name}: {what}",
                largest(abs(row[i] - x[i]) for row, (_, x) in zip(measured, self.numbers, strict=True)),
                factor * rounding,
                f"at 5, 10, 20 s; round-off of two runs of {counts[-1]} steps and of their times, which the growing "
                "amplitude carries along",
                unit,
            )
        yield Table(
            self.name[0].upper() + self.name[1:],
            ("t [s]", "largest error [deg]", "amplitude ratio", "energy change [%]"),
            [
                (f"{end:g}", float(np.degrees(error)), ratio, 100 * change)
                for (end, _), (error, ratio, change) in zip(self.numbers, measured, strict=True)
            ],
            shown=False,
        )
        yield _picture(self, t, phi, exact, measured)


def _simulate(fmu: Fmu, method: SolverMethod, h: float, n: int) -> tuple[Array, Array, Array]:
    """Return times, angles and energies of n steps.

    Two runs, whose communication points interleave, are two steps a communication step: so it is solver.stepSize that
    makes the steps.
    """
    start = swing(FIGURE_ANGLE, h, method) | {"g": FIGURE_G}
    t = np.arange(n + 1, dtype=float) * h
    phi, E = np.empty(n + 1), np.empty(n + 1)
    for points in (np.arange(0, n + 1, 2), np.append(0, np.arange(1, n + 1, 2))):
        run = fmu.run(Experiment(0, 0, start, record=("phi", "E"), points=t[points].tolist()))
        phi[points[: len(run.t)]], E[points[: len(run.t)]] = run["phi"], run["E"]
    return t, phi, E


def _linear_backward_euler(h: float, n: int) -> tuple[Array, Array, Array]:
    """Return times, angles and energies of (28) as printed, a formula of the document that no FMU has."""
    w02 = FIGURE_G
    step = np.array([[1.0, h], [-h * w02, 1.0]]) / (1 + h * h * w02)
    states = [np.array([FIGURE_ANGLE, 0.0])]
    for _ in range(n):
        states.append(step @ states[-1])
    phi, w = np.array(states).T
    t = np.arange(n + 1, dtype=float) * h
    return t, phi, np.asarray(w * w / 2 + 2 * w02 * np.sin(phi / 2) ** 2)


def _figure_rounding(scene: FigureScene, t: Array) -> float:
    """Return the round-off of two runs [rad]: of the state each step, and of the times, at the largest amplitude."""
    top = FIGURE_ANGLE * max(1.0, *(ratio for _, (_, ratio, _) in scene.numbers))
    T = references.period(top, FIGURE_G)
    runaway = 2 * pi * t[-1] / T * top * references.period_slope(top, FIGURE_G) / T
    fastest = 2 * sqrt(FIGURE_G) * sin(top / 2)
    # The matrix of (28) rounds once, and that adds up.
    same = UNIT * len(t) * top if scene.method is None else 0.0
    return float(2 * walk(len(t)) * top * (1 + runaway) + same + 4 * UNIT * t[-1] * fastest)


def _picture(
    scene: FigureScene, t: Array, phi: Array, exact: Array, measured: Sequence[tuple[float, float, float]]
) -> Plot:
    shown = t <= 10 + scene.step / 2
    ends = ", ".join(f"{end:g}" for end, _ in scene.numbers)
    errors, ratios, changes = (np.array(column) for column in zip(*measured, strict=True))
    computed = Curve(
        "formula (28)" if scene.method is None else f"FMU, {scene.method.name}",
        t[shown],
        np.degrees(phi[shown]),
        *(("--", "") if scene.step < 0.01 else ("", ".")),
    )
    times = np.linspace(0, 10, 501)
    smooth = references.libration(times, FIGURE_ANGLE, FIGURE_G)[0]
    return Plot(
        scene.name[0].upper() + scene.name[1:],
        "t [s]",
        "phi [deg]",
        [Curve("exact", times, np.degrees(smooth)), computed],
        note=f"At {ends} s: largest error {_list(np.degrees(errors), '.4g')} deg; the amplitude has changed by "
        f"{_list(100 * (ratios - 1), '+.3g')} %, the energy by {_list(100 * changes, '+.3g')} %.",
        below=[Curve("error", t[shown], np.degrees((phi - exact)[shown]))],
        below_label="error [deg]",
    )


def _list(values: Array, form: str) -> str:
    return ", ".join(f"{value:{form}}" for value in values)


def _figures() -> Iterator[FigureScene]:
    """Yield the figures of the table beside the documents."""
    with FIGURES.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for number, method, step in dict.fromkeys((r["figure"], r["method"], r["step [s]"]) for r in rows):
        numbers = tuple(
            (
                float(r["end [s]"]),
                (float(r["largest error [rad]"]), float(r["amplitude ratio"]), float(r["energy change"])),
            )
            for r in rows
            if (r["figure"], r["method"]) == (number, method)
        )
        known = SolverMethod[method] if method in SolverMethod.__members__ else None
        yield FigureScene(int(number), known, float(step), numbers)


def _table(_: Fmu) -> Iterator[Result]:
    rows = []
    for amplitude in (*SERIES_LENGTHS, *NEAR_UPRIGHT):
        angle = radians(amplitude)
        k, exact = sin(angle / 2), references.period(angle, 1.0) / 4
        values = [references.complete_by_agm(k), references.incomplete_by_descent(pi / 2, k)]
        values += [references.period_by_series(angle, 1.0, count) / 4 for count in (5, 20, 100, 1000)]
        rows.append((f"{amplitude:g}", f"{exact:.15g}", *(f"{value / exact - 1:.1e}" for value in values)))
    yield Table(
        "Relative errors of K(k), k = sin(alpha/2)",
        ("alpha [deg]", "K", "AGM (20)", "descent", "(17), 5 terms", "20 terms", "100 terms", "1000 terms"),
        rows,
        "Near 180 deg (18)-(20) lose digits with the rounding of k; AGM(1, cos(alpha/2)), the column K, does not.",
    )


SCENES = (
    Case("steps between the equations", _identities),
    *(QuadratureScene(amplitude) for amplitude in (1, 30, 90, 150, 179)),
    Case("simple rules for the integral", _difficulty),
    *(IntegralScene(amplitude, lengths) for amplitude, lengths in SERIES_LENGTHS.items()),
    *(IntegralScene(amplitude) for amplitude in NEAR_UPRIGHT),
    Case("tables of the elliptic integral", _table),
    DescentScene(pi / 6, 0.5, 3),
    DescentScene(1.0, 0.5, 3),
    DescentScene(1.0, 0.9, 4),
    DescentScene(0.5, 0.99, 4),
    DescentScene(1.0, 0.99, 4),
    DescentScene(1.5, 0.999, 5),
    DescentScene(1.57, 0.999999, 6),
    *(SinusoidScene(*row) for row in SINUSOID.items()),
    *_figures(),
)
