"""Races: run times against each other, in rounds that all runners share, and what may be claimed of them.

Times are those that the processor worked for the runner. Whatever else the machine does makes them longer all the
same, through caches and clock rates. It meets all runners of a round, so a round gives one quotient of their times. A
claim is about the median of the quotients, and rests on an interval that contains it with a known probability: it holds
if the whole interval keeps the bound. A race is run once.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import comb, nan
from time import perf_counter, thread_time
from typing import TypeVar

from .checks import About, Check

Name = TypeVar("Name", bound=Hashable)
Runner = Callable[[], float]  # runs once and returns the time [s] of what is raced

ROUNDS = 21
SPEND = 0.02  # what each runner runs in a round at least [s]
CONFIDENCE = 0.95  # at least; that of the interval


def granularity(measure: Callable[[], float]) -> float:
    """Return the least step [s] that a clock was seen to make."""

    def step() -> float:
        begin = measure()
        while (end := measure()) == begin:
            pass
        return end - begin

    return min(step() for _ in range(10))


# Some systems count the work of a thread in ticks of milliseconds.
clock = thread_time if granularity(thread_time) < 1e-5 else perf_counter


@dataclass(frozen=True)
class Ratio:
    """The median of the quotients of the rounds, and the interval that contains it."""

    median: float
    low: float
    high: float
    rounds: int

    def __str__(self) -> str:
        return (
            f"median {self.median:.3g}, {100 * CONFIDENCE:g} percent interval {self.low:.3g} to {self.high:.3g} "
            f"of {self.rounds} rounds"
        )


def race(
    runners: Mapping[Name, Runner], rounds: int | None = None, spend: float | None = None
) -> dict[Name, list[float]]:
    """Return the times [s] of a run of each runner, its mean in each round; each round begins with another runner."""
    rounds, spend = ROUNDS if rounds is None else rounds, SPEND if spend is None else spend
    names = list(runners)
    times: dict[Name, list[float]] = {name: [] for name in names}
    for i in range(rounds):
        first = i % len(names)
        for name in names[first:] + names[:first]:
            total, runs = runners[name](), 1
            while total < spend:
                total, runs = total + runners[name](), runs + 1
            times[name].append(total / runs)
    return times


def ratio(numerators: Sequence[float], denominators: Sequence[float]) -> Ratio:
    """Return the ratio of the times of two runners; its interval is NaN where there are too few rounds for one."""
    quotients = sorted(a / b for a, b in zip(numerators, denominators, strict=True))
    n = len(quotients)
    median = (quotients[(n - 1) // 2] + quotients[n // 2]) / 2
    k = interval_rank(n)
    low, high = (quotients[k - 1], quotients[n - k]) if k else (nan, nan)
    return Ratio(median, low, high, n)


def interval_rank(n: int) -> int:
    """Return the largest k for which the k-th smallest and the k-th largest of n numbers enclose the median.

    Each number is below the median with the probability 1/2, so fewer than k are with a binomial one; both ends
    together may miss it with 1 - CONFIDENCE. This is true for every distribution. 0 means that no k is good enough.
    """
    k, missing = 0, 2.0 * 0.5**n
    while missing <= 1 - CONFIDENCE:
        k += 1
        missing += 2.0 * comb(n, k) * 0.5**n
    return k


def at_least(name: str, measured: Ratio, bound: float, reason: str) -> Check:
    """Return the row that claims a ratio of at least `bound`; it judges the lower end of the interval."""
    reason = _reason(measured, bound, reason)
    return Check(name, measured.low, bound, reason, at_least=True, about=About.TIMES)


def at_most(name: str, measured: Ratio, bound: float, reason: str) -> Check:
    """Return the row that claims a ratio of at most `bound`; it judges the upper end of the interval."""
    return Check(name, measured.high, bound, _reason(measured, bound, reason), about=About.TIMES)


def not_measured(name: str, bound: float, why: str) -> Check:
    """Return the row of a race that could not be run, which never holds."""
    return Check(name, nan, bound, f"not measured: {why}", at_least=True, about=About.TIMES)


def _reason(measured: Ratio, bound: float, reason: str) -> str:
    undecided = "; undecided: the interval contains the bound" if measured.low < bound < measured.high else ""
    return f"{reason}; {measured}{undecided}"
