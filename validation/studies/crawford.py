"""Crawford's memorandum redone: the elliptic integral in three ways, the linearised motion, figures 2 to 9."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import asin, cos, pi, radians, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipkm1

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W02, Experiment, Fmu, SolverMethod, degrees
from ..metrics import largest
from .scene import Scene

TITLE = "Crawford's memorandum: elliptic integral and figures 2 to 9"
FORMULA = (
    "T = 4/w0*F(pi/2, k), k = sin(alpha/2), by the series (17), the descent (18)-(19) corrected, the AGM (20)"
)

Array = NDArray[np.float64]
EPS = 2.2e-16  # twice the relative error of a rounding

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

# Largest deviation of alpha*cos(2*pi*t/T) from the motion over a period, relative to alpha, and the size of its last
# digit: from 40-digit evaluation of the elliptic functions.
SINUSOID = (
    (5, 6.1e-5, 1e-6),
    (30, 2.2e-3, 1e-4),
    (60, 9.4e-3, 1e-4),
    (90, 2.3e-2, 1e-3),
    (120, 4.9e-2, 1e-3),
    (150, 0.10, 1e-2),
    (170, 0.19, 1e-2),
    (179, 0.35, 1e-2),
)

FIGURE_G = 9.81  # [m/s2]
FIGURE_ANGLE = radians(30)
WINDOWS = (5.0, 10.0, 20.0)  # ends [s]; the run goes to the step that is nearest


@dataclass(frozen=True)
class IntegralScene(Scene):
    """The complete integral at an amplitude [deg], and the lengths of its series for 1e-6 and 1e-12."""

    TITLE = "K at {0.amplitude:g} deg"

    amplitude: float
    lengths: Sequence[int] = ()

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        amplitude = radians(self.amplitude)
        k, k1 = sin(amplitude / 2), cos(amplitude / 2)
        exact = float(ellipkm1(k1 * k1))
        rounding = EPS / 2 * k * k / (k1 * k1) / exact
        reason = f"the rounding of k moves K by {rounding:.1e}, as dK/dk is 1/k'^2 at most; and 4 roundings"
        yield Check(
            f"{self.name}: AGM (20)",
            abs(references.complete_by_agm(k) / exact - 1),
            rounding + 4 * EPS,
            reason,
        )
        descent = references.incomplete_by_descent(pi / 2, k)
        yield Check(f"{self.name}: descent (18)-(19)", abs(descent / exact - 1), rounding + 4 * EPS, reason)
        if not self.lengths:
            return
        tolerances = (1e-6, 1e-12)[: len(self.lengths)]
        series = references.period_by_series(amplitude, 1.0, self.lengths[-1]) / 4
        yield Check(
            f"{self.name}: series (17), {self.lengths[-1]} terms",
            abs(series / exact - 1),
            tolerances[-1] + 4 * EPS,
            f"that many terms are meant to reach {tolerances[-1]:g}; and 4 roundings",
        )
        counts = [references.series_length(amplitude, tolerance) for tolerance in tolerances]
        yield Check(
            f"{self.name}: numbers of terms of (17)",
            max(abs(count - length) for count, length in zip(counts, self.lengths, strict=True)),
            0,
            f"integers, {self.lengths} for {tolerances} by 40-digit sums",
        )


@dataclass(frozen=True)
class DescentScene(Scene):
    """The incomplete integral F(angle, k), and how many descents (18) reach a relative error of 1e-10."""

    TITLE = "F({0.angle:.4g}, {0.k:g}) by (18)-(19)"

    angle: float
    k: float
    steps: int

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        m1 = (1 - self.k) * (1 + self.k)
        exact = references.incomplete(self.angle, m1)
        yield Check(
            self.name,
            abs(references.incomplete_by_descent(self.angle, self.k) / exact - 1),
            (2 * self.steps + 6) * EPS,
            "against Carlson's R_F; every descent has positive terms only and adds some two roundings",
        )
        yield Check(
            f"{self.name}, {self.steps} recursions",
            abs(references.incomplete_by_descent(self.angle, self.k, self.steps) / exact - 1),
            1e-10,
            '"10 or more decimal places within only a few recursions"',
        )


@dataclass(frozen=True)
class SinusoidScene(Scene):
    """The motion against a sinusoid of the exact period: amplitude [deg], relative deviation, its last digit."""

    TITLE = "sinusoid with the exact period at {0.amplitude:g} deg"

    amplitude: float
    deviation: float
    digit: float

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        angle = radians(self.amplitude)
        T = references.period(angle, W02)
        run = fmu.run(Experiment(T, T / 400, degrees(self.amplitude)))
        sinusoid = angle * np.cos(2 * pi * run.t / T)
        yield Check(
            self.name,
            abs(float(np.max(np.abs(run["phi"] - sinusoid))) / angle - self.deviation),
            0.5 * self.digit + (pi / 400) ** 2 / 2 * 9 * self.deviation,
            f"{self.deviation:g} of alpha, half a unit of its last digit; 400 samples miss the peak of the third "
            "harmonic by less than the rest",
        )
        if self.amplitude in (30, 150):
            yield Plot(
                f"Motion from {self.amplitude:g} deg and the sinusoid of the same period",
                "t [s]",
                "phi [deg]",
                [
                    Curve("FMU, RK4", run.t[::8].tolist(), np.degrees(run["phi"][::8]).tolist(), "", "."),
                    Curve(
                        "exact",
                        run.t.tolist(),
                        np.degrees(references.libration(run.t, angle, W02)[0]).tolist(),
                    ),
                    Curve("sinusoid", run.t.tolist(), np.degrees(sinusoid).tolist(), "--"),
                ],
            )


@dataclass(frozen=True)
class FigureScene(Scene):
    """A figure: its method and step [s], and its numbers at the ends of the windows.

    `numbers` are, for 5, 10 and 20 s: the largest error [rad] so far against the elliptic solution, the ratio of the
    amplitude 2*asin(sqrt(E/(2*m*g*L))) of the last energy to alpha, and the relative change of the energy. They come
    from runs of an independent implementation in doubles.
    """

    TITLE = "{0.title}"

    title: str
    method: SolverMethod | None  # None: the linear method (28) as printed
    step: float
    numbers: Sequence[tuple[float, float, float]]

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows."""
        counts = [round(end / self.step) for end in WINDOWS]
        t, phi, E = (
            _linear_backward_euler(self.step, counts[-1]) if self.method is None else _simulate(fmu, self)
        )
        exact = references.libration(t, FIGURE_ANGLE, FIGURE_G)[0]
        measured = []
        for n in counts:
            amplitude = 2 * asin(sqrt(E[n] / (2 * FIGURE_G)))
            measured.append(
                (
                    float(np.max(np.abs(phi - exact)[: n + 1])),
                    amplitude / FIGURE_ANGLE,
                    float(E[n] / E[0] - 1),
                )
            )
        steepest = float(np.max(np.abs(np.diff(phi)))) / self.step
        bound = 4 * counts[-1] * EPS + 4 * EPS * WINDOWS[-1] * steepest
        for i, (what, unit) in enumerate(
            (("largest error", "rad"), ("amplitude ratio", ""), ("energy change", ""))
        ):
            yield Check(
                f"{self.name}: {what}",
                largest(
                    abs(row[i] - expected[i]) for row, expected in zip(measured, self.numbers, strict=True)
                ),
                bound,
                f"at 5, 10, 20 s; 2 runs of {counts[-1]} steps with 2 roundings each, doubled; times to 4 roundings",
                unit,
            )
        yield Table(
            _title(self),
            ("t [s]", "largest error [deg]", "amplitude ratio", "energy change [%]"),
            [
                (f"{end:g}", float(np.degrees(error)), ratio, 100 * change)
                for end, (error, ratio, change) in zip(WINDOWS, measured, strict=True)
            ],
        )
        yield _plot(self, t, phi)


