"""Studies beyond the paper; README.md says which question each one answers."""
