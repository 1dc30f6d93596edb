"""The error to be expected after the next view if the belief is right: a Bayes expectation."""

from __future__ import annotations

import numpy as np

from nbv.core.angles import direction_deg, nearest_bin
from nbv.core.belief import Belief
from nbv.core.criteria.rotations import rotation_groups
from nbv.core.evidence import Evidence, Table

# Of the calibration views, in bins; neighbouring views tell much the same.
_STRIDE = 2


def bayes_error(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the expected error of the posterior mean direction after each rotation.

    The pose is distributed as the belief b, and the next estimates are those that calibration
    objects o really gave, at every second bin ::

        A[b, delta] = sum_theta b(theta) mean_o d(m(b, delta, e(o, theta + delta)), theta)

    with m the direction of sum_theta b(theta) L[theta + delta, e] exp(i theta). Unlike
    `expected_error` it takes views of one object as independent given the pose, and is defined
    after any number of views.

    Parameters as in `nbv.core.criteria`; `fusion` is not used. A is in degrees.
    """
    rows, n_bins = belief.probabilities, evidence.n_bins
    n_objects, n_views = evidence.estimate_deg.shape
    if not n_objects:
        raise ValueError("bayes_error needs calibration estimates")
    given = nearest_bin(evidence.estimate_deg[:, :: n_views // n_bins], n_bins)
    pose = np.arange(0, n_bins, _STRIDE)
    pose_deg = (pose * (360.0 / n_bins)).astype(np.float32)
    weights = rows[:, pose] / (n_objects * rows[:, pose].sum(axis=1, keepdims=True))
    expected = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, len(rows) * n_objects * len(pose)):
        moments = evidence.first_moments(rows, deltas)
        fused = direction_deg(moments[:, 0], moments[:, 1]).astype(np.float32)
        # By rotation, estimate and belief: what is gathered below lies together.
        fused = np.ascontiguousarray(fused.transpose(0, 2, 1))
        place = np.arange(len(deltas))[:, None]
        seen = given[:, (pose + deltas.start + place) % n_bins]
        apart = np.abs(fused[place, seen] - pose_deg[:, None])
        # Both lie in [0, 360), where this is the circular distance.
        error = np.minimum(apart, 360.0 - apart).sum(axis=0)
        expected[:, deltas.start : deltas.stop] = (error * weights.T).sum(axis=1).T
    return expected
