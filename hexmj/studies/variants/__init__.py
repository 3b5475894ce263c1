"""Sets of weights under every variant of what the paper leaves open."""
