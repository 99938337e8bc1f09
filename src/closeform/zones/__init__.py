"""Keep-out zones: their shapes, and which of them holds between two craft."""
