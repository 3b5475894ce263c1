"""Why the physics can be believed: the static limit of slow walks, and whether this machine is fit for the work."""
