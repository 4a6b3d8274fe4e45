"""The linear pendulum: responses to impulse, step, pulse, sine, Gaussian and held drives, for every damping."""

from __future__ import annotations

from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special
from scipy.linalg import expm

from .arrays import Array, State

NOISE = 1e-9  # relative rounding of a communication step, which adds no substep


def impulse_response(t: ArrayLike, k2: float, w02: float) -> State:
    """Return the linear response and its rate, for t >= 0, to a unit impulse of the drive at t = 0.

    [G] with nabla = 4*w02 - k2^2: h = exp(-k2*t/2)*sin(a*t)/a, a^2 = w02 - k2^2/4, and its limits for critical
    and strong damping. The slow root of strong damping is w02 over the fast one, which does not cancel.
    """
    t = np.asarray(t, dtype=float)
    half = k2 / 2
    discriminant = w02 - half * half
    if discriminant >= 0:
        a = sqrt(discriminant)
        decay = np.exp(-half * t)
        sine = t * np.sinc(a * t / pi)
        return decay * sine, decay * (np.cos(a * t) - half * sine)
    fast, slow = real_roots(k2, w02)
    difference = fast - slow
    h = -np.exp(-slow * t) * np.expm1(-difference * t) / difference
    return h, np.exp(-fast * t) - slow * h


def rk4_error(t: ArrayLike, state: State, k2: float, w02: float, h: float) -> tuple[State, State]:
    """Return RK4's errors of phi and w along a free linear motion, to the order h^5, and the next term of them.

    A step multiplies by R(h*A) with ln R(z) = z - z^5/120 + z^6/144 - z^7/336 + ..., so that the error after the time t
    is t*(-h^4*A^5/120 + h^5*A^6/144 - ...) times the motion.
    """
    A = np.array([[0.0, 1.0], [-w02, -k2]])
    fifth, sixth, seventh = (np.linalg.matrix_power(A, n) @ np.array(state) for n in (5, 6, 7))
    phi, w = np.asarray(t) * (-(h**4) / 120 * fifth + h**5 / 144 * sixth)
    next_phi, next_w = np.asarray(t) * h**6 / 336 * seventh
    return (phi, w), (next_phi, next_w)


def real_roots(k2: float, w02: float) -> tuple[float, float]:
    """Return the fast and the slow decay rate [1/s] of a strongly damped linear pendulum."""
    fast = k2 / 2 + sqrt(k2 * k2 / 4 - w02)
    return fast, w02 / fast


def free_evolution(t: ArrayLike, phi0: float, rate0: float, k2: float, w02: float) -> State:
    """Return the linear motion and its rate from an initial state without drive; [G] with the roots corrected."""
    h, hdot = impulse_response(t, k2, w02)
    return phi0 * (hdot + k2 * h) + rate0 * h, rate0 * hdot - phi0 * w02 * h


def step_response(t: ArrayLike, k2: float, w02: float) -> State:
    """Return the linear response and its rate, for t >= 0, to a unit step of the drive at t = 0."""
    t = np.asarray(t, dtype=float)
    h, hdot = impulse_response(t, k2, w02)
    if k2 * k2 / 4 > w02:
        fast, slow = real_roots(k2, w02)
        return (-np.expm1(-slow * t) * fast + np.expm1(-fast * t) * slow) / (fast - slow) / w02, h
    return (1 - (hdot + k2 * h)) / w02, h


def pulse_response(t: ArrayLike, width: float, k2: float, w02: float) -> State:
    """Return the linear response and its rate to a rectangular pulse of the drive of unit area from 0 to `width`."""
    t = np.asarray(t, dtype=float)
    rise, rise_rate = step_response(t, k2, w02)
    fall, fall_rate = step_response(np.maximum(t - width, 0.0), k2, w02)
    return (rise - fall) / width, (rise_rate - fall_rate) / width


def frequency_response(w: ArrayLike, k2: float, w02: float) -> NDArray[np.complex128]:
    """Return the linear frequency response 1/(w02 - w^2 + i*k2*w) at the angular frequencies `w` [rad/s]; [G]."""
    w = np.asarray(w, dtype=float)
    return np.asarray(1 / (w02 - w * w + 1j * k2 * w))


def sinusoidal_response(t: ArrayLike, w: float, k2: float, w02: float) -> State:
    """Return the linear response and its rate, for t >= 0, to the drive sin(w*t) from rest at t = 0.

    The imaginary part of h(w)*exp(i*w*t), less the free evolution from where that starts.
    """
    t = np.asarray(t, dtype=float)
    h = complex(frequency_response(w, k2, w02))
    steady = h * np.exp(1j * w * t)
    free, free_rate = free_evolution(t, h.imag, w * h.real, k2, w02)
    return steady.imag - free, w * steady.real - free_rate


