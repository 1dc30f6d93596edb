"""Where to look next: arrays in, arrays out."""
