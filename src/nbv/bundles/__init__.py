"""Bundles, a network with its calibration: from frames to the next view."""
