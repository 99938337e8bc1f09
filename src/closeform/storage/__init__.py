"""Result folders on disk: ownership, locking, atomic publication, and the tables of arcs."""
