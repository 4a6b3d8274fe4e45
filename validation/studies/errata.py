"""What is wrong or ambiguous in the two documents: what they print, what is right, and the numbers that show it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from math import asin, cos, exp, log, pi, radians, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.special import ellipk

from .. import references
from ..checks import Check, Curve, Plot, Result, Table
from ..fmu import W0, W02, Experiment, Fmu, Run, SolverMethod
from .scene import Scene

TITLE = "Errata of the two documents"
FORMULA = "phi'' + (gamma/m)*phi' + (g/L)*sin(phi) = tau/(m*L^2), linear: phi'' + k2*phi' + w02*phi = drive"

Array = NDArray[np.float64]
G81 = 9.81  # gravity acceleration [m/s2] of Crawford's document
ALPHA = radians(30)  # its starting angle
K2 = 0.002  # damping rate [1/s] of Grillo's document
AREA = 1 / sqrt(2 * pi)  # height of its Gaussian pulse, of unit variance about t = 0
ROUNDING = 1.1e-16
SMALL = 1e-9  # amplitude [rad] of linear motion: the nonlinearity is below rounding
FINE = 5e-4  # [s]: RK4 is then in error by less than 1e-11 rad within 10 s of a moderate swing


@dataclass(frozen=True)
class Number:
    """A number that shows a mistake: what it is, its digits, and how the program finds it.

    `expected` comes from 40-digit arithmetic, and its last digit is the bound. Where the digits do not bound the
    difference, `bound` and `reason` do.
    """

    name: str
    expected: str
    compute: Callable[[Fmu], float]
    unit: str = ""
    bound: float = 0.0
    reason: str = ""

    def check(self, value: float) -> Check:
        """Return the row that holds `value` against the expected digits."""
        exponent = Decimal(self.expected).as_tuple().exponent
        unit_in_last_place = float(Decimal(1).scaleb(int(exponent)))
        return Check(
            f"{self.name} = {self.expected}",
            abs(value - float(self.expected)),
            self.bound or max(unit_in_last_place, 4 * ROUNDING * abs(float(self.expected))),
            self.reason or "a unit of the last digit, or four roundings",
            self.unit,
        )


@dataclass(frozen=True)
class Erratum:
    """A mistake: where it stands, what is printed, what is right, and the numbers that show it."""

    where: str
    printed: str
    right: str
    numbers: Sequence[Number] = ()


@dataclass(frozen=True)
class Document(Scene):
    """The errata of a document, and a picture of what they do, if there is one."""

    TITLE = "{0.title}"

    title: str
    errata: Sequence[Erratum]
    picture: Callable[[], Plot] | None = None

    def run(self, fmu: Fmu) -> Iterator[Result]:
        """Yield the rows of a document and the table of its errata."""
        rows = []
        for erratum in self.errata:
            values = [number.compute(fmu) for number in erratum.numbers]
            for number, value in zip(erratum.numbers, values, strict=True):
                check = number.check(value)
                yield Check(f"{erratum.where}: {check.name}", *_rest(check))
            shown = "; ".join(
                f"{number.name}: {value:.{_digits(number)}g} {number.unit}".strip()
                for number, value in zip(erratum.numbers, values, strict=True)
            )
            rows.append((erratum.where, erratum.printed, erratum.right, shown))
        yield Table(self.name, ("where", "printed", "right", "what shows it, computed for this report"), rows)
        if self.picture is not None:
            yield self.picture()


def _rest(check: Check) -> tuple[float, float, str, str]:
    return check.measured, check.bound, check.reason, check.unit


def _digits(number: Number) -> int:
    return min(12, max(2, len(Decimal(number.expected).as_tuple().digits)))


# Crawford's document


def _swing(fmu: Fmu, stop: float, step: float = 0.05, **changes: float) -> Run:
    start = {"gamma": 0.0, "g": G81, "phi_start": ALPHA, "solver.stepSize": FINE}
    start |= {
        name.replace("_", ".", 1) if name.startswith("solver") else name: x for name, x in changes.items()
    }
    return fmu.run(Experiment(stop, step, start, record=("phi", "w", "E")))


def _angle_at_1(fmu: Fmu, g: float) -> float:
    """Return the angle [rad] at 1 s from 30 deg; printed (3) is the FMU with g = -9.81 m/s2."""
    return float(_swing(fmu, 1.0, g=g)["phi"][-1])


def _residual_of_4(_: Fmu) -> float:
    """Return what A*sin(w0*t) leaves of printed (4) at w0*t = pi/2, per A*w0^2."""
    second_derivative = -1.0
    return second_derivative - 1.0


def _spread_of_6(fmu: Fmu, sign: float) -> float:
    """Return how far w^2/2 + sign*w0^2*cos(phi) varies along the motion [1/s2]."""
    run = _swing(fmu, 4.0, 0.01)
    return float(np.ptp(run["w"] ** 2 / 2 + sign * G81 * np.cos(run["phi"])))


def _constant_of_7(fmu: Fmu) -> float:
    run = _swing(fmu, 4.0)
    return float(np.mean(run["w"] ** 2 / 2 - G81 * np.cos(run["phi"])))


def _limit_of_descent(angle: float, k: float) -> float:
    """Return the limit of phi_p in (18): F over the product of the factors, which is K/(pi/2)."""
    return references.incomplete_by_descent(angle, k) / references.incomplete_by_descent(pi / 2, k) * pi / 2


def printed_descent(angle: float, k: float) -> float:
    """Return F(angle, k) by (18) with (19) as printed, whose root does not cover the sine.

    As k falls to zero the printed map becomes sin(angle1) = 2*sin(angle)/(1 + sin(angle)^2), which sends every angle to
    pi/2. So the recursion forgets its angle and ends at K(k), and the document's limit pi/2 is that of its misprint.
    """
    factor = 1.0
    for _ in range(16):
        k1 = sqrt((1 - k) * (1 + k))
        sine = (1 + k1) * sin(angle) / (1 + k1 * sin(angle) ** 2)
        angle = asin(min(sine, 1.0))
        k = (k / (1 + k1)) ** 2
        factor *= 1 + k
    return factor * angle


def _error_of_19(angle: float, k: float, _: Fmu) -> float:
    return printed_descent(angle, k) / references.incomplete(angle, (1 - k) * (1 + k)) - 1


def _sinusoid_error(fmu: Fmu, amplitude: float) -> float:
    """Return the largest deviation of a sinusoid with the exact period, relative to the amplitude [deg]."""
    angle = radians(amplitude)
    T = references.period(angle, W02)
    run = fmu.run(Experiment(T, T / 400, {"gamma": 0.0, "phi_start": angle}))
    return float(np.max(np.abs(run["phi"] - angle * np.cos(2 * pi * run.t / T)))) / angle


def _bdf2_order(_: Fmu) -> float:
    """Return the order of BDF2 with Newton's method on the nonlinear equation, between 5 and 2.5 ms over 2 s."""
    errors = []
    for h in (0.005, 0.0025):
        phi, w = _bdf2(h, round(2.0 / h))
        exact, rate = references.libration(2.0, ALPHA, G81)
        errors.append(float(np.hypot(phi - exact, (w - rate) / sqrt(G81))))
    return log(errors[0] / errors[1]) / log(2)


