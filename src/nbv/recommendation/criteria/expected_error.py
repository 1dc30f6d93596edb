"""The error that looking twice really made on calibration objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.angles import nearest_bin
from nbv.calibration.density import von_mises_kernel
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


def expected_error(evidence: Evidence, fusion: str) -> Table:
    """Return a kernel regression of the error on the first estimate, for each rotation.

    For each calibration object o and view phi (one for each bin) the error of the rotation delta is
    ``l(o, phi, delta) = d(fuse(e(o, phi), e(o, phi + delta), delta), phi)``. It assumes nothing
    about the independence of two looks at one object. Each row is shrunk towards the mean over
    all estimates by pseudo-observations, so that where little is known the best fixed rotation
    is taken (design, section 3).

    Parameters
    ----------
    evidence : Evidence
        B bins.
    fusion : str
        A name in `nbv.recommendation.fusion.FUSIONS`.

    Returns
    -------
    ndarray (B, B) float32
        A[estimate, delta], degrees.
    """
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    weights = kernel_weights(evidence)
    # A row of 360 is what pseudo-observations are counted in, as in the densities.
    alpha = max(evidence.pseudo_observations * 360.0 / n_bins, np.finfo(float).tiny)
    total = weights.astype(np.float32) @ errors.T + np.float32(alpha) * errors.mean(axis=1)
    return np.asarray(total / (weights.sum(axis=1) + alpha)[:, None], dtype=np.float32)
