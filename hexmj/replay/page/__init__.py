"""Recordings as one HTML file that anybody can open and play."""
