"""Interactive page of a mission: `viewer.html`, one self-contained file; `scene` is the entry point."""
