"""Bodies: what a six-legged body is, its kinematics and gains, and how it is compiled on its ground."""
