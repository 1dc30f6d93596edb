"""Reference results under version control: keeping them, and comparing runs with them."""
