"""Measures of stability: kinematic (planned polygon), measured (feet in contact) and physical (falls)."""
