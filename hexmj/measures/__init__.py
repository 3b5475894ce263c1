"""The measures of stability: kinematic, measured and physical, and their comparison."""
