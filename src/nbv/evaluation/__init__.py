"""Reading the results: metrics, tables, claims, figures and the report."""
