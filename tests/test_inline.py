"""Solvers without a source to rewrite: a host may ship bytecode only."""

from __future__ import annotations

import compileall
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from methods.solvers import SolverMethod
from tests.plants import PENDULUM
from tests.twin import Twin

REWRITTEN = (SolverMethod.ExplicitEuler, SolverMethod.ExplicitMidPoint2, SolverMethod.ExplicitRungeKutta4)
PROGRAM = """
import sys
resources, package = sys.argv[1:]
sys.path.insert(0, resources)
slave = __import__(f"{package}.slave", fromlist=["slave"])
solvers = sys.modules[f"{package}.methods.solvers"]
reference = slave.SLAVE.interface.references()
for method in solvers.SolverMethod:
    pendulum = slave.DampedPendulum(instance_name="bytecode")
    pendulum.set_integer([reference["solver.method"]], [method])
    pendulum.set_real([reference["tau"]], [0.7])
    pendulum.enter_initialization_mode()
    pendulum.exit_initialization_mode()
    for k in range(5):
        assert pendulum.do_step(0.25 * k, 0.25)
    plain = pendulum.integration._solve is solvers.METHODS[method].solver
    print(plain, *(value.hex() for value in pendulum.get_real([reference[name] for name in ("phi", "w", "a", "E")])))
"""


@pytest.mark.parametrize("source", [False, True], ids=["bytecode", "source"])
def test_without_sources_the_fmu_has_the_same_bits(fmu_path: Path, tmp_path: Path, source: bool) -> None:
    zipfile.ZipFile(fmu_path).extractall(tmp_path)
    resources = tmp_path / "resources"
    (package,) = {path.parent.parent for path in resources.rglob("solvers.py")}
    if not source:
        assert compileall.compile_dir(package, quiet=2, legacy=True)
        for path in package.rglob("*.py"):
            path.unlink()
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-B", "-c", PROGRAM, resources, package.name],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for method, line in zip(SolverMethod, done.stdout.splitlines(), strict=True):
        plain, *values = line.split()
        # With a source the explicit Runge-Kutta methods are rewritten; the others never are.
        assert plain == str(not source or method not in REWRITTEN)
        twin = Twin(PENDULUM, {"solver.method": method, "tau": 0.7})
        for k in range(5):
            twin.step(0.25 * k, 0.25)
        assert tuple(map(float.fromhex, values)) == twin.calculated[: len(PENDULUM.calculated) - 1]
