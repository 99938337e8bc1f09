"""Finished results: load them, and export them to the formats of other tools."""
