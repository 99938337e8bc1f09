"""What moves, in closed form."""
