"""Tables, figures and the report: they show what others computed, with intervals."""
