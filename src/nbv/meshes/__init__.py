"""Meshes: their sources, and the one frame and size that all of them get."""