def held_step(H: float, k2: float, w02: float) -> tuple[Array, Array]:
    """Return A, b of the exact linear step y(t + H) = A*y(t) + b*u of y = (phi, w) under a drive u held over it."""
    columns = [free_evolution(H, phi0, rate0, k2, w02) for phi0, rate0 in ((1.0, 0.0), (0.0, 1.0))]
    return np.array(columns, dtype=float).T, np.array(step_response(H, k2, w02), dtype=float)


def rk4_evolution(steps: ArrayLike, phi0: float, rate0: float, k2: float, w02: float, h: float) -> State:
    """Return what RK4 makes of `free_evolution` in so many steps of `h` [s]."""
    start, change = np.array([phi0, rate0]), _rk4_change(h, k2, w02)
    counts = np.asarray(steps)
    states = start + _powers_less_one(change, counts) @ start
    return states[..., 0], states[..., 1]


def _rk4_change(h: float, k2: float, w02: float) -> Array:
    """Return R(z) - 1, z the matrix of y' = A*y times `h` [s]."""
    one, z = np.eye(2), h * np.array([[0.0, 1.0], [-w02, -k2]])
    return np.asarray(z @ (one + z @ (one + z @ (one + z / 4) / 3) / 2))


def _powers_less_one(change: Array, counts: NDArray[np.int64]) -> Array:
    """Return (1 + change)^n - 1 for each n of `counts`, (..., 2, 2), which keeps the digits of a small change."""
    powers = np.zeros((*counts.shape, 2, 2))
    left = counts.copy()
    while left.any():
        odd = left % 2 == 1
        powers[odd] += change + powers[odd] @ change
        change = 2 * change + change @ change
        left //= 2
    return powers


def rk4_response(
    u: ArrayLike, H: float, k2: float, w02: float, h: float, start: tuple[float, float] = (0.0, 0.0)
) -> State:
    """Return what RK4 with equal substeps of at most `h` [s] makes of a drive that is held in each step of `H` [s].

    Angle and rate at n*H, n = 0 ... len(u), from `start` [rad, rad/s]. About the deflection by the drive a substep
    multiplies by R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24, z the matrix of y' = A*y times the substep.
    """
    n = ceil(H / h * (1 - NOISE))
    change = _powers_less_one(_rk4_change(H / n, k2, w02), np.array(n))
    return _stepped(change, np.outer(np.asarray(u, dtype=float), -change @ np.array([1 / w02, 0.0])), start)


def polynomial_response(rows: ArrayLike, H: float, k2: float, w02: float) -> State:
    """Return the linear angle and rate at n*H, n = 0 ... len(rows), from rest, the drive a polynomial in each step.

    A row has the drive and its derivatives by time at the beginning of the step; the drive alone is held. The change in
    a step is exp(M) - 1, M the matrix of the system whose states are angle, rate, drive and derivatives, times `H` [s]:
    a block of the exponential of M and M beside each other, so that it keeps the digits of a short step.
    """
    inputs = np.asarray(rows, dtype=float)
    n = 2 + inputs.shape[1]
    M = np.zeros((2 * n, 2 * n))
    M[:n, :n] = np.eye(n, k=1)
    M[1, :3] = -w02, -k2, 1.0
    M[:n, :n] *= H
    M[:n, n:] = M[:n, :n]
    change = expm(M)[:2, n:]
    return _stepped(change[:, :2], inputs @ change[:, 2:].T)


def _stepped(change: Array, added: Array, start: tuple[float, float] = (0.0, 0.0)) -> State:
    """Return angles and rates of y[n + 1] = y[n] + (change*y[n] + added[n])."""
    (a, b), (c, d) = change.tolist()
    phi, w = start
    states = [(phi, w)]
    for x, y in added.tolist():
        phi, w = phi + (a * phi + b * w + x), w + (c * phi + d * w + y)
        states.append((phi, w))
    table = np.array(states)
    return table[:, 0], table[:, 1]


def response_rounding(state: State, drive: ArrayLike, H: float, k2: float, w02: float) -> float:
    """Return what relative roundings of the increments in steps of `H` [s] add up to in phi, in units of one.

    `state` is that of a linear motion at n*H, `drive` [1/s2] that in the steps. If the increments round the same way
    each time, the motion carries all of it on as its free evolution, which drag ends.
    """
    phi, w = (np.abs(x[:-1]) for x in state)
    t = H * np.arange(len(phi))
    increments = H * w, H * (w02 * phi + k2 * w + np.abs(drive))
    total = np.zeros_like(t)
    for sizes, start in zip(increments, ((1.0, 0.0), (0.0, 1.0)), strict=True):
        total += np.convolve(sizes, np.abs(free_evolution(t, *start, k2, w02)[0]))[: len(t)]
    return float(np.max(total))


