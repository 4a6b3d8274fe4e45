"""Runs the default experiment with Ecos and prints the final angle: FMU VALUE_REFERENCE (not needed)."""

import sys

from ecospy import EcosSimulation, EcosSimulationStructure

with EcosSimulationStructure() as structure:
    structure.add_model("pendulum", sys.argv[1])
    with EcosSimulation(structure=structure, step_size=0.01) as simulation:
        simulation.init()
        simulation.step(1000)
        phi = simulation.get_real("pendulum::phi")
        simulation.terminate()
print("phi", phi)
