"""Primitives of all figures: views in space, charts, style, colours and text."""
