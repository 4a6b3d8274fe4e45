"""The damped pendulum: its model, which knows no FMI, and the tables of its interface; standard library only."""
