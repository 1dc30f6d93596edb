"""Meshes: where they come from, and the one frame and size that all of them are brought to."""
