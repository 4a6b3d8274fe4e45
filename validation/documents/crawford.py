"""Errata of J. A. Crawford, "Pendulums and Elliptic Integrals"."""

from __future__ import annotations

from functools import partial
from math import asin, cos, log, nan, pi, radians, sin, sqrt

import numpy as np
from scipy.special import ellipk

from .. import references
from ..fmu import RK4, W02, Experiment, Fmu, Run, SolverMethod, swing
from ..metrics import NEXT, SMALL, UNIT, walk
from .erratum import Document, Erratum, Measured, Number

G81 = 9.81  # gravity acceleration [m/s2] of the document
ALPHA = radians(30)  # its starting angle
FINE = 5e-4  # [s]: RK4 is then in error by less than 1e-11 rad within 10 s of a moderate swing
# Round-off [1/s2] of the energy per m*L^2 in 4 s: w*w and g*sin(phi)*phi are below 2*g*(1 - cos(alpha)), times those of
# a substep; and four of the terms, below g.
ENERGY = 2 * G81 * (1 - cos(ALPHA)) * sqrt(2) * walk(4 / FINE) + 4 * UNIT * G81


def _swing(
    fmu: Fmu, stop: float, step: float = 0.05, method: int = RK4, h: float = FINE, **changes: float
) -> Run:
    start = swing(ALPHA, h, method) | {"g": G81} | changes
    return fmu.run(Experiment(stop, step, start, record=("phi", "w", "E")))


def _angle_at_1(fmu: Fmu, g: float) -> float:
    """Return the angle [rad] at 1 s from 30 deg; printed (3) is the FMU with g = -9.81 m/s2."""
    return float(_swing(fmu, 1.0, g=g)["phi"][-1])


def _small_growth(fmu: Fmu, g: float) -> float:
    """Return phi(1 s)/phi(0) of small motions from rest; printed (4) is the FMU with g = -9.81 m/s2."""
    phi = _swing(fmu, 1.0, g=g, phi_start=SMALL)["phi"]
    return float(phi[-1] / phi[0])


def _spread_of_6(fmu: Fmu, sign: float) -> float:
    """Return how far w^2/2 + sign*w0^2*cos(phi) varies along the motion [1/s2]."""
    quarter = references.period(ALPHA, G81) / 4  # the extremes are at the turning and the lowest points
    run = _swing(fmu, 2 * quarter, quarter)
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


def _swings(fmu: Fmu, method: SolverMethod, h: float) -> float:
    """Return the logarithm of the growth of the amplitude that a method makes in four swings."""
    run = _swing(fmu, 10.0, 0.03, method=method, h=h)
    tops = np.flatnonzero((run["w"][:-1] > 0) & (run["w"][1:] <= 0))
    return log(2 * asin(sqrt(float(run["E"][tops[3]]) / (2 * G81))) / ALPHA) if len(tops) > 3 else nan


def _ratio_of_steps(fmu: Fmu, method: SolverMethod) -> float:
    """Return the growth with h = 6 ms over that with 3 ms."""
    return _swings(fmu, method, 0.006) / _swings(fmu, method, 0.003)


def _growth_in_swings(method: SolverMethod, growth: str, ratio: str) -> tuple[Number, ...]:
    """Return the numbers that show that the growth is truncation error."""
    return (
        Measured(
            "logarithm of the growth in 4 swings, h = 6 ms", growth, partial(_swings, method=method, h=0.006)
        ),
        Measured(
            "the same over that with h = 3 ms, rounding would not shrink with h",
            ratio,
            partial(_ratio_of_steps, method=method),
        ),
    )


def _amplitude_ratio(fmu: Fmu) -> float:
    """Return the amplitude of RK2 with h = 75 ms after 133 steps, 9.975 s, over alpha."""
    stop = 133 * 0.075
    run = _swing(fmu, stop, stop, method=SolverMethod.ExplicitMidPoint2, h=0.075)
    return 2 * asin(sqrt(float(run["E"][-1]) / (2 * G81))) / ALPHA


