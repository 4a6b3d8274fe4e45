"""Where and with what run times were measured."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .compiler import compiler_version

ROOT = Path(__file__).resolve().parent.parent.parent
PACKAGES = ("pythonfmu", "fmpy", "numpy", "scipy", "heyoka")


@cache
def provenance() -> tuple[tuple[str, str], ...]:
    """Return names and values of what a run time depends on."""
    return (
        ("CPU", cpu()),
        ("load, mean of 15 minutes", load()),
        ("system", platform.platform()),
        ("C compiler of hosts, loops and right-hand sides", compiler_version()),
        ("date", datetime.now(UTC).isoformat(timespec="seconds")),
        ("commit", commit()),
        ("Python", platform.python_version()),
        *((name, installed(name)) for name in PACKAGES),
    )


def cpu() -> str:
    """Return the model of the processor."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text("utf-8").splitlines() if information.is_file() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, "") or platform.processor() or platform.machine()


def load() -> str:
    """Return how many processes wanted a processor on average, and of how many processors."""
    wanted = f"{os.getloadavg()[2]:.2g}" if hasattr(os, "getloadavg") else "unknown"
    return f"{wanted}, {os.cpu_count()} processors"


def commit() -> str:
    """Return the commit of the source tree, with a mark if files differ from it."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()


def installed(package: str) -> str:
    """Return the version of a package, or that there is none."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
