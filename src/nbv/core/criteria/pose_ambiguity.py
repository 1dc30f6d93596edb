"""The paper's ambiguity of the pose seen from two viewpoints."""

from __future__ import annotations

import numpy as np

from nbv.core.belief import Belief
from nbv.core.criteria.rotations import rotation_groups
from nbv.core.criteria.spreads import SPREADS
from nbv.core.density import Conditionals
from nbv.core.evidence import Evidence, Table
from nbv.errors import UserError, nearest

POSE_LIKELIHOODS = ("given_estimate", "given_truth")


def pose_likelihood(conditionals: Conditionals, name: str) -> Table:
    """Return T[viewpoint, pose] = p(pose | viewpoint) under one of its two interpretations.

    ``given_estimate``: how spread the truth is when the viewpoint is the estimate (T = V).
    ``given_truth``: how spread the estimates are when the viewpoint is the truth (T = L).
    """
    if name not in POSE_LIKELIHOODS:
        raise UserError(f"density.pose_likelihood={name}: {nearest(name, POSE_LIKELIHOODS)}")
    of_name = conditionals.viewpoint if name == "given_estimate" else conditionals.estimate
    return of_name.astype(np.float32)


def two_view_poses(viewpoint: Table, pose: Table, delta_bins: int) -> Table:
    """Return p(theta | estimate, delta) for one rotation (Eqs. 3 and 6).

    Parameters
    ----------
    viewpoint : ndarray (n, B) float32
        V[estimate, viewpoint].
    pose : ndarray (B, B) float32
        T[viewpoint, pose] of the estimator that takes both views.
    delta_bins : int
        The rotation, in bins.

    Returns
    -------
    ndarray (n, B) float32
        Rows are distributions. Two estimates that exclude each other say nothing about the pose.
    """
    return _mixed(viewpoint, pose, np.roll(pose, (-delta_bins, -delta_bins), axis=(0, 1)))


def _mixed(viewpoint: Table, first: Table, second: Table) -> Table:
    """Return Eq. 6 of both factors in the frame of the first view, mixed by Eq. 3."""
    product = first * second
    total = product.sum(axis=1)
    impossible = total <= 0
    if impossible.any():
        product[impossible] = 1.0 / len(product)
        total[impossible] = 1.0
    return np.asarray((viewpoint / total) @ product)


def pose_ambiguity(belief: Belief, evidence: Evidence, fusion: str) -> Table:
    """Return the paper's ambiguity of the pose seen from two viewpoints (Eqs. 1 to 6).

    With T of the estimator that took the first view, T' of the one that takes the second, and the
    belief b (V[e] for an estimate e) ::

        p(theta | phi, delta) = T[phi, theta] T'[phi + delta, theta + delta] / Z(phi, delta)
        p(theta | b, delta)   = sum_phi b(phi) p(theta | phi, delta)
        A[b, delta]           = G(p(. | b, delta))

    Parameters as in `nbv.core.criteria`; `fusion` is not used. The evidence's settings
    are ``pose_likelihood`` (see `pose_likelihood`) and ``spread``, the name of G: ``entropy``
    (nats) or ``circular_variance`` (0 to 1).

    Raises
    ------
    ValueError
        After more than one view: Eq. 6 has one factor for each of two views.
    """
    if belief.n_views != 1:
        raise ValueError(f"pose_ambiguity is defined for two views, not {belief.n_views + 1}")
    name, of_what = evidence.settings["spread"], evidence.settings["pose_likelihood"]
    spread = SPREADS.get(name)
    if spread is None:
        raise UserError(f"density.spread={name}: {nearest(name, SPREADS)}")
    rows, n_bins = belief.probabilities, evidence.n_bins
    first = pose_likelihood(belief.evidence.conditionals, of_what)
    second = pose_likelihood(evidence.conditionals, of_what)
    # Twice over, every rotation is a view of it; unlike np.tile this keeps the order in memory.
    twice = np.concatenate([np.concatenate([second, second])] * 2, axis=1)
    ambiguity = np.empty(rows.shape, dtype=np.float32)
    for deltas in rotation_groups(n_bins, rows.size):
        poses = [_mixed(rows, first, twice[d : d + n_bins, d : d + n_bins]) for d in deltas]
        spreads = spread(np.concatenate(poses)).reshape(len(deltas), len(rows))
        ambiguity[:, deltas.start : deltas.stop] = spreads.T
    return ambiguity
