"""The real field: what Hill's equations leave out along a path, and the thrust that flies it all the same."""
