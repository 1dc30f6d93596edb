"""Expected circular dispersion of the pose after the second look: a Bayes risk."""

from __future__ import annotations

import numpy as np

from nbv.recommendation.evidence import Evidence, Table


def expected_dispersion(evidence: Evidence, fusion: str) -> Table:
    """Return the Bayes risk of the posterior mean direction (design, section 3).

    Under the loss 1 - cos(error)::

        A[e, delta] = 1 - sum_e2 |sum_theta V[e, theta] L[theta + delta, e2] exp(i theta)|

    Parameters
    ----------
    evidence : Evidence
        B bins.
    fusion : str
        Not used.

    Returns
    -------
    ndarray (B, B) float32
        A[estimate, delta] in [0, 1].
    """
    risk = np.empty((evidence.n_bins, evidence.n_bins), dtype=np.float32)
    for delta, (real, imaginary) in enumerate(evidence.moments):
        risk[:, delta] = 1.0 - np.sqrt(real**2 + imaginary**2).sum(axis=1)
    return risk
