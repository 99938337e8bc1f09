"""Who comes near whom, certified between any two instants."""
