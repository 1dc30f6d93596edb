"""Random generators that depend on the run's seed and on labels alone."""

from __future__ import annotations

import zlib

import numpy as np

FIRST_FEATURE_SEED = 9000
"""Depth features are trained on objects of the seeds from here on; no other run may have one."""


def seed_for(seed: int, *labels: str | int) -> int:
    """Derive a 32-bit seed from the run's seed and labels, such as a category and a fold."""
    words = [zlib.crc32(str(label).encode()) for label in labels]
    return int(np.random.SeedSequence([seed, *words]).generate_state(1)[0])


def rng_for(seed: int, *labels: str | int) -> np.random.Generator:
    """Return a random generator seeded by `seed_for`."""
    return np.random.default_rng(seed_for(seed, *labels))