def _bdf2(h: float, n: int) -> tuple[float, float]:
    """Return the state after n steps of BDF2 from 30 deg, started on the exact solution."""
    phi, w = (float(x) for x in references.libration(h, ALPHA, G81))
    before = (ALPHA, 0.0)
    b = 2 * h / 3
    for _ in range(n - 1):
        phi_known, w_known = ((4 * now - old) / 3 for now, old in zip((phi, w), before, strict=True))
        before = (phi, w)
        x = phi + h * w
        for _ in range(6):
            x -= (x - phi_known - b * (w_known - b * G81 * sin(x))) / (1 + b * b * G81 * cos(x))
        phi, w = x, w_known - b * G81 * sin(x)
    return phi, w


def _euler_growth(fmu: Fmu, h: float) -> float:
    """Return the logarithm of the growth of the amplitude that Euler's method makes in four swings."""
    run = _swing(fmu, 10.0, 0.03, solver_method=SolverMethod.ExplicitEuler, solver_stepSize=h)
    tops = np.flatnonzero((run["w"][:-1] > 0) & (run["w"][1:] <= 0))
    return log(2 * asin(sqrt(float(run["E"][tops[3]]) / (2 * G81))) / ALPHA)


def _implicit_order(fmu: Fmu) -> float:
    errors = []
    for h in (0.00125, 0.000625):
        run = _swing(fmu, 2.0, 0.05, solver_method=SolverMethod.ImplicitEuler, solver_stepSize=h)
        errors.append(float(np.max(np.abs(run["phi"] - references.libration(run.t, ALPHA, G81)[0]))))
    return log(errors[0] / errors[1]) / log(2)


