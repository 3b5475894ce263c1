"""Search for controller parameters that minimise FLSS (paper, Sections 3 and 4)."""
