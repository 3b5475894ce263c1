"""Disturbed walks: a halt, a stopped leg or a push, and what three strategies buy."""
