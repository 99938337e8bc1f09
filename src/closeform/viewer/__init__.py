"""The page in which a mission moves: `viewer.html`, one file without requests; `scene` is where to begin."""
