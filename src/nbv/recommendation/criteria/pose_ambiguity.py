"""The paper's ambiguity of the pose seen from two viewpoints."""

from __future__ import annotations

import numpy as np

from nbv.calibration.density import Likelihoods
from nbv.errors import UserError, nearest
from nbv.recommendation.criteria.spreads import SPREADS
from nbv.recommendation.evidence import Evidence, Table

READINGS = ("given_estimate", "given_truth")


def pose_likelihood(likelihoods: Likelihoods, reading: str) -> Table:
    """Return T[viewpoint, pose] = p(pose | viewpoint) under one of its two readings.

    ``given_estimate``: how spread the truth is when the estimator answers the viewpoint (T = V).
    ``given_truth``: how spread the answers are when the viewpoint is the truth (T = L).
    """
    if reading not in READINGS:
        raise UserError(f"density.reading={reading}: {nearest(reading, READINGS)}")
    chosen = likelihoods.viewpoint if reading == "given_estimate" else likelihoods.estimate
    return chosen.astype(np.float32)


def two_view_poses(viewpoint: Table, pose: Table, delta_bins: int) -> Table:
    """Return p(theta | estimate, delta) for one rotation (Eqs. 3 and 6).

    Parameters
    ----------
    viewpoint : ndarray (B, B) float32
        V[estimate, viewpoint].
    pose : ndarray (B, B) float32
        T[viewpoint, pose].
    delta_bins : int
        The rotation, in bins.

    Returns
    -------
    ndarray (B, B) float32
        Rows are distributions. Two answers that exclude each other say nothing about the pose.
    """
    product = pose * np.roll(pose, (-delta_bins, -delta_bins), axis=(0, 1))
    total = product.sum(axis=1)
    impossible = total <= 0
    if impossible.any():
        product[impossible] = 1.0 / len(pose)
        total[impossible] = 1.0
    return np.asarray((viewpoint / total) @ product)


def pose_ambiguity(evidence: Evidence, fusion: str) -> Table:
    """Return the paper's ambiguity of the pose seen from two viewpoints (Eqs. 1 to 6).

    ::

        p(theta | phi, delta) = T[phi, theta] T[phi + delta, theta + delta] / Z(phi, delta)
        p(theta | e, delta)   = sum_phi V[e, phi] p(theta | phi, delta)
        A[e, delta]           = G(p(. | e, delta))

    Parameters
    ----------
    evidence : Evidence
        B bins. Its settings' ``reading`` is described in `pose_likelihood`; ``spread`` is the name
        of G: ``entropy`` (nats) or ``circular_variance``.
    fusion : str
        Not used.

    Returns
    -------
    ndarray (B, B) float32
        A[estimate, delta].
    """
    name = evidence.settings["spread"]
    spread = SPREADS.get(name)
    if spread is None:
        raise UserError(f"density.spread={name}: {nearest(name, SPREADS)}")
    n_bins = evidence.n_bins
    first = pose_likelihood(evidence.likelihoods, evidence.settings["reading"])
    ambiguity = np.empty((n_bins, n_bins), dtype=np.float32)
    for delta in range(n_bins):
        ambiguity[:, delta] = spread(two_view_poses(evidence.viewpoint, first, delta))
    return ambiguity
