"""Search for parameters that minimise the cost function (paper, Section 4)."""