def _literal_30(fmu: Fmu) -> float:
    """Return phi(1) [rad] of (29) with x = U1 and y = U2, as (30) assigns f and g, for h = 10 ms."""
    del fmu  # a formula of the document
    x, h = ALPHA, 0.01
    for _ in range(100):
        x -= h * G81 * sin(x - h / 2 * G81 * sin(x))
    return x


def _energy_gain(fmu: Fmu, method: int, h: float, stop: float = 10.0, g: float = W02) -> float:
    """Return the relative change of the energy of a swing from 30 deg until `stop` [s]."""
    run = _swing(fmu, stop, h, g=g, solver_method=method, solver_stepSize=h)
    return float(run["E"][-1] / run["E"][0] - 1)


def _escape(fmu: Fmu, stop: float) -> float:
    """Return the angle [rad] at `stop` [s] of RK2 with h = 200 ms."""
    return float(
        _swing(fmu, stop, 0.2, solver_method=SolverMethod.ExplicitMidPoint2, solver_stepSize=0.2)["phi"][-1]
    )


def _rk4_error(fmu: Fmu) -> float:
    """Return the largest error over 10 s of RK4 with h = 200 ms, relative to alpha."""
    run = _swing(fmu, 10.0, 0.2, solver_method=SolverMethod.ExplicitRungeKutta4, solver_stepSize=0.2)
    return float(np.max(np.abs(run["phi"] - references.libration(run.t, ALPHA, G81)[0]))) / ALPHA


