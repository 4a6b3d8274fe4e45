"""The two documents: their errata, the numbers of their figures, and where each of their formulas is treated."""
