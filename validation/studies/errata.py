"""What is wrong or ambiguous in the two documents, with the numbers that show it, and where each formula is treated."""

from collections.abc import Iterator

from ..checks import Result, Table
from ..documents import coverage
from ..documents.crawford import CRAWFORD
from ..documents.grillo import GRILLO
from ..fmu import Fmu
from .scene import Case

TITLE = "Errata of the two documents"
FORMULA = "phi'' + (gamma/m)*phi' + (g/L)*sin(phi) = tau/(m*L^2), linear: phi'' + k2*phi' + w02*phi = drive"


def _coverage(_: Fmu) -> Iterator[Result]:
    for document, rows in (("Crawford", coverage.CRAWFORD), ("Grillo", coverage.GRILLO)):
        yield Table(
            f"{document}: where each formula, figure and program is treated", ("what", "study and row"), rows
        )


SCENES = (CRAWFORD, GRILLO, Case("coverage of the documents", _coverage))