FIGURES = (
    FigureScene(
        "figure 2, Euler, h = 6 ms",
        SolverMethod.ExplicitEuler,
        0.006,
        (
            (0.06912118155260055, 1.1547049963439218, 0.32317375619716193),
            (0.1907610036307134, 1.3322168548122464, 0.7434642779444456),
            (0.7379931997074265, 1.7624739137555534, 1.9590174474630424),
        ),
    ),
    FigureScene(
        "figure 3, backward Euler, h = 6 ms",
        SolverMethod.ImplicitEuler,
        0.006,
        (
            (0.06246316474751884, 0.8653662888870629, -0.24681478112333377),
            (0.13354151302756884, 0.7482887101511679, -0.4343857343436649),
            (0.27898488801221644, 0.5589995729559213, -0.6825574870672637),
        ),
    ),
    FigureScene(
        "figure 3, printed linear (28), h = 6 ms",
        None,
        0.006,
        (
            (0.13233080212090223, 0.863284150815801, -0.2503730132320876),
            (0.26126213477705745, 0.7451293997900499, -0.4390911390414449),
            (0.45399090920865404, 0.5553524437836831, -0.6866570750771936),
        ),
    ),
    FigureScene(
        "figure 4, RK2, h = 30 ms",
        SolverMethod.ExplicitMidPoint2,
        0.03,
        (
            (0.010195064342006538, 1.0015199494126619, 0.002972175703124913),
            (0.02103181745116415, 1.0030347899323304, 0.005938432912342639),
            (0.041402791948736, 1.006092361138156, 0.01193793452555858),
        ),
    ),
    FigureScene(
        "figure 5, RK2, h = 75 ms",
        SolverMethod.ExplicitMidPoint2,
        0.075,
        (
            (0.06286787594300688, 1.024003476454536, 0.047414418245658396),
            (0.12559009517051847, 1.0481675978074156, 0.09616990412751636),
            (0.23021203006016533, 1.0986414153568562, 0.20128903595306835),
        ),
    ),
    FigureScene(
        "figure 6, RK2, h = 200 ms",
        SolverMethod.ExplicitMidPoint2,
        0.2,
        (
            (0.45050838493334266, 1.5214856941920996, 1.2458934260489607),
            (0.8140795805400379, 2.205733988160616, 3.448663766756777),
            (2.287515185391389, 3.832415198618071, 9.615314842778451),
        ),
    ),
    FigureScene(
        "figure 7, RK4, h = 30 ms",
        SolverMethod.ExplicitRungeKutta4,
        0.03,
        (
            (4.290761158876055e-06, 0.9999992558326685, -1.454174832882238e-06),
            (8.793700280673722e-06, 0.9999985087407461, -2.9140636114144414e-06),
            (1.7172908795132225e-05, 0.9999970679631989, -5.729477383753512e-06),
        ),
    ),
    FigureScene(
        "figure 8, RK4, h = 75 ms",
        SolverMethod.ExplicitRungeKutta4,
        0.075,
        (
            (0.00016386477057121762, 0.9999281054770405, -0.00014048430835600367),
            (0.0003231701389311281, 0.9998567502106438, -0.0002799058338800453),
            (0.0005794143142743152, 0.9997149077569378, -0.0005570259424808599),
        ),
    ),
    FigureScene(
        "figure 9, RK4, h = 200 ms",
        SolverMethod.ExplicitRungeKutta4,
        0.2,
        (
            (0.00812729960178965, 0.9908104219305729, -0.017882431515303332),
            (0.014325061322221166, 0.9816996490516596, -0.03546336778520187),
            (0.022138105105530714, 0.9638749943854382, -0.06943124348382168),
        ),
    ),
)


