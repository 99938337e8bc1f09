"""What closeform is measured against: plain arrays in, plain arrays out, nothing of closeform inside."""
