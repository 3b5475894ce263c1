"""Where dynamics saves a walk that is lost on paper: physical FLSS over the velocity and one condition."""
