"""Bodies: MJCF, kinematics, ground and the compiled model."""
