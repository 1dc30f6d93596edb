"""Experiments: they compute; nothing here is shown."""
