"""Measures of stability: planned feet, feet at the ground, feet that carry load, and falls."""
