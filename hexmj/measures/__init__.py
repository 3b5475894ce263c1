"""Measures of stability: kinematic (planned polygon), carried (feet that carry load) and physical (falls)."""
