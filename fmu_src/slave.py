"""The damped pendulum as an FMI 2.0 co-simulation slave: its interface, its model and their names, joined."""

from __future__ import annotations

from damped_pendulum.interface import INTERFACE
from damped_pendulum.model import Pendulum
from fmi.second_order import Names, SecondOrder


class DampedPendulum(SecondOrder):
    """The damped pendulum as an FMI 2.0 co-simulation slave."""

    interface = INTERFACE
    model = Pendulum
    names = Names(
        x="phi",
        v="w",
        a="a",
        energy="E",
        input="tau",
        system="pendulum",
        quantity="torque",
        damping_time="m/gamma",
    )


SLAVE = DampedPendulum  # the class that the build packs
