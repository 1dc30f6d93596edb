"""Recommending from what one image says: a belief of its own in place of a row of V.

A belief is a distribution over B bins of the pose, for each of n images.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.angles import direction_deg, nearest_bin
from nbv.recommendation.criteria import Table, entropy
from nbv.recommendation.lookup import least_ambiguous_delta

Beliefs = NDArray[np.floating]

# Numbers in the largest array that `expected_entropy` makes at once: what fits into a cache.
_CHUNK = 2**18


def expected_entropy(beliefs: Beliefs, estimate_likelihood: NDArray[np.floating]) -> Table:
    """Return the expected entropy of the pose after the second look (design, section 3).

    With the pose theta, distributed as the belief b, and the second answer, distributed as
    L[theta + delta], the chain rule of entropy gives ::

        A_b[delta] = H(b) + sum_theta b(theta) H(L[theta + delta])
                     - H(sum_theta b(theta) L[theta + delta, .])

    for all rotations at once from one product of the circulant of b with L.

    Parameters
    ----------
    beliefs : ndarray (n, B), rows summing to 1
    estimate_likelihood : ndarray (B, B), rows summing to 1
        L[viewpoint, answer] = p(answer | viewpoint), of the estimator that answers the second look:
        of its estimates, or of classes drawn from its distributions
        (`nbv.calibration.posteriors.answer_likelihood`).

    Returns
    -------
    ndarray (n, B) float32
        A[image, delta] in nats.
    """
    n_images, n_bins = beliefs.shape
    seen = np.asarray(estimate_likelihood, dtype=np.float32)
    noise = entropy(seen)
    first = np.asarray(beliefs, dtype=np.float32)
    pose = (np.arange(n_bins) - np.arange(n_bins)[:, None]) % n_bins
    left = np.empty((n_images, n_bins), dtype=np.float32)
    step = max(1, _CHUNK // n_bins**2)
    for start in range(0, n_images, step):
        some = first[start : start + step]
        viewpoint = some[:, pose].reshape(-1, n_bins)  # [image and delta, second viewpoint]
        gained = entropy(viewpoint @ seen) - viewpoint @ noise
        left[start : start + step] = entropy(some)[:, None] - gained.reshape(len(some), n_bins)
    return left


def recommend(beliefs: Beliefs, estimate_likelihood: NDArray[np.floating]) -> NDArray[np.int64]:
    """Return the rotation that leaves each belief the least `expected_entropy`, in degrees.

    Returns
    -------
    ndarray (n,)
        In [0, 360); of equal minima the one of smallest travel, then the smaller.
    """
    return least_ambiguous_delta(expected_entropy(beliefs, estimate_likelihood))


def fuse_beliefs(
    first: Beliefs, second: Beliefs, delta_deg: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Return the mean direction of the pose given two images, in [0, 360) degrees.

    The direction of sum_theta b1(theta) b2(theta + delta) / p0 exp(i theta), the prior p0 of the
    pose being uniform. Bayes' rule gives this posterior where the two images are independent given
    the pose. They are not quite: both show the same object, and what is unusual about it misleads
    both looks alike, so the product is surer than it should be.

    Parameters
    ----------
    first, second : ndarray (n, B), rows summing to 1
        Beliefs from each image alone, each in the frame of its own view.
    delta_deg : ndarray (n,) int
        The rotations between them, multiples of 360 / B.

    Returns
    -------
    ndarray (n,)
        In the frame of the first view; its own mean direction where the two exclude each other.
    """
    n_bins = first.shape[1]
    bins = np.arange(n_bins)
    seen = (bins + nearest_bin(delta_deg, n_bins)[:, None]) % n_bins
    own = np.asarray(first, dtype=np.float64)
    both = own * np.take_along_axis(np.asarray(second, dtype=np.float64), seen, axis=1)
    both = np.where(both.sum(axis=1, keepdims=True) > 0, both, own)
    angles = 2 * np.pi * bins / n_bins
    return direction_deg(both @ np.cos(angles), both @ np.sin(angles))
