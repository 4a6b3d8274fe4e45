"""How a solver looks in every picture: its colour, and line and marker for readers who do not see colours.

The methods of the FMU are solid, rivals are broken: a rival has the colour of a method, but never its line.
"""

from typing import NamedTuple

INK = "#010203"  # of axes and text; in a page it is the colour of the text around the picture


class Style(NamedTuple):
    """Colour, line and marker, as matplotlib calls them."""

    colour: str
    line: str
    marker: str


STYLES = {
    "ExplicitEuler": Style("#8a8a8a", "-", "o"),
    "ExplicitMidPoint2": Style("#5f9e33", "-", "s"),
    "ExplicitRungeKutta4": Style("#2f7fd1", "-", "^"),
    "ImplicitEuler": Style("#c49a00", "-", "v"),
    "ImplicitTrapezoid": Style("#9066c0", "-", "<"),
    "TRBDF2": Style("#2a9a9a", "-", ">"),
    "SDIRK4": Style("#d0552b", "-", "D"),
    "TaylorSeries": Style(INK, "-", "P"),
    "RK45": Style("#5f9e33", "--", "x"),
    "DOP853": Style("#2f7fd1", "--", "+"),
    "LSODA": Style("#d0552b", "--", "1"),
    "Radau": Style("#c49a00", "--", "2"),
    "BDF": Style("#9066c0", "--", "3"),
    "odeint": Style(INK, "--", "4"),
    "heyoka": Style("#2f7fd1", ":", "*"),
    "odeint, f in C": Style(INK, ":", "4"),
}
