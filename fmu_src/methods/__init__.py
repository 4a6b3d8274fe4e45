"""Fixed-step methods for der(phi) = w, der(w) = a(phi, w); they know no model and no FMI, standard library only."""
