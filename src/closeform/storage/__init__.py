"""Result folders on disk: ownership, locking, atomic publication, and tables of path arcs."""
