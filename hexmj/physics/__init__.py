"""Physics: settling, rollouts of plans in MuJoCo, and their outcomes."""
