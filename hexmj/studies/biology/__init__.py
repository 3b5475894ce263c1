"""The animal beside the machine: forces, torques, gait, posture and work."""
