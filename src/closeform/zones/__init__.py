"""Keep-out zones and which of them holds between two craft."""
