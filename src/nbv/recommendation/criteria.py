"""What a rotation is worth: ambiguity tables A[estimate, delta], lower is better.

Every criterion has the signature ``criterion(likelihoods, settings) -> A``.
All axis shifts are cyclic: turning the object by k bins rolls the tables by k.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.calibration.density import Likelihoods
from nbv.errors import UserError, nearest

Table = NDArray[np.float32]
Spread = Callable[[Table], NDArray[np.float32]]


def entropy(distributions: Table) -> NDArray[np.float32]:
    """Return the entropy of each row in nats, 0 log 0 being 0 (Eq. 1)."""
    tiny = np.finfo(np.float32).tiny
    logs = np.log(np.maximum(distributions, tiny))
    return np.asarray(-np.einsum("ij,ij->i", distributions, logs), dtype=np.float32)


def circular_variance(distributions: Table) -> NDArray[np.float32]:
    """Return 1 - |mean direction| of each row, in [0, 1]."""
    angles = 2 * np.pi * np.arange(distributions.shape[1]) / distributions.shape[1]
    cosine = distributions @ np.cos(angles).astype(np.float32)
    sine = distributions @ np.sin(angles).astype(np.float32)
    return np.asarray(1.0 - np.hypot(cosine, sine), dtype=np.float32)


SPREADS: dict[str, Spread] = {"entropy": entropy, "circular_variance": circular_variance}
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


def pose_ambiguity(likelihoods: Likelihoods, settings: Mapping[str, Any]) -> Table:
    """Return the paper's ambiguity of the pose seen from two viewpoints (Eqs. 1 to 6).

    ::

        p(theta | phi, delta) = T[phi, theta] T[phi + delta, theta + delta] / Z(phi, delta)
        p(theta | e, delta)   = sum_phi V[e, phi] p(theta | phi, delta)
        A[e, delta]           = G(p(. | e, delta))

    Parameters
    ----------
    likelihoods : Likelihoods
        B bins.
    settings : mapping
        ``reading`` (see `pose_likelihood`) and ``spread``, the name of G: ``entropy`` (nats) or
        ``circular_variance``.

    Returns
    -------
    ndarray (B, B) float32
        A[estimate, delta].
    """
    spread = SPREADS.get(settings["spread"])
    if spread is None:
        raise UserError(
            f"density.spread={settings['spread']}: {nearest(settings['spread'], SPREADS)}"
        )
    n_bins = likelihoods.n_bins
    viewpoint = likelihoods.viewpoint.astype(np.float32)
    first = pose_likelihood(likelihoods, settings["reading"])
    ambiguity = np.empty((n_bins, n_bins), dtype=np.float32)
    for delta in range(n_bins):
        ambiguity[:, delta] = spread(two_view_poses(viewpoint, first, delta))
    return ambiguity


Criterion = Callable[[Likelihoods, Mapping[str, Any]], Table]
CRITERIA: dict[str, Criterion] = {"entropy": pose_ambiguity}
