"""Proofs for searches: S04's theorem, branch and bound over initial states, margins of a lock."""