@dataclass(frozen=True)
class TableScene(Scene):
    """The tables of the elliptic integral."""

    TITLE = "tables of the elliptic integral"

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the table."""
        yield _table()


SCENES = (
    *(IntegralScene(amplitude, lengths) for amplitude, lengths in SERIES_LENGTHS.items()),
    *(IntegralScene(amplitude) for amplitude in (179.9, 179.99, 179.999)),
    TableScene(),
    DescentScene(pi / 6, 0.5, 3),
    DescentScene(1.0, 0.5, 3),
    DescentScene(1.0, 0.9, 4),
    DescentScene(0.5, 0.99, 4),
    DescentScene(1.0, 0.99, 4),
    DescentScene(1.5, 0.999, 5),
    DescentScene(1.57, 0.999999, 6),
    *(SinusoidScene(*row) for row in SINUSOID),
    *FIGURES,
)


def _table() -> Table:
    rows = []
    for amplitude in (*SERIES_LENGTHS, 179.9, 179.99, 179.999):
        angle = radians(amplitude)
        k, exact = sin(angle / 2), references.period(angle, 1.0) / 4
        values = [references.complete_by_agm(k), references.incomplete_by_descent(pi / 2, k)]
        values += [references.period_by_series(angle, 1.0, count) / 4 for count in (5, 20, 100, 1000)]
        rows.append((f"{amplitude:g}", f"{exact:.15g}", *(f"{value / exact - 1:.1e}" for value in values)))
    return Table(
        "Relative errors of K(k), k = sin(alpha/2)",
        ("alpha [deg]", "K", "AGM (20)", "descent", "(17), 5 terms", "20 terms", "100 terms", "1000 terms"),
        rows,
        "Near 180 deg (18)-(20) lose digits with the rounding of k; AGM(1, cos(alpha/2)), the column K, does not.",
    )


def _simulate(fmu: Fmu, scene: FigureScene) -> tuple[Array, Array, Array]:
    start = {
        "gamma": 0.0,
        "g": FIGURE_G,
        "phi_start": FIGURE_ANGLE,
        "solver.method": scene.method or 0,
        "solver.stepSize": scene.step,
    }
    stop = scene.step * round(WINDOWS[-1] / scene.step)
    run = fmu.run(Experiment(stop, scene.step, start, record=("phi", "E")))
    return run.t, run["phi"], run["E"]


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


def _plot(scene: FigureScene, t: Array, phi: Array) -> Plot:
    shown = t <= WINDOWS[1] + scene.step / 2
    times = np.linspace(0, WINDOWS[1], 501)
    exact = references.libration(times, FIGURE_ANGLE, FIGURE_G)[0]
    computed = Curve(
        "formula (28)" if scene.method is None else "FMU",
        t[shown].tolist(),
        np.degrees(phi[shown]).tolist(),
        *(("--", "") if scene.step < 0.01 else ("", ".")),
    )
    return Plot(
        _title(scene),
        "t [s]",
        "phi [deg]",
        [Curve("exact", times.tolist(), np.degrees(exact).tolist()), computed],
    )


def _title(scene: FigureScene) -> str:
    return scene.name[0].upper() + scene.name[1:]