CRAWFORD = Document(
    "Crawford, Pendulums and Elliptic Integrals",
    (
        Erratum(
            "(3)",
            "phi'' - (g/R)*sin(phi) = 0",
            "phi'' + (g/R)*sin(phi) = 0, as (23) has it; the printed angle counts from the upright position",
            (
                Number(
                    "phi(1 s) of the FMU",
                    "-0.522568927075219",
                    partial(_angle_at_1, g=G81),
                    "rad",
                    1e-11,
                    "RK4 at h = 0.5 ms, (h*w0)^4 = 6e-12",
                ),
                Number(
                    "phi(1 s) as printed, the FMU with g < 0",
                    "3.82977973783",
                    partial(_angle_at_1, g=-G81),
                    "rad",
                ),
            ),
        ),
        Erratum(
            "(4)",
            "phi'' - (g/R)*phi = 0, solved by A*sin(w0*t)",
            "phi'' + (g/R)*phi = 0; the printed equation has the solutions exp(w0*t) and exp(-w0*t)",
            (
                Number(
                    "residual of A*sin(w0*t) at its peak, per A*w0^2",
                    "-2",
                    _residual_of_4,
                    bound=1e-15,
                    reason="an integer",
                ),
            ),
        ),
        Erratum("before (6)", "multiplying by d(theta)/dt", "d(phi)/dt; theta appears only after (11)"),
        Erratum(
            "(6)",
            "phi''*phi' = +w0^2*sin(phi)*phi'",
            "phi''*phi' = -w0^2*sin(phi)*phi'; (7) is right, but does not follow from (6) as printed",
            (
                Number(
                    "variation of w^2/2 + w0^2*cos(phi) along the FMU's motion",
                    f"{2 * G81 * (1 - cos(ALPHA)):.6f}",
                    partial(_spread_of_6, sign=1.0),
                    "1/s2",
                    1e-3,
                    "2*w0^2*(1 - cos(alpha)); samples every 10 ms miss the extremes by a relative (w0*H)^2/8 = 1.2e-4",
                ),
                Number(
                    "variation of w^2/2 - w0^2*cos(phi)",
                    "0",
                    partial(_spread_of_6, sign=-1.0),
                    "1/s2",
                    1e-11,
                    "RK4 at h = 0.5 ms, (h*w0)^4 = 6e-12",
                ),
                Number(
                    "its value k",
                    "-8.4957092111253431",
                    _constant_of_7,
                    "1/s2",
                    1e-11,
                    "RK4 at h = 0.5 ms, (h*w0)^4 = 6e-12",
                ),
            ),
        ),
        Erratum(
            "(7), (11), (29)",
            "k, k_1",
            "three meanings: constant of integration, modulus, stages of Runge-Kutta; g is gravity and a slope",
        ),
        Erratum(
            "after (14)",
            "k = sin(alpha/2) is always < sqrt(2)/2",
            "only for alpha < 90 deg; k tends to 1 as alpha tends to 180 deg",
            (
                Number("k at 91 deg", "0.71325", lambda _: sin(radians(91) / 2)),
                Number("k at 179 deg", "0.99996192", lambda _: sin(radians(179) / 2)),
                Number(
                    "1 - k at 179.9999 deg",
                    "3.8077e-13",
                    lambda _: 2 * sin((pi - radians(179.9999)) / 4) ** 2,
                ),
            ),
        ),
        Erratum(
            "(16), (18), (20)",
            "F(k, x), F(phi, k), F(pi/2, k)",
            "one order of the arguments; SciPy's ellipk takes m = k^2",
            (
                Number(
                    "K at 90 deg with k in place of m, relative error",
                    "0.125075",
                    lambda _: float(ellipk(sqrt(0.5)) / ellipk(0.5) - 1),
                ),
            ),
        ),
        Erratum(
            "after (18)",
            "lim F(phi_p, k_p) = pi/2",
            "F(phi, k) = lim phi_p*prod(1 + k_i); the limit of phi_p is pi/2 for phi = pi/2, and with misprinted (19)",
            (
                Number(
                    "limit for phi = 30 deg, k = 0.5",
                    "0.4933260375",
                    lambda _: _limit_of_descent(pi / 6, 0.5),
                ),
                Number("limit for phi = 1, k = 0.9", "0.7987511953", lambda _: _limit_of_descent(1.0, 0.9)),
            ),
        ),
        Erratum(
            "(19)",
            "(1 + k')*sin(phi)/(1 + sqrt(1 - k^2)*sin^2(phi))",
            "(1 + k')*sin(phi)/(1 + sqrt(1 - k^2*sin^2(phi))); as printed it yields K(k) for every phi",
            tuple(
                Number(
                    f"relative error of printed F({angle:.4g}, {k:g})",
                    expected,
                    partial(_error_of_19, angle, k),
                    bound=bound,
                    reason=reason,
                )
                for angle, k, expected, bound, reason in (
                    (pi / 6, 0.5, "2.18", 0.0, ""),
                    (1.0, 0.9, "0.967", 0.0, ""),
                    (0.5, 0.99, "5.43", 0.0, ""),
                    (1.2, 0.3, "0.318", 0.0, ""),
                    (0.1, 0.9, "21.8", 0.0, ""),
                    (
                        pi / 2,
                        0.9,
                        "0",
                        1e-7,
                        "exact there, but the arcsine near 1 turns a rounding into its root",
                    ),
                )
            ),
        ),
        Erratum(
            "section 4",
            "very closely approximated by a sinusoid for a very large range",
            "the deviation relative to alpha is 0.2 % at 30 deg, 2.3 % at 90 deg, 19 % at 170 deg",
            tuple(
                Number(
                    f"largest deviation at {amplitude} deg",
                    expected,
                    partial(_sinusoid_error, amplitude=amplitude),
                )
                for amplitude, expected in ((30, "0.0022"), (90, "0.023"), (170, "0.19"))
            ),
        ),
        Erratum(
            "section 4",
            "the second-order Gear method is not possible with the nonlinear equation",
            "it is, with Newton's method for the new angle",
            (
                Number(
                    "order of BDF2 on the nonlinear equation",
                    "2",
                    _bdf2_order,
                    bound=0.05,
                    reason="theory; relative h*w0 = 0.016",
                ),
            ),
        ),
        Erratum(
            "section 5.1",
            "due to numerical imprecision the amplitude slowly grows",
            "it is truncation error, a factor exp(pi*h*w0) a period for small swings: +74 % energy in 10 s",
            (
                Number(
                    "growth in 4 swings, h = 6 ms",
                    f"{log(37.9542 / 30):.5f}",
                    partial(_euler_growth, h=0.006),
                    bound=0.0015,
                    reason="energy balance over the orbit, first order in h; 4*(h*w0)^2 is left out",
                ),
                Number(
                    "the same over that with h = 3 ms",
                    "2",
                    lambda fmu: _euler_growth(fmu, 0.006) / _euler_growth(fmu, 0.003),
                    bound=0.04,
                    reason="proportional to h, next term h*w0 = 0.019 of it; rounding would not shrink with h",
                ),
            ),
        ),
        Erratum(
            "section 5.2",
            "backward Euler is not possible unless the equation is linearized",
            "x + s*sin(x) = c has one root for h < 0.319 s; the period of the linear (28) is 1.7 % short",
            (
                Number(
                    "order of the FMU's ImplicitEuler",
                    "1",
                    _implicit_order,
                    bound=0.05,
                    reason="theory; relative pi*h*w0 = 0.012",
                ),
                Number("period of (28) [s]", "2.00607", lambda _: 2 * pi / sqrt(G81), "s"),
                Number("period of the pendulum [s]", "2.04099", lambda _: references.period(ALPHA, G81), "s"),
            ),
        ),
        Erratum(
            "(29)-(30)",
            "f = dU2/dt, g = dU1/dt with x, y of (29) in the order U1, U2",
            "x = U2 and y = U1, as (31) has it",
            (Number("phi(1 s) with x = U1, y = U2, h = 10 ms", "2.99e-5", _literal_30, "rad"),),
        ),
        Erratum(
            "section 5.3.1",
            "very close until, at 200 ms, the onset of some instability is apparent",
            "without damping no step is stable: |R|^2 = 1 + (h*w0)^4/4; at 200 ms it leaves the well at 30 s and spins",
            (
                Number(
                    "energy gain of RK2 in 10 s, h = 1 ms, g = 9.80665",
                    "2.258e-7",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.001),
                ),
                Number(
                    "energy gain of RK2 in 10 s, h = 10 ms",
                    "2.199e-4",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.01),
                ),
                Number(
                    "energy gain of RK2 in 10 s, h = 200 ms, g = 9.81",
                    "3.45",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.2, g=G81),
                ),
                Number("phi(40 s), h = 200 ms", "-56", partial(_escape, stop=40.0), "rad"),
                Number("phi(100 s), h = 200 ms", "-1139", partial(_escape, stop=100.0), "rad"),
            ),
        ),
        Erratum(
            "section 5.3.2",
            "RK4 matches almost exactly even at 200 ms",
            "2.7 % of alpha and 3.5 % of the energy are lost in 10 s",
            (
                Number("largest error of RK4 in 10 s, relative to alpha", "0.0274", _rk4_error),
                Number(
                    "energy change",
                    "-0.0355",
                    partial(_energy_gain, method=SolverMethod.ExplicitRungeKutta4, h=0.2, g=G81),
                ),
            ),
        ),
    ),
)


