"""Studies beyond the paper; README.md lists their questions."""
