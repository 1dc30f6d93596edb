"""Expected entropy of the pose after the next view: the less is left, the more was gained."""

from __future__ import annotations

import numpy as np

from nbv.core.belief import Belief
from nbv.core.criteria.rotations import rotation_groups
from nbv.core.criteria.spreads import entropy
from nbv.core.evidence import Evidence, Table


def information_gain(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the expected entropy of the pose's posterior (docs/method.md).

    The pose theta is distributed as the belief b (V[e] after one view), the next estimate as
    L[theta + delta]. The chain rule of entropy gives exactly ::

        A[b, delta] = H(b) + sum_theta b(theta) H(L[theta + delta])
                      - H(sum_theta b(theta) L[theta + delta, .])

    so that no posterior has to be formed.

    Parameters as in `nbv.core.criteria`; `fusion` is not used. A is in nats.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    prior = entropy(rows)
    noise = evidence.once("entropy of L", lambda: entropy(evidence.second))
    left = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        predicted = evidence.predicted(rows, deltas)
        known = entropy(predicted.reshape(-1, n_bins)).reshape(len(deltas), len(rows))
        for place, delta in enumerate(deltas):
            left[:, delta] = prior + rows @ noise[delta : delta + n_bins] - known[place]
    return left