# Grillo's document

NABLA = 4 * W02 - K2 * K2
PRINTED_NABLA = 4 * W02 - K2


def _energy_time(fmu: Fmu) -> float:
    """Return the time [s] in which the energy of the FMU falls by the factor e, from its decay over 100 s."""
    E = fmu.run(Experiment(100.0, 0.5, {"phi_start": SMALL}, record=("E",)))["E"]
    return -100.0 / log(float(E[-1] / E[0]))


def _decibels(coefficients: Sequence[complex], w: float) -> float:
    """Return the modulus [dB] that signal.bode gives for one over a polynomial in s."""
    return float(signal.bode(signal.TransferFunction([1], coefficients), w=[w])[1][0])


PRINTED_SYSTEM = (-1, 1j * K2, W02)
SYSTEM = (1, K2, W02)


def _printed_phase(_: Fmu) -> float:
    return float(signal.bode(signal.TransferFunction([1], PRINTED_SYSTEM), w=[W0])[2][0])


def _default_peak(_: Fmu) -> float:
    """Return the peak [dB] of the right system on the grid that signal.bode chooses."""
    return float(np.max(signal.bode(signal.TransferFunction([1], SYSTEM))[1]))


def _misprinted_impulse(fmu: Fmu) -> float:
    """Return the largest difference [s] over 200 s between the FMU's impulse response and that with printed nabla."""
    run = fmu.run(Experiment(200.0, 0.05, {"phi_start": 0.0, "w_start": SMALL * W0}))
    a = sqrt(PRINTED_NABLA) / 2
    printed = np.exp(-K2 / 2 * run.t) * np.sin(a * run.t) / a
    return float(np.max(np.abs(run["phi"] / (SMALL * W0) - printed)))


