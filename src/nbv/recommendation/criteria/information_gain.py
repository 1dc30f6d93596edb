"""Expected entropy of the pose after the second look: the less is left, the more was gained."""

from __future__ import annotations

import numpy as np

from nbv.recommendation.criteria.spreads import entropy
from nbv.recommendation.evidence import Evidence, Table


def information_gain(evidence: Evidence, fusion: str) -> Table:
    """Return the expected entropy of the pose's posterior (design, section 3).

    With the pose theta, distributed as V[e], and the second estimate e2, distributed as
    L[theta + delta], the chain rule of entropy gives exactly ::

        A[e, delta] = H(V[e]) + sum_theta V[e, theta] H(L[theta + delta])
                      - H(sum_theta V[e, theta] L[theta + delta, .])

    so that no posterior has to be formed.

    Parameters
    ----------
    evidence : Evidence
        B bins.
    fusion : str
        Not used.

    Returns
    -------
    ndarray (B, B) float32
        A[estimate, delta] in nats.
    """
    n_bins, first = evidence.n_bins, evidence.viewpoint
    prior, noise = entropy(first), entropy(evidence.second)
    left = np.empty((n_bins, n_bins), dtype=np.float32)
    for delta in range(n_bins):
        seen = slice(delta, delta + n_bins)
        left[:, delta] = prior + first @ noise[seen] - entropy(first @ evidence.second[seen])
    return left
