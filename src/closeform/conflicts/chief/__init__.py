"""Certified search of pairs beside any chief: signs of polynomials in the windows of its table."""
