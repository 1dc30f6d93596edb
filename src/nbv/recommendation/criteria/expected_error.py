"""The error that fusing two views really made on calibration objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.angles import nearest_bin
from nbv.calibration.density import von_mises_kernel
from nbv.recommendation.belief import Belief
from nbv.recommendation.evidence import Evidence, Table
from nbv.recommendation.fusion import calibration_errors_deg


def kernel_weights(evidence: Evidence) -> NDArray[np.float64]:
    """Return how much a calibration view at each bin counts for each estimate, (B, n_objects B).

    A von Mises kernel of the density's bandwidth in the distance of the view's estimate, times
    the number of views that the one stands for.
    """
    n_bins = evidence.n_bins
    step = evidence.estimate_deg.shape[1] // n_bins
    kernel = step * von_mises_kernel(n_bins, evidence.bandwidth_deg)
    bins = nearest_bin(evidence.estimate_deg[:, ::step].ravel(), n_bins)
    return np.asarray(kernel[(np.arange(n_bins)[:, None] - bins) % n_bins])


def first_estimate_bins(belief: Belief, evidence: Evidence) -> NDArray[np.intp]:
    """Return the bins of the first estimates, all that errors of two views depend on.

    Raises
    ------
    ValueError
        After more than one view, without an estimate, or where another estimator takes the next
        view: nothing is known of the error there.
    """
    if belief.first_bin is None or belief.n_views != 1 or belief.evidence is not evidence:
        raise ValueError("errors of two views need one first estimate by the same estimator")
    return belief.first_bin


def expected_error(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return a kernel regression of the error on the first estimate, for each rotation.

    For each calibration object o and view phi (one for each bin) the error of the rotation delta is
    ``l(o, phi, delta) = d(fuse(e(o, phi), e(o, phi + delta), delta), phi)``. It does not take views
    of one object as independent. Each row is shrunk towards the mean over all estimates by
    pseudo-observations, so that where little is known the best fixed rotation is taken
    (docs/method.md).

    Parameters as in `nbv.recommendation.criteria`; `belief` is of one estimate by the estimator of
    `evidence`, or ValueError is raised. A is in degrees.
    """
    bins = first_estimate_bins(belief, evidence)
    return evidence.once(("regression", fusion), lambda: _regression(evidence, fusion))[bins]


def _regression(evidence: Evidence, fusion: str) -> Table:
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    weights = kernel_weights(evidence)
    # A row of 360 is what pseudo-observations are counted in, as in the densities.
    alpha = max(evidence.pseudo_observations * 360.0 / n_bins, np.finfo(float).tiny)
    total = weights.astype(np.float32) @ errors.T + np.float32(alpha) * errors.mean(axis=1)
    return np.asarray(total / (weights.sum(axis=1) + alpha)[:, None], dtype=np.float32)
