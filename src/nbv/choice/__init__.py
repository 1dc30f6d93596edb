"""The next view: limits, ranking and camera poses."""
