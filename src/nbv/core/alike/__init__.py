"""Expected error of the next view by kernel regression on calibration sweeps."""