def held_frequency_response(w: float, H: float, k2: float, w02: float) -> tuple[complex, complex]:
    """Return the complex amplitudes of angle and rate at the times n*H under the held drive exp(i*w*n*H).

    Exact: y = (exp(i*w*H) - A)^-1*b. It is 1/(w02 - w^2 + i*k2*w) times `hold`, plus the images of the drive at
    w + 2*pi*j/H.
    """
    A, b = held_step(H, k2, w02)
    phi, rate = np.linalg.solve(np.exp(1j * w * H) * np.eye(2) - A, b)
    return complex(phi), complex(rate)


def hold(w: float, H: float) -> complex:
    """Return the frequency response of holding a sample over H [s]: sinc(w*H/2)*exp(-i*w*H/2)."""
    return complex(np.sinc(w * H / (2 * pi)) * np.exp(-0.5j * w * H))


def gaussian_response(
    t: ArrayLike,
    area: float,
    center: float,
    variance: float,
    k2: float,
    w02: float,
    start: float | None = None,
) -> State:
    """Return the linear response and its rate to the drive area*exp(-(t - center)^2/(2*variance)), causal.

    The pendulum is at rest at `start`, or at minus infinity for None. Closed form with the Faddeeva function; [G] with
    the lower limit of the convolution, the factor `area`, the square completion and the signs corrected. `area` is the
    peak [1/s2], `variance` is in s2. Within a relative 1e-10 of critical damping the result is that of critical
    damping, because the difference of the roots divides; it is then off by a relative 2e-11 at most.
    """
    t = np.asarray(t, dtype=float)
    alpha = k2 / 2
    if abs(alpha * alpha - w02) <= 1e-10 * w02:
        whole = _gaussian_integral(t, center, variance, complex(alpha), start).real
        moment = _gaussian_moment(t, center, variance, alpha, whole, start)
        return area * moment, area * (whole - alpha * moment)
    if alpha * alpha < w02:
        beta = sqrt(w02 - alpha * alpha)
        J = _gaussian_integral(t, center, variance, complex(alpha, -beta), start)
        return area / beta * J.imag, area * (J.real - alpha / beta * J.imag)
    fast, slow = real_roots(k2, w02)
    of_fast = _gaussian_integral(t, center, variance, complex(fast), start).real
    of_slow = _gaussian_integral(t, center, variance, complex(slow), start).real
    return (
        area * (of_slow - of_fast) / (fast - slow),
        area * (fast * of_fast - slow * of_slow) / (fast - slow),
    )


def _gaussian_moment(
    t: Array, center: float, variance: float, root: float, integral: Array, start: float | None
) -> Array:
    """Return the integral of s*exp(-root*s - (s - mu)^2/(2*variance)) from that without the factor s, by parts."""
    mu = t - center
    ends = np.exp(-mu * mu / (2 * variance))
    if start is not None:
        ends = ends - np.exp(-root * (t - start) - (start - center) ** 2 / (2 * variance))
    return np.asarray((mu - root * variance) * integral + variance * ends)


def _gaussian_integral(
    t: Array, center: float, variance: float, root: complex, start: float | None
) -> NDArray[np.complex128]:
    """Return the integral of exp(-root*s - (s - mu)^2/(2*variance)) over s from 0 to t - start, mu = t - center."""
    mu = t - center
    width = sqrt(2 * variance)
    scale = sqrt(pi * variance / 2)
    z = (root * variance - mu) / width
    reflected = z.real < 0
    value = np.exp(-mu * mu / (2 * variance)) * special.wofz(1j * np.where(reflected, -z, z))
    # Only where it is used: elsewhere it may overflow.
    whole = 2 * np.exp(np.where(reflected, -root * mu + root * root * variance / 2, 0))
    if start is None:
        return np.asarray(scale * np.where(reflected, whole - value, value))
    span = t - start
    z_end = (span - mu + root * variance) / width
    end_reflected = z_end.real < 0
    end = np.exp(-root * span - (span - mu) ** 2 / (2 * variance)) * special.wofz(
        1j * np.where(end_reflected, -z_end, z_end)
    )
    # Where both are reflected the two `whole` terms cancel exactly.
    result = np.where(reflected, -value, value) - np.where(end_reflected, -end, end)
    return np.asarray(scale * np.where(reflected & ~end_reflected, result + whole, result))
