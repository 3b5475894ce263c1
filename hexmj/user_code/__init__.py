"""Code of a user's own: loaded from its file, its sources as they ran, and what they open."""
