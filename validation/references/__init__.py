"""Exact answers of the pendulum: the truth that the FMU is held against.

No formula here integrates a differential equation numerically, and nothing is shared with the sources of the
FMU. Notation:

    phi'' + k2*phi' + w02*sin(phi) = drive        k2 = gamma/m [1/s], w02 = g/L [1/s2], drive = tau/(m*L^2) [1/s2]

with sin(phi) replaced by phi where a function says "linear". Times are in s, angles in rad, rates in rad/s;
arguments `t` may be arrays of any shape, and results have that shape.

Sources: [C] J. A. Crawford, "Pendulums and Elliptic Integrals"; [G] G. Grillo, "Exercise: the pendulum", both with
their misprints corrected; [DLMF] Digital Library of Mathematical Functions, chapters 7, 19, 22.
"""

from .arrays import Array, State
from .elliptic import (
    complement,
    complete_by_agm,
    incomplete,
    incomplete_by_descent,
    jacobi,
    libration,
    motion,
    period,
    period_by_ellipk,
    period_by_ellipkm1,
    period_by_series,
    period_slope,
    series_length,
)
from .linear import (
    free_evolution,
    frequency_response,
    gaussian_response,
    held_frequency_response,
    hold,
    impulse_response,
    polynomial_response,
    pulse_response,
    real_roots,
    response_rounding,
    rk4_error,
    rk4_evolution,
    rk4_response,
    sinusoidal_response,
    step_response,
)
from .overdamped import overdamped_fall

__all__ = [
    "Array",
    "State",
    "complement",
    "complete_by_agm",
    "free_evolution",
    "frequency_response",
    "gaussian_response",
    "held_frequency_response",
    "hold",
    "impulse_response",
    "incomplete",
    "incomplete_by_descent",
    "jacobi",
    "libration",
    "motion",
    "overdamped_fall",
    "period",
    "period_by_ellipk",
    "period_by_ellipkm1",
    "period_by_series",
    "period_slope",
    "polynomial_response",
    "pulse_response",
    "real_roots",
    "response_rounding",
    "rk4_error",
    "rk4_evolution",
    "rk4_response",
    "series_length",
    "sinusoidal_response",
    "step_response",
]
