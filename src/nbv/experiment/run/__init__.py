"""What all runs share: jobs, provenance, and comparison with kept references."""
