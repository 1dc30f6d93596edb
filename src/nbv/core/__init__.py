"""Distributions, beliefs, criteria and fusion of poses, on arrays alone."""
