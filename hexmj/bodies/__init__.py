"""Bodies: MJCF, validation, kinematics, ground and the compiled model."""
