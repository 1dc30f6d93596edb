"""Bundles: everything that a robot needs for one category, in one file."""
