"""Reproduction of the paper's Sections 5 and 6: claims, the rules that judge them, measurements, figures."""
