"""Fixed-step methods for der(x) = v, der(v) = a(x, v); they know no model and no FMI, standard library only."""
