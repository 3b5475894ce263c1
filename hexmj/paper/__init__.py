"""The paper's Section 5: claims, rules, measurements, figures."""
