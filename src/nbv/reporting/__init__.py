"""Tables, figures and the report: they show, and compute nothing."""
