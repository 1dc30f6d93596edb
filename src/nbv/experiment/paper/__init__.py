"""What the paper says: its printed values, its claims, and whether they hold."""
