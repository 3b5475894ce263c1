"""Gait videos from recordings."""