def _slip(_: Fmu) -> float:
    """Return the slip of the phase [rad] in 200 s with printed nabla."""
    return (sqrt(NABLA) - sqrt(PRINTED_NABLA)) / 2 * 200.0


def _residual(root: complex) -> float:
    return abs(root * root + K2 * root + W02)


def _envelope(fmu: Fmu) -> float:
    """Return the factor by which the FMU's amplitude changes in 10 s, from its energy."""
    E = fmu.run(Experiment(10.0, 0.5, {"phi_start": SMALL}, record=("E",)))["E"]
    return sqrt(float(E[-1] / E[0]))


def _prefactor(t: float) -> float:
    """Return the printed factor in front of the completed square, b = 0, c = 1."""
    return exp(-((t - K2 / 2) ** 2) / 2 - t / 2)


def _right_prefactor(t: float) -> float:
    return exp(-K2 / 2 * t + K2 * K2 / 8)


def _constant_I(nabla: float) -> float:
    """Return the integral of exp(-x^2)*cos(beta*sqrt(2*c)*x), sqrt(pi)*exp(-beta^2*c/2), c = 1."""
    return sqrt(pi) * exp(-nabla / 8)


def _whole_line(t: float) -> float:
    """Return the convolution over the whole line [rad], with impulses before their cause, all else corrected."""
    return (
        AREA
        * sqrt(8 / NABLA)
        * _right_prefactor(t)
        * sin(sqrt(NABLA) / 2 * (t - K2 / 2))
        * _constant_I(NABLA)
    )


def printed_pulse(t: Array) -> Array:
    """Return the response [rad] to the Gaussian pulse as the document's program has it."""
    beta = sqrt(PRINTED_NABLA) / 2
    shifted = t - K2 / 2
    factor = -sqrt(8 / PRINTED_NABLA) * _constant_I(PRINTED_NABLA)
    return np.asarray(factor * np.exp(-(shifted**2) / 2 - t / 2) * np.sin(beta * shifted))


def _exact_pulse(t: Array) -> Array:
    return references.gaussian_response(t, AREA, 0.0, 1.0, K2, W02)[0]


def _fmu_pulse(fmu: Fmu) -> Run:
    H = 0.01
    return fmu.run(
        Experiment(
            10.0,
            H,
            {"phi_start": 0.0},
            torque=lambda t: SMALL * AREA * exp(-((t + H / 2) ** 2) / 2),
            begin=-9.0,
        )
    )


def _fmu_peak(fmu: Fmu) -> float:
    return float(np.max(_fmu_pulse(fmu)["phi"])) / SMALL


def _fmu_ringing(fmu: Fmu) -> float:
    run = _fmu_pulse(fmu)
    return float(np.max(np.abs(run["phi"][run.t > 5]))) / SMALL


def _peak_of_print(_: Fmu) -> float:
    return float(np.max(printed_pulse(np.linspace(-10, 10, 20001))))


def _time_of_printed_peak(_: Fmu) -> float:
    t = np.linspace(-10, 10, 200001)
    return float(t[np.argmax(printed_pulse(t))])


def _gaussian_plot() -> Plot:
    t = np.linspace(-6, 8, 421)
    return Plot(
        "Response to the Gaussian pulse: printed and right",
        "t [s]",
        "phi [rad]",
        [
            Curve("causal closed form", t.tolist(), _exact_pulse(t).tolist()),
            Curve("as printed", t.tolist(), printed_pulse(t).tolist(), "--"),
            Curve("drive/w02", t.tolist(), (AREA * np.exp(-t * t / 2) / W02).tolist(), ":"),
        ],
    )


