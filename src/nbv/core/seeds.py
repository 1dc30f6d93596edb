"""Random numbers depend on the run's seed and on their labels, and on nothing else."""

from __future__ import annotations

import zlib

import numpy as np


def seed_for(seed: int, *labels: str | int) -> int:
    """Return a 32-bit seed for the run's seed and the labels; other labels give another seed."""
    words = [zlib.crc32(str(label).encode()) for label in labels]
    return int(np.random.SeedSequence([seed, *words]).generate_state(1)[0])


def rng_for(seed: int, *labels: str | int) -> np.random.Generator:
    """Return a generator seeded by `seed_for`."""
    return np.random.default_rng(seed_for(seed, *labels))
