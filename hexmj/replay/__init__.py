"""Recordings of walks, and the figures, films and pages that show them."""
