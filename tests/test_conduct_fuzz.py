"""A random walk over the whole FMI call surface, in a process of its own."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.hosts import run_host
from tests.plants import Plant
from tests.test_conduct_hosts import default_end

CALLS = 12_000 if os.environ.get("CI") else 2_000


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_random_walk_over_all_calls_ends_with_a_host_that_works(
    fmu_path: Path, plant: Plant, seed: int
) -> None:
    x, calls, errors = run_host("fuzz", fmu_path, str(seed), str(CALLS))
    assert x == default_end(plant)
    assert calls == CALLS
    assert 0.1 < errors / calls < 0.9  # neither a walk that is stuck in errors nor one that makes none
