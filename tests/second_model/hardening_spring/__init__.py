"""A mass on a hardening spring: its model, which knows no FMI, and the tables of its interface."""
