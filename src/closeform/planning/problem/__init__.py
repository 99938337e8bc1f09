"""The planning problem: paths, obstacles, zones of all pairs, and how contacts deflect paths."""
