"""Planned paths, sampled so that other programs can interpolate them."""
