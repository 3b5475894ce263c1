"""Studies, most of which address questions of the paper's Section 6 with a simulated body or with disturbances."""
