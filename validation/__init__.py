"""Validation of the damped pendulum FMU against exact answers; talks to the built FMU only."""
