"""What is believed of the pose after any number of views.

A belief b(theta) starts as V[e1], or as what the first image says where an estimator gives
distributions. Each further view multiplies it by L[theta + delta_t, e_t]; theta always is the pose
in the first view (docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin
from nbv.core.distributions import product_of
from nbv.core.evidence import Evidence, Table

Angles = NDArray[np.float64]


@dataclass(frozen=True)
class Belief:
    """Distributions of n poses in their first views.

    Attributes
    ----------
    probabilities : ndarray (n, B) float32
        Rows sum to 1.
    evidence : Evidence
        Of the estimator that took the first view.
    first_bin : ndarray (n,) int or None
        The bin of the first estimate; None where the first image gave a distribution.
    n_views : int
        Views taken so far.
    """

    probabilities: Table
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
    """Return the belief after another view, by Bayes' rule.

    Views are taken as independent given the pose.

    Parameters
    ----------
    belief : Belief
    estimate_deg, delta_deg : ndarray (n,)
        The estimate from that view, and the rotation from the first view to it, degrees.
    evidence : Evidence
        Of the estimator that took it; B bins.
    """
    n_bins = evidence.n_bins
    turn = nearest_bin(delta_deg, n_bins)[:, None] + np.arange(n_bins)
    likelihood = evidence.second[turn, nearest_bin(estimate_deg, n_bins)[:, None]]
    product = belief.probabilities * likelihood
    rows = np.asarray(product / product.sum(axis=1, keepdims=True))
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def multiplied(
    belief: Belief, distributions: NDArray[np.floating[Any]], delta_deg: NDArray[np.int64]
) -> Belief:
    """Return the belief after another view that gave a distribution; see `product_of`.

    Parameters
    ----------
    belief : Belief
    distributions : ndarray (n, B)
        p(azimuth | image) in the frame of the image's own view.
    delta_deg : ndarray (n,)
        The rotation from the first view to it, a multiple of 360 / B.
    """
    product = product_of(belief.probabilities, distributions, delta_deg)
    rows = (product / product.sum(axis=1, keepdims=True)).astype(np.float32)
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def coarser(belief: Belief, evidence: Evidence) -> Belief:
    """Return the same belief in the bins of evidence of the same estimator.

    Their number divides that of the belief with an odd quotient.
    """
    width = belief.probabilities.shape[1] // evidence.n_bins
    centred = np.roll(belief.probabilities, width // 2, axis=1)
    rows = centred.reshape(len(centred), evidence.n_bins, width).sum(axis=2)
    first_bin = belief.first_bin
    if first_bin is not None:
        first_bin = (first_bin + width // 2) // width % evidence.n_bins
    return Belief(np.asarray(rows), evidence, first_bin, belief.n_views)
