"""How widely a distribution over directions is spread: one number for each row."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nbv.core.evidence import Table

Spread = Callable[[Table], NDArray[np.float32]]


def entropy(distributions: Table) -> NDArray[np.float32]:
    """Return the entropy of each row in nats, 0 log 0 being 0 (Eq. 1)."""
    tiny = np.finfo(np.float32).tiny
    logs = np.log(np.maximum(distributions, tiny))
    return np.asarray(-np.einsum("ij,ij->i", distributions, logs), dtype=np.float32)


def circular_variance(distributions: Table) -> NDArray[np.float32]:
    """Return 1 - abs(mean direction) of each row, in [0, 1]."""
    angles = 2 * np.pi * np.arange(distributions.shape[1]) / distributions.shape[1]
    cosine = distributions @ np.cos(angles).astype(np.float32)
    sine = distributions @ np.sin(angles).astype(np.float32)
    return np.asarray(1.0 - np.hypot(cosine, sine), dtype=np.float32)


SPREADS: dict[str, Spread] = {"entropy": entropy, "circular_variance": circular_variance}
