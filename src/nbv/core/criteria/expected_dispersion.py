"""Expected circular dispersion of the pose after the next view: a Bayes risk."""

from __future__ import annotations

import numpy as np

from nbv.core.belief import Belief
from nbv.core.criteria.rotations import rotation_groups
from nbv.core.evidence import Evidence, Table


def expected_dispersion(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the Bayes risk of the posterior mean direction (docs/method.md).

    Under the loss 1 - cos(error), with the belief b (V[e] after one view)::

        A[b, delta] = 1 - sum_e |sum_theta b(theta) L[theta + delta, e] exp(i theta)|

    Parameters as in `nbv.core.criteria`; `fusion` is not used. A is in [0, 1].
    """
    rows = belief.probabilities
    risk = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(evidence.n_bins, 2 * rows.size):
        if rows is evidence.viewpoint:
            moments = evidence.moments[deltas.start : deltas.stop]
        else:
            moments = evidence.first_moments(rows, deltas)
        length = np.sqrt(moments[:, 0] ** 2 + moments[:, 1] ** 2).sum(axis=-1)
        risk[:, deltas.start : deltas.stop] = (1.0 - length).T
    return risk
