"""The race of the FMU against other integrators: scenes, rivals, how they are fitted, timed, judged and shown."""
