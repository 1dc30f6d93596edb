"""Which view to take next: arrays in, arrays out."""
