"""Impulses and burns of minimum delta-v of one spacecraft: primers, dual programs and their paths."""
