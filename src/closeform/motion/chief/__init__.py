"""Relative motion about any chief: tables of its transition matrix, and kernels that read them."""
