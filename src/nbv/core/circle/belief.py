"""The belief: a distribution of the pose after any number of views.

A belief b(theta) starts as V[e1], or as the first image's distribution where the estimator gives
one. Each further view multiplies it by L[theta + delta_t, e_t] (`studies.simulation`); theta is
always the pose in the first view (docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import nearest_bin
from nbv.core.circle.evidence import Evidence, Float32Array

Angles = NDArray[np.float64]


@dataclass(frozen=True)
class Belief:
    """Distributions of n poses in the frames of their first views.

    Attributes
    ----------
    probabilities : ndarray (n, B) float32
        Rows sum to 1.
    evidence : Evidence
        The estimator that took the first view.
    first_bin : ndarray (n,) int or None
        The bin of the first estimate; None if the first image gave a distribution.
    n_views : int
        Views taken so far.
    """

    probabilities: Float32Array
    evidence: Evidence
    first_bin: NDArray[np.intp] | None = None
    n_views: int = 1


def every_belief(evidence: Evidence) -> Belief:
    """Return the belief after each possible first estimate: the rows of V."""
    return Belief(evidence.viewpoint, evidence, np.arange(evidence.n_bins))


def first_belief(estimate_deg: Angles, evidence: Evidence) -> Belief:
    """Return V[e] for each first estimate e, (n,) degrees."""
    first_bin = nearest_bin(estimate_deg, evidence.n_bins)
    return Belief(evidence.viewpoint[first_bin], evidence, first_bin)
