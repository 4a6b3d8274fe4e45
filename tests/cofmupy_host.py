"""Runs the default experiment in CoFmuPy and prints a variable at its end: `cofmupy_host.py FMU VARIABLE`."""

import sys

from cofmupy import Coordinator

path, variable = sys.argv[1:]
coordinator = Coordinator()
coordinator.start({"fmus": [{"id": "plant", "path": path}], "connections": []})
for _ in range(1000):
    coordinator.do_step(0.01)
# It records what it reads after a step, which is every output, with the time at the beginning of the step.
print(variable, repr(float(coordinator.get_results()["plant", variable][-1])))
