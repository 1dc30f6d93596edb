"""Pose from one depth image. Torch is imported in this package alone."""
