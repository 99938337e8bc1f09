"""Peers of closeform. They take and return plain arrays and use nothing of closeform."""
