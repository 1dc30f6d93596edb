"""Tables and figures of what goes beyond the paper."""
