"""The damped pendulum without FMI: model, solvers and interface tables, standard library only."""
