"""Finished results: load them again, and export them to the formats of other tools."""
