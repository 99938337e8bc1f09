"""Keep-out zones: their shapes, and the zone of each pair of spacecraft."""
