"""Questions of the paper's Section 6 that only a body, or a disturbance, can answer."""
