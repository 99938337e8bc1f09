"""What all figures are drawn with: views in space, charts, style, colours and text."""
