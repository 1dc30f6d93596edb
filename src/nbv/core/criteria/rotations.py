"""Rotations in groups that the processor's cache holds."""

from __future__ import annotations

from collections.abc import Iterator

# Numbers in the largest array that a criterion makes of a group of rotations.
_CHUNK = 2**16


def rotation_groups(n_bins: int, numbers_each: int) -> Iterator[range]:
    """Yield all rotations 0 to n_bins - 1, as many at once as a criterion has cache for.

    One rotation needs an array of `numbers_each` numbers. Few beliefs take many rotations at once
    and many beliefs few: no call of numpy is small.
    """
    at_once = max(1, _CHUNK // max(1, numbers_each))
    for start in range(0, n_bins, at_once):
        yield range(start, min(start + at_once, n_bins))
