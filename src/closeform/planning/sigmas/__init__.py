"""Minimum energy with k standard deviations of all errors kept clear."""
