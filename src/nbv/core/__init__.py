"""Distributions on the circle, criteria, fusion and lookup tables: arrays in, arrays out."""
