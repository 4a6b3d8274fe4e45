"""The hardening spring as an FMI 2.0 co-simulation slave: its interface, its model and their names, joined."""

from hardening_spring.interface import INTERFACE
from hardening_spring.model import Spring

from fmi.second_order import Names, SecondOrder


class HardeningSpring(SecondOrder):
    """The hardening spring as an FMI 2.0 co-simulation slave."""

    interface = INTERFACE
    model = Spring
    names = Names("x", "v", "a", "E", "F", system="spring", quantity="force", damping_time="m/c")


SLAVE = HardeningSpring
