"""Minimisation of the cost function (paper, Section 4)."""
