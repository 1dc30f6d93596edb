"""The belief: a distribution of the pose after any number of views.

A belief b(theta) starts as V[e1], or as the first image's distribution where the estimator gives
one. Each further view multiplies it by L[theta + delta_t, e_t]; theta is always the pose in the
first view (docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import nearest_bin
from nbv.core.circle.distributions import product_of
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


def updated(
    belief: Belief, estimate_deg: Angles, delta_deg: NDArray[np.int64], evidence: Evidence
) -> Belief:
    """Update a belief by the estimate of another view, by Bayes' rule.

    Views are assumed to be independent given the pose. `delta_deg` (n,) is the rotation from the
    first view to that one, and the evidence that of the estimator that took it.
    """
    n_bins = evidence.n_bins
    rotated = nearest_bin(delta_deg, n_bins)[:, None] + np.arange(n_bins)
    likelihood = evidence.second[rotated, nearest_bin(estimate_deg, n_bins)[:, None]]
    product = belief.probabilities * likelihood
    rows = np.asarray(product / product.sum(axis=1, keepdims=True))
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def multiplied(
    belief: Belief, distributions: NDArray[np.floating[Any]], delta_deg: NDArray[np.int64]
) -> Belief:
    """Update a belief by the distribution (n, B) of another view, in its frame; see `product_of`.

    `delta_deg` (n,) is the rotation from the first view to it, a multiple of 360 / B.
    """
    product = product_of(belief.probabilities, distributions, delta_deg)
    rows = (product / product.sum(axis=1, keepdims=True)).astype(np.float32)
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def coarser(belief: Belief, evidence: Evidence) -> Belief:
    """Return the belief in the wider bins of evidence of the same estimator.

    The quotient of the two numbers of bins must be an odd integer.
    """
    width = belief.probabilities.shape[1] // evidence.n_bins
    centred = np.roll(belief.probabilities, width // 2, axis=1)
    rows = centred.reshape(len(centred), evidence.n_bins, width).sum(axis=2)
    first_bin = belief.first_bin
    if first_bin is not None:
        first_bin = (first_bin + width // 2) // width % evidence.n_bins
    return Belief(np.asarray(rows), evidence, first_bin, belief.n_views)
