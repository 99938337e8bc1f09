"""The way around: a formation's cheapest paths, certified clear."""
