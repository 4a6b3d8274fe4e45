"""Errata of G. Grillo, "Exercise: the pendulum"."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, log, nan, pi, sin, sqrt

import numpy as np
from scipy import signal

from .. import references
from ..checks import Curve, Plot
from ..fmu import SUBSTEP, W0, W02, Experiment, Fmu, Run
from ..metrics import SMALL, UNIT, Array, free_rounding
from .erratum import Document, Erratum, Measured, Number

K2 = 0.002  # damping rate [1/s] of the document
AREA = 1 / sqrt(2 * pi)  # height of its Gaussian pulse, of unit variance about t = 0
NABLA = 4 * W02 - K2 * K2
PRINTED_NABLA = 4 * W02 - K2


SWINGS = 48 * 4 * pi / sqrt(NABLA)  # the time [s] of 48 whole swings
# [s]: RK4's own error, and round-off of the energy, twice that of the state, over the logarithm of its fall.
ENERGY_TIME = 1.27e-9 + 500 * 2 * free_rounding(SWINGS, SUBSTEP) / (K2 * SWINGS)


def _energy_time(fmu: Fmu) -> float:
    """Return the time [s] in which the energy of the FMU falls by the factor e, from its decay over whole swings.

    The energy wavers within a swing; after a whole one the state is that of before, scaled.
    """
    E = fmu.run(Experiment(SWINGS, SWINGS, {"phi_start": SMALL}, record=("E",)))["E"]
    loss = -log(float(E[-1] / E[0]))
    return SWINGS / loss if loss else nan


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
    """Return the factor by which the FMU's amplitude changes in 10 s."""
    return exp(-5.0 / _energy_time(fmu))


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


def _bode_plot() -> Plot:
    peak = W0 + np.linspace(-20, 20, 201) * K2
    w = np.unique(np.concatenate((np.geomspace(0.1, 30, 400), peak)))
    systems = (("right, [1, K2, W02]", SYSTEM, "-"), ("as printed, [-1, 1j*K2, W02]", PRINTED_SYSTEM, "--"))
    responses = [
        (label, signal.bode(signal.TransferFunction([1], system), w=w), line)
        for label, system, line in systems
    ]
    return Plot(
        "Bode plot of the document: printed and right",
        "w [rad/s]",
        "|h(w)| [dB re 1 s2]",
        [Curve(label, w, response[1], line) for label, response, line in responses],
        "x",
        note="The polynomials of SciPy are in s = i*w: the printed system has neither resonance nor phase.",
        below=[Curve(label, w, response[2], line) for label, response, line in responses],
        below_label="phase [deg]",
    )


def _gaussian_plot() -> Plot:
    t = np.linspace(-6, 8, 421)
    return Plot(
        "Response to the Gaussian pulse: printed and right",
        "t [s]",
        "phi [rad]",
        [
            Curve("exact, causal", t, _exact_pulse(t)),
            Curve("as printed", t, printed_pulse(t), "--"),
            Curve("drive/w02", t, AREA * np.exp(-t * t / 2) / W02, ":"),
        ],
        note="The printed response is too small by a factor of seven and gone after the pulse; the right one follows "
        "the drive and then rings.",
    )


GRILLO = Document(
    "Grillo, Exercise: the pendulum",
    (
        Erratum(
            "introduction",
            "gamma = 1/500 s, the reciprocal of the damping time",
            "gamma is in kg/s; the energy decays in m/gamma = 500 s, the amplitude in 2*m/gamma = 1000 s",
            (
                Measured(
                    "time in which the energy of the FMU falls by e",
                    "500",
                    _energy_time,
                    "s",
                    ENERGY_TIME,
                    "RK4's own is 1.27e-9 s shorter, by R(h*lambda) in 40 digits; round-off of the energy",
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
                Number("slip of the phase in 200 s", "0.0159348", _slip, "rad"),
                Measured("largest difference from the FMU in 200 s", "0.004158112", _misprinted_impulse, "s"),
            ),
        ),
        Erratum(
            "plot of the impulse response",
            "axis phi(t) [rad]; the program calls it the plot of the free evolution",
            "an impulse response of the angle to the drive has the unit s",
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
                    3 * UNIT * W02,
                    "three roundings of w02",
                ),
                Number("printed growth in 10 s", "4.02e13", lambda _: exp(5 * (sqrt(NABLA) + K2))),
                Measured(
                    "amplitude of the FMU after 10 s",
                    "0.990049833749168",
                    _envelope,
                    bound=0.01 * ENERGY_TIME / 500,
                    reason="exp(-5 s/time in which the energy falls by e), with the bound of that time",
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
                Measured(
                    "largest angle of the FMU",
                    "0.047338428",
                    _fmu_peak,
                    "rad",
                    1.5e-6,
                    "H^2/24*max|phi''| + H^2/8*max|phi''| of the sampled peak, |phi''| < 0.09",
                ),
                Measured("ringing of the FMU after 5 s", "0.002357", _fmu_ringing, "rad", 1.5e-6, "the same"),
            ),
        ),
        Erratum("Gaussian pulse, plot", 'title "Free Evolution"', "response to the Gaussian pulse"),
        Erratum(
            "appendix, particular solution",
            "convolution between the output and the homogeneous solution",
            "between the input and it",
        ),
        Erratum(
            "appendix, Gaussian pulse",
            "sqrt((2*c)*t''), dt' for dt'', exp(-t'^2) for exp(-t''^2)",
            "sqrt(2*c)*t'', dt'', exp(-t''^2)",
        ),
        Erratum(
            "appendix",
            "a complex inverse transform is a clear mistake",
            "a form that looks complex can equal the real one",
        ),
    ),
    (_bode_plot, _gaussian_plot),
)