def _implicit_order(fmu: Fmu) -> float:
    errors = []
    for h in (0.00125, 0.000625):
        run = _swing(fmu, 2.0, 0.05, method=SolverMethod.ImplicitEuler, h=h)
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
    run = _swing(fmu, stop, stop, g=g, method=method, h=h)
    return float(run["E"][-1] / run["E"][0] - 1)


def _escape(fmu: Fmu, stop: float) -> float:
    """Return the angle [rad] at `stop` [s] of RK2 with h = 200 ms."""
    return float(_swing(fmu, stop, 0.2, method=SolverMethod.ExplicitMidPoint2, h=0.2)["phi"][-1])


def _rk4_error(fmu: Fmu) -> float:
    """Return the largest error over 10 s of RK4 with h = 200 ms, relative to alpha."""
    run = _swing(fmu, 10.0, 0.2, method=SolverMethod.ExplicitRungeKutta4, h=0.2)
    return float(np.max(np.abs(run["phi"] - references.libration(run.t, ALPHA, G81)[0]))) / ALPHA


CRAWFORD = Document(
    "Crawford, Pendulums and Elliptic Integrals",
    (
        Erratum(
            "(3)",
            "phi'' - (g/R)*sin(phi) = 0",
            "phi'' + (g/R)*sin(phi) = 0, as (23) has it; the printed angle counts from the upright position",
            (
                Measured(
                    "phi(1 s) of the FMU",
                    "-0.522568927075219",
                    partial(_angle_at_1, g=G81),
                    "rad",
                    1e-13,
                    "RK4 at h = 0.5 ms: alpha*w0*t*(h*w0)^4/120 = 8e-14 at 1 s, its loss of energy below rounding",
                ),
                Measured(
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
                Measured(
                    "phi(1 s)/phi(0) of the FMU from 1e-9 rad, cos(w0*t)",
                    "-0.9999548687",
                    partial(_small_growth, g=G81),
                ),
                Measured(
                    "as printed, the FMU with g < 0, cosh(w0*t)",
                    "11.4827536743",
                    partial(_small_growth, g=-G81),
                ),
            ),
        ),
        Erratum("before (6)", "multiplying by d(theta)/dt", "d(phi)/dt; theta appears only after (11)"),
        Erratum(
            "(6)",
            "phi''*phi' = +w0^2*sin(phi)*phi'",
            "phi''*phi' = -w0^2*sin(phi)*phi'; (7) is right, but does not follow from (6) as printed",
            (
                Measured(
                    "variation of w^2/2 + w0^2*cos(phi) along the FMU's motion",
                    f"{2 * G81 * (1 - cos(ALPHA)):.15f}",
                    partial(_spread_of_6, sign=1.0),
                    "1/s2",
                    ENERGY,
                    "2*w0^2*(1 - cos(alpha)); round-off of the energy in 4 s, RK4's loss is smaller",
                ),
                Measured(
                    "variation of w^2/2 - w0^2*cos(phi)",
                    "0",
                    partial(_spread_of_6, sign=-1.0),
                    "1/s2",
                    ENERGY,
                    "round-off of the energy in 4 s, RK4's loss is smaller",
                ),
                Measured(
                    "its value k",
                    "-8.4957092111253431",
                    _constant_of_7,
                    "1/s2",
                    ENERGY,
                    "round-off of the energy in 4 s, RK4's loss is smaller",
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
                        sqrt(2 * 4 * UNIT) / (pi / 2),
                        "exact there, but the arcsine near 1 turns four roundings of the sine into sqrt(8*2^-53)",
                    ),
                )
            ),
        ),
        Erratum(
            "section 1",
            "Simpson's rule or Gaussian quadrature make the integral very difficult",
            "near 180 deg only: 16 points of Gauss are exact to rounding at 90 deg, 32 at 150 deg (study of the "
            "memorandum, simple rules)",
        ),
        Erratum(
            "footnote 2",
            "Gauss's transformation (18) is also referred to as Landen's",
            "Landen's is another: factor (1 + k1)/2, tan(phi1 - phi) = k'*tan(phi); the descents of k are the same",
        ),
        Erratum("section 4, title", '"Comparison or Linearized Model Results"', "of Linearized"),
        Erratum(
            "section 4, last paragraph",
            "implicit and higher-order methods ask for the linear equation",
            "section 5.3 uses two of higher order on the nonlinear one",
        ),
        Erratum(
            "section 4, second paragraph",
            "very closely approximated by a sinusoid for a very large range",
            "the deviation relative to alpha is 0.2 % at 30 deg, 2.3 % at 90 deg, 19 % at 170 deg",
            tuple(
                Measured(
                    f"largest deviation at {amplitude} deg",
                    expected,
                    partial(_sinusoid_error, amplitude=amplitude),
                )
                for amplitude, expected in (
                    (30, "0.0022348510"),
                    (90, "0.0232888021"),
                    (170, "0.1894564777"),
                )
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
                    bound=NEXT * 0.005 * sqrt(G81),
                    reason=f"theory; {NEXT:g} x h*w0, the next term of the error relative to the first",
                ),
            ),
        ),
        Erratum(
            "section 5.1",
            "due to numerical imprecision the amplitude slowly grows",
            "it is truncation error, a factor exp(pi*h*w0) a period for small swings: +74 % energy in 10 s",
            _growth_in_swings(SolverMethod.ExplicitEuler, "0.23499082279", "2.0011907111"),
        ),
        Erratum(
            "section 5.2",
            "the numerical imprecision leads to a decay",
            "it is truncation error again, a factor exp(-pi*h*w0) a period for small swings",
            _growth_in_swings(SolverMethod.ImplicitEuler, "-0.23546528291", "2.0033788679"),
        ),
        Erratum(
            "section 5.2, the method",
            "backward Euler is not possible unless the equation is linearized",
            "x + s*sin(x) = c has one root for h < 0.319 s; the period of the linear (28) is 1.7 % short",
            (
                Measured(
                    "order of the FMU's ImplicitEuler between 1.25 and 0.625 ms",
                    "0.99621539",
                    _implicit_order,
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
                Measured(
                    "energy gain of RK2 in 10 s, h = 1 ms, g = 9.80665",
                    "2.257739e-7",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.001),
                ),
                Measured(
                    "energy gain of RK2 in 10 s, h = 10 ms",
                    "2.1990703760e-4",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.01),
                ),
                Measured(
                    "energy gain of RK2 in 10 s, h = 200 ms, g = 9.81",
                    "3.44866376676",
                    partial(_energy_gain, method=SolverMethod.ExplicitMidPoint2, h=0.2, g=G81),
                ),
                Measured("phi(40 s), h = 200 ms", "-56.0463340", partial(_escape, stop=40.0), "rad"),
                Measured("phi(100 s), h = 200 ms", "-1138.67191", partial(_escape, stop=100.0), "rad"),
            ),
        ),
        Erratum(
            "section 5.3.1, figure 5",
            "follows the exact solution very closely at 75 ms",
            "the error is 7.2 deg, 24 % of alpha, in 10 s, and the amplitude grows by 4.8 %",
            (Measured("amplitude after 9.975 s over alpha", "1.04816759781", _amplitude_ratio),),
        ),
        Erratum(
            "section 5.3.2",
            "RK4 matches almost exactly even at 200 ms",
            "2.7 % of alpha and 3.5 % of the energy are lost in 10 s",
            (
                Measured("largest error of RK4 in 10 s, relative to alpha", "0.02735885183", _rk4_error),
                Measured(
                    "energy change",
                    "-0.03546336779",
                    partial(_energy_gain, method=SolverMethod.ExplicitRungeKutta4, h=0.2, g=G81),
                ),
            ),
        ),
    ),
)
