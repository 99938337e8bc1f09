"""Certified search of pairs about any chief: signs of polynomials in the windows of its table."""