GRILLO = Document(
    "Grillo, Exercise: the pendulum",
    (
        Erratum(
            "introduction",
            "gamma = 1/500 s, the reciprocal of the damping time",
            "gamma is in kg/s; the energy decays in m/gamma = 500 s, the amplitude in 2*m/gamma = 1000 s",
            (
                Number(
                    "time in which the energy of the FMU falls by e",
                    "500",
                    _energy_time,
                    "s",
                    500 * 1.1 / (W0 * 100),
                    "the energy wavers by a relative k2/w0 within a swing, over k2*100 s",
                ),
                Number("quality factor w0/k2", "1565.779", lambda _: W0 / K2),
            ),
        ),
        Erratum(
            "angular equation",
            "g/l and L",
            "one length L; gamma/m does not contain it, the angular damping constant is gamma*L^2",
        ),
        Erratum(
            "program of the frequency response",
            "TransferFunction([1], [-1, 1j*K2, W02])",
            "TransferFunction([1], [1, K2, W02]): the polynomials are in s = i*w, and the printed one has no resonance",
            (
                Number("right, at w0", "44.0642", lambda _: _decibels(SYSTEM, W0), "dB"),
                Number("printed, at w0", "-25.8482", lambda _: _decibels(PRINTED_SYSTEM, W0), "dB"),
                Number(
                    "printed, at 0.1 rad/s, its largest value",
                    "-19.839",
                    lambda _: _decibels(PRINTED_SYSTEM, 0.1),
                    "dB",
                ),
                Number("printed phase at w0, right: -90", "0", _printed_phase, "deg", 1e-9, "a real value"),
            ),
        ),
        Erratum(
            "the same program",
            "signal.bode(sys), on its own grid",
            "frequencies given: the default grid steps over the peak",
            (
                Number(
                    "peak of the right system on the default grid, right: 44.064",
                    "28.617",
                    _default_peak,
                    "dB",
                ),
            ),
        ),
        Erratum(
            "impulse response",
            "nabla = 4*w0^2 - k^2, in the program 4*W02 - K2; printed as 39.225",
            "nabla = 4*w0^2 - (k^2)^2, as in the appendix: 39.227",
            (
                Number("right", "39.226596", lambda _: NABLA, "1/s2"),
                Number("printed", "39.2246", lambda _: PRINTED_NABLA, "1/s2"),
                Number(
                    "relative error of the frequency", "-2.544e-5", lambda _: sqrt(PRINTED_NABLA / NABLA) - 1
                ),
                Number("slip of the phase in 200 s", "0.01594", _slip, "rad"),
                Number("largest difference from the FMU in 200 s", "0.00416", _misprinted_impulse, "s"),
            ),
        ),
        Erratum("the same program", "nabra", "nabla; the output shown is not that of the program shown"),
        Erratum(
            "free evolution and appendix",
            "c1*exp(-(-k^2 + sqrt(nabla))*t/2) + ...",
            "c1*exp((-k^2 + i*sqrt(nabla))*t/2) + ...: the i is missing, and a minus too many",
            (
                Number(
                    "printed root in the characteristic polynomial",
                    "19.6133",
                    lambda _: _residual((-K2 + sqrt(NABLA)) / 2),
                    "1/s2",
                ),
                Number(
                    "the right one",
                    "0",
                    lambda _: _residual(complex(-K2, sqrt(NABLA)) / 2),
                    "1/s2",
                    1e-14,
                    "three roundings of w02",
                ),
                Number("printed growth in 10 s", "4.02e13", lambda _: exp(5 * (sqrt(NABLA) + K2))),
                Number(
                    "amplitude of the FMU after 10 s",
                    "0.99005",
                    _envelope,
                    bound=1.1 * K2 / W0 / 2,
                    reason="exp(-0.01); the energy wavers by a relative k2/w0 within a swing",
                ),
                Number(
                    "with the i but the minus, after 500 s, right: 0.6065",
                    "1.6487",
                    lambda _: exp(K2 / 2 * 500),
                ),
            ),
        ),
        Erratum(
            "appendix, inverse transform",
            "FT[exp(eta*t)*theta(t)] = 1/(eta + i*w)",
            "1/(i*w - eta), eta < 0; harmless there, because eta is set to 0",
            (
                Number("real part for eta = -0.3, w = 2", "0.07335", lambda _: (1 / complex(0.3, 2)).real),
                Number("printed", "-0.07335", lambda _: (1 / complex(-0.3, 2)).real),
            ),
        ),
        Erratum(
            "Gaussian pulse, square completion",
            "exp(-(mu - alpha*c)^2/(2*c) - mu/(2*c))",
            "exp(-alpha*mu + alpha^2*c/2)",
            (
                Number("printed at t = 1 s", "0.36825", lambda _: _prefactor(1.0)),
                Number("right", "0.99900", lambda _: _right_prefactor(1.0)),
                Number("printed at t = 10 s, right: 0.99005", "1.3e-24", lambda _: _prefactor(10.0)),
            ),
        ),
        Erratum(
            "Gaussian pulse, first step",
            "the factor A is dropped",
            "A = 1/sqrt(2*pi) stays",
            (Number("factor too large", "2.5066", lambda _: 1 / AREA),),
        ),
        Erratum(
            "Gaussian pulse, lower limit",
            "the integral starts at minus infinity: theta is lost",
            "it starts at 0: causal closed form with the Faddeeva function; this is the largest mistake",
            (
                Number(
                    "whole line at t = 1 s, the rest corrected",
                    "3.1175e-5",
                    lambda _: _whole_line(1.0),
                    "rad",
                ),
                Number("causal at t = 1 s", "0.0233861", lambda _: float(_exact_pulse(np.array(1.0))), "rad"),
                Number("whole line at t = -1 s", "-1.6e-5", lambda _: _whole_line(-1.0), "rad"),
                Number(
                    "causal at t = -1 s", "0.0233415", lambda _: float(_exact_pulse(np.array(-1.0))), "rad"
                ),
                Number("both at t = 10 s", "-2.42397e-4", lambda _: _whole_line(10.0), "rad"),
            ),
        ),
        Erratum(
            "Gaussian pulse, change of variable",
            "sin(beta*sqrt(2*c)*t'' - beta*(mu - alpha*c)), hence a leading minus",
            "+ in the argument, and no minus: t' = sqrt(2*c)*t'' + mu - alpha*c",
            (
                Number(
                    "whole line at t = 1 s with the printed sign",
                    "-3.1175e-5",
                    lambda _: -_whole_line(1.0),
                    "rad",
                ),
            ),
        ),
        Erratum(
            "Gaussian pulse, addition formula",
            "sin(a - b) = sin(a)*cos(b) + cos(a)*sin(b)",
            "- between the terms, as used afterwards",
        ),
        Erratum(
            "Gaussian pulse, constant I",
            "solved numerically, 0.013158201",
            "sqrt(pi)*exp(-beta^2*c/2); the fourth digit is wrong because nabla is",
            (
                Number("with printed nabla", "0.013158201098448524", lambda _: _constant_I(PRINTED_NABLA)),
                Number("with the right one", "0.013154918536791048", lambda _: _constant_I(NABLA)),
            ),
        ),
        Erratum(
            "Gaussian pulse, o_g(t)",
            "-sqrt(8*c/nabla)*exp(...)*sin(beta*(t - b - alpha*c))*I",
            "phi = A/beta*Im(J), J the integral over 0 < s < infinity; it follows the drive, then rings",
            (
                Number("largest printed value", "0.00673", _peak_of_print, "rad"),
                Number("its time", "-0.5005", _time_of_printed_peak, "s"),
                Number(
                    "largest angle of the FMU",
                    "0.047338428",
                    _fmu_peak,
                    "rad",
                    1.5e-6,
                    "H^2/24*max|phi''| + H^2/8*max|phi''| of the sampled peak, |phi''| < 0.09",
                ),
                Number("ringing of the FMU after 5 s", "0.002357", _fmu_ringing, "rad", 1.5e-6, "the same"),
            ),
        ),
        Erratum("Gaussian pulse, plot", 'title "Free Evolution"', "response to the Gaussian pulse"),
        Erratum(
            "appendix",
            "a complex inverse transform is a clear mistake",
            "a form that looks complex can equal the real one",
        ),
    ),
    _gaussian_plot,
)


SCENES = (CRAWFORD, GRILLO)
