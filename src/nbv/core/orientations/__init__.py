"""Orientations in three dimensions: symmetries, errors, beliefs and criteria."""
