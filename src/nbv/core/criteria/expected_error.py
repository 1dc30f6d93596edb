"""The error that fusing two views really made on calibration objects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin
from nbv.core.belief import Belief
from nbv.core.density import von_mises_kernel
from nbv.core.evidence import Evidence, Table
from nbv.core.fusion import OF_DISTRIBUTIONS, calibration_errors_deg

BELIEFS_AT_ONCE = 1024
"""How many beliefs are weighed at once, to bound the memory."""


def kernel_weights(evidence: Evidence) -> NDArray[np.float64]:
    """Return how much a calibration view at each bin counts for each estimate, (B, n_objects B).

    A von Mises kernel of the density's bandwidth in the distance of the view's estimate, times
    the number of views that the one stands for.
    """
    n_bins = evidence.n_bins
    step = evidence.n_views // n_bins
    kernel = step * von_mises_kernel(n_bins, evidence.bandwidth_deg)
    bins = nearest_bin(evidence.estimate_deg[:, ::step].ravel(), n_bins)
    return np.asarray(kernel[(np.arange(n_bins)[:, None] - bins) % n_bins])


def affinity(one: Table, other: Table) -> Table:
    """Return the affinity of every pair of distributions (n, B) and (m, B), (n, m) in [0, 1].

    ``sum_theta sqrt(b(theta) c(theta))``, the Bhattacharyya coefficient: 1 where the two are
    equal, 0 where one excludes the other (Bhattacharyya, 1943).
    """
    return np.asarray(np.sqrt(one) @ np.sqrt(other).T)


def view_weights(beliefs: Table, views: Table, power: float) -> Table:
    """Return how much each view (m, B) counts for each belief (n, B), (n, m).

    It is the affinity to the power, times the degrees of a bin: pseudo-observations are views that
    are a degree apart, and `views` are a bin apart.
    """
    return np.asarray(360.0 / views.shape[1] * affinity(beliefs, views) ** power)


def need_first_view(belief: Belief, evidence: Evidence) -> None:
    """Raise ValueError unless the belief is of one view by the estimator of the evidence.

    Of other beliefs nothing is known about the error of two views.
    """
    if belief.n_views != 1 or belief.evidence is not evidence:
        raise ValueError("errors of two views need one first view by the same estimator")


def expected_error(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return a kernel regression of the error on the first view, for each rotation.

    For each calibration object o and view phi (one for each bin) the error of the rotation delta is
    ``l(o, phi, delta) = d(fuse(x(o, phi), x(o, phi + delta), delta), phi)``, where x is what the
    fusion rule fuses. Views count by their likeness with the first view: estimates by a von Mises
    kernel of the density's bandwidth in their distance, distributions by their `affinity` to the
    power ``affinity.power``. Pseudo-observations shrink the mean towards that over all views, so
    that where little is known the best fixed rotation is taken. Nothing is assumed about the
    independence of views of one object (docs/method.md).

    Parameters as in `nbv.core.criteria`; `belief` is of one view by the estimator of
    `evidence`, or ValueError is raised. A is in degrees.
    """
    need_first_view(belief, evidence)
    if fusion in OF_DISTRIBUTIONS:
        return _regression_on_distributions(belief, evidence, fusion)
    if belief.first_bin is None:
        raise ValueError(f"fusion {fusion!r} needs a first estimate")
    table = evidence.once(("regression", fusion), lambda: _regression(evidence, fusion))
    return table[belief.first_bin]


def _regression(evidence: Evidence, fusion: str) -> Table:
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    # A row of 360 is what pseudo-observations are counted in, as in the densities.
    alpha = evidence.pseudo_observations * 360.0 / n_bins
    return _shrunk(kernel_weights(evidence), errors, alpha)


def _regression_on_distributions(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    n_bins = evidence.n_bins
    errors = calibration_errors_deg(evidence, fusion).reshape(n_bins, -1)
    views, settings = evidence.distributions, evidence.settings["affinity"]
    if views is None:
        raise ValueError(f"fusion {fusion!r} needs evidence of distributions")
    step = evidence.n_views // n_bins
    calibration = views[:, ::step].reshape(-1, n_bins)
    rows = belief.probabilities
    costs = [
        _shrunk(
            view_weights(rows[start : start + BELIEFS_AT_ONCE], calibration, settings["power"]),
            errors,
            settings["pseudo_observations"],
        )
        for start in range(0, len(rows), BELIEFS_AT_ONCE)
    ]
    return np.concatenate(costs)


def _shrunk(weights: NDArray[np.floating[Any]], errors: Table, alpha: float) -> Table:
    """Return the weighted mean error of each rotation (n, B), shrunk by alpha pseudo-observations.

    `weights` are (n, n_views), `errors` (B, n_views).
    """
    alpha = max(alpha, np.finfo(float).tiny)
    total = weights.astype(np.float32) @ errors.T + np.float32(alpha) * errors.mean(axis=1)
    of_all = weights.sum(axis=1, dtype=np.float64) + alpha
    return np.asarray(total / of_all[:, None], dtype=np.float32)
