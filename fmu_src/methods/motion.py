"""What the methods ask of a model, and what they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

Acceleration = Callable[[float, float], float]
ImplicitStage = Callable[[float, float], tuple[float, float, int]]
TaylorStep = Callable[[float, float], tuple[float, float]]


class Motion(Protocol):
    """What the methods ask of a model: der(v) = a(x, v) under an input that is held."""

    @property
    def damping_rate(self) -> float:
        """Minus the partial derivative of a with respect to v where the model rests [1/s], >= 0."""

    @property
    def w02(self) -> float:
        """Minus the partial derivative of a with respect to x there, of either sign [1/s2]."""

    def acceleration(self) -> Acceleration:
        """Return a as a function of x and v."""

    def coefficients(self) -> tuple[float, ...]:
        """Return the coefficients of `terms`."""

    @staticmethod
    def terms() -> Mapping[str, str]:
        """Return coefficient -> term of a as an expression of x, v and the coefficient; their sum is a."""

    @staticmethod
    def functions() -> Mapping[str, Callable[[float], float]]:
        """Return the functions that the terms call, by name."""

    def implicit_stage(self, b: float) -> ImplicitStage:
        """Return X, V and the evaluations, from x and v, of V = v + b*a(X, V), X = x + b*V."""

    def longest_implicit_stage(self) -> float:
        """Return the factor b [s] below which that equation has a single solution."""

    def taylor_step(self, h: float, order: int) -> TaylorStep:
        """Return x and v after `h` [s], by their Taylor series up to `order`, as a function of x and v."""


Solver = Callable[[Motion, float, float, float, int], tuple[float, float, int]]
