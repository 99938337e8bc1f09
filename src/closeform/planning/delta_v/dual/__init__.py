"""Dual program of minimum delta-v: its kernels, primers and the paths of its impulses."""
