"""How many objects folds need. Apart, so that an edit of the schema does not rerun the splits."""

from __future__ import annotations


def enough_objects(n_objects: int, n_folds: int) -> bool:
    """Say whether each fold can test one object and has two more, to train and to calibrate."""
    largest = -(-n_objects // n_folds)
    return n_objects >= n_folds and n_objects - largest >= 2
