"""What is wrong or ambiguous in the two documents, with the numbers that show it."""

from ..documents.crawford import CRAWFORD
from ..documents.grillo import GRILLO

TITLE = "Errata of the two documents"
FORMULA = "phi'' + (gamma/m)*phi' + (g/L)*sin(phi) = tau/(m*L^2), linear: phi'' + k2*phi' + w02*phi = drive"
SCENES = (CRAWFORD, GRILLO)
