"""How far a run of the workflow is: estimated from its own jobs, and shown in one line.

Only the Snakefile imports this package. No result depends on it.
"""
