"""Tables and figures of extensions."""
