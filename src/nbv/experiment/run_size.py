"""Whether a run is large enough for its numbers to mean anything."""

from __future__ import annotations

from collections.abc import Mapping

FEWEST_OBJECTS = 50
"""Test objects of a category. With 125, the intervals of Table 1's differences reach 0.2 to 1.7
degrees to either side, less than most of those differences; with 50 they are 1.6 times as wide,
which is as large as the differences themselves."""

FEWEST_EPOCHS = 4
"""Epochs of training: the shortest schedule of ``config/estimator``."""


def too_small(n_objects: Mapping[str, int], epochs: int | None) -> tuple[str, ...]:
    """Return a sentence that says why a run's numbers mean nothing, or nothing.

    Parameters
    ----------
    n_objects : mapping of str to int
        Objects of each category.
    epochs : int or None
        Of the estimator; None for estimates of another program.

    Returns
    -------
    tuple of str
        One sentence, or none where the run is large enough.
    """
    reasons = []
    few = {category: n for category, n in n_objects.items() if n < FEWEST_OBJECTS}
    if few:
        fewest = min(few, key=few.__getitem__)
        reasons.append(f"{few[fewest]} objects of {fewest}, and {FEWEST_OBJECTS} are the least")
    if epochs is not None and epochs < FEWEST_EPOCHS:
        s = "s" if epochs > 1 else ""
        reasons.append(f"{epochs} epoch{s} of training, and {FEWEST_EPOCHS} are the least")
    if not reasons:
        return ()
    return (f"This run is too small for its numbers to mean anything: {'; '.join(reasons)}.",)
