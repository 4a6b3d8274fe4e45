"""FMI 2.0 co-simulation for a model that is described by tables and a few methods; knows no model."""
