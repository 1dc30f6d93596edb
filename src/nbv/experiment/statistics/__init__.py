"""Errors of methods: their statistics and paired intervals."""
