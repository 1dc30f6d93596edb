"""Azimuths about one axis: Eqs. 1 to 9 of the paper, and what goes beyond them."""
