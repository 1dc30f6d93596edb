"""More than two views: what is believed of the pose after any number of looks.

A belief b(theta) starts as V[e1] and is multiplied by L[theta + delta_t, e_t] after each look,
theta always being the pose in the first view (design, section 3); or it is what an image says of
itself, where the estimator gives a distribution. A criterion over beliefs says
what each next rotation, counted from the first view, is worth; lower is better. At a belief V[e]
the information gain and the expected dispersion are row e of their lookup tables.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg, direction_deg, nearest_bin
from nbv.recommendation.criteria.pose_ambiguity import pose_likelihood, two_view_poses
from nbv.recommendation.criteria.spreads import SPREADS, entropy
from nbv.recommendation.evidence import Evidence

Beliefs = NDArray[np.float32]
Angles = NDArray[np.float64]

# Of the calibration views, in bins; neighbouring views tell much the same.
_STRIDE = 2
# Numbers in the largest array that a criterion makes of several beliefs at once: a cache full.
_CHUNK = 2**18


def first_beliefs(estimate_deg: Angles, evidence: Evidence) -> Beliefs:
    """Return V[e] for each first estimate, (n, B)."""
    return np.asarray(evidence.viewpoint[nearest_bin(estimate_deg, evidence.n_bins)])


def updated(
    beliefs: Beliefs, estimate_deg: Angles, delta_deg: NDArray[np.int64], evidence: Evidence
) -> Beliefs:
    """Return the beliefs after another look.

    Parameters
    ----------
    beliefs : ndarray (n, B)
        Rows sum to 1.
    estimate_deg : ndarray (n,)
        What the look said.
    delta_deg : ndarray (n,) int
        From the first view to the one looked from.
    evidence : Evidence
        Of the estimator that looked; B bins.

    Returns
    -------
    ndarray (n, B)
        Bayes' rule, the looks taken as independent given the pose.
    """
    n_bins = evidence.n_bins
    turn = nearest_bin(delta_deg, n_bins)[:, None] + np.arange(n_bins)
    likelihood = evidence.second[turn, nearest_bin(estimate_deg, n_bins)[:, None]]
    product = beliefs * likelihood
    return np.asarray(product / product.sum(axis=1, keepdims=True))


def mean_direction_deg(beliefs: Beliefs) -> Angles:
    """Return the mean direction of each belief, in [0, 360)."""
    angles = 2 * np.pi * np.arange(beliefs.shape[1]) / beliefs.shape[1]
    return direction_deg(beliefs @ np.cos(angles), beliefs @ np.sin(angles))


def coarser(beliefs: Beliefs, n_bins: int) -> Beliefs:
    """Return the same beliefs in fewer bins, a divisor of their number with an odd quotient."""
    width = beliefs.shape[1] // n_bins
    centred = np.roll(beliefs, width // 2, axis=1)
    return np.asarray(centred.reshape(len(beliefs), n_bins, width).sum(axis=2))


def fuse_beliefs(
    first: NDArray[np.floating[Any]],
    second: NDArray[np.floating[Any]],
    delta_deg: NDArray[np.int64],
) -> Angles:
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


def _predicted(beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return sum_theta b(theta) L[theta + delta, e2], (n, B, B): [belief, delta, e2]."""
    n_bins = evidence.n_bins
    # Row delta of a belief's circulant is b(theta - delta): delta moves b instead of L.
    windows = sliding_window_view(np.concatenate([beliefs, beliefs], axis=1), n_bins, axis=1)
    shifts = (-np.arange(n_bins)) % n_bins
    circulants = windows[:, shifts].reshape(-1, n_bins)
    predicted = circulants @ evidence.second[:n_bins]
    return np.asarray(predicted.reshape(len(beliefs), n_bins, n_bins))


def information_gain(beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return the expected entropy after a look at each rotation, nats, (n, B)."""
    n_beliefs, n_bins = beliefs.shape
    noise = entropy(evidence.second[:n_bins])
    turned = noise[(np.arange(n_bins)[:, None] + np.arange(n_bins)) % n_bins]
    predicted = _predicted(beliefs, evidence).reshape(-1, n_bins)
    left = entropy(beliefs)[:, None] + beliefs @ turned.T
    return np.asarray(left - entropy(predicted).reshape(n_beliefs, n_bins))


def _moments(beliefs: Beliefs, evidence: Evidence) -> tuple[Beliefs, Beliefs]:
    n_bins = evidence.n_bins
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    cosine, sine = (part.astype(np.float32) for part in (np.cos(angles), np.sin(angles)))
    return _predicted(beliefs * cosine, evidence), _predicted(beliefs * sine, evidence)


def expected_dispersion(beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return the expected circular dispersion after a look at each rotation, (n, B)."""
    real, imaginary = _moments(beliefs, evidence)
    return np.asarray(1.0 - np.sqrt(real**2 + imaginary**2).sum(axis=2))


def expected_error(beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return the expected error of the mean direction after a look at each rotation, degrees.

    Looks are those that calibration objects really gave, at every second bin; the pose is
    distributed as the belief.

    Returns
    -------
    ndarray (n, B)
    """
    n_bins = evidence.n_bins
    n_objects, n_views = evidence.estimate_deg.shape
    real, imaginary = _moments(beliefs, evidence)
    answer = np.degrees(np.arctan2(imaginary, real))
    pose = np.arange(0, n_bins, _STRIDE)
    looks = nearest_bin(evidence.estimate_deg[:, :: n_views // n_bins], n_bins)
    weights = beliefs[:, pose] / beliefs[:, pose].sum(axis=1, keepdims=True)
    expected = np.empty(beliefs.shape, dtype=np.float32)
    for delta in range(n_bins):
        seen = looks[:, (pose + delta) % n_bins]
        error = circular_distance_deg(answer[:, delta, seen], pose * (360.0 / n_bins))
        expected[:, delta] = np.einsum("nop,np->n", error, weights) / n_objects
    return expected


def pose_ambiguity(beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return the paper's ambiguity of each rotation, b taking the place of V[e], (n, B)."""
    spread = SPREADS[evidence.settings["spread"]]
    pose = pose_likelihood(evidence.likelihoods, evidence.settings["reading"])
    worth = [spread(two_view_poses(beliefs, pose, k)) for k in range(evidence.n_bins)]
    return np.stack(worth, axis=1)


BELIEF_CRITERIA: dict[str, Callable[[Beliefs, Evidence], Beliefs]] = {
    "entropy": pose_ambiguity,
    "information_gain": information_gain,
    "expected_dispersion": expected_dispersion,
    "expected_error": expected_error,
}


def worth(criterion: str, beliefs: Beliefs, evidence: Evidence) -> Beliefs:
    """Return what each rotation is worth under a criterion by name, a few beliefs at a time.

    Parameters
    ----------
    criterion : str
        A name in `BELIEF_CRITERIA`.
    beliefs : ndarray (n, B)
    evidence : Evidence
        Of the estimator that will look, in the beliefs' B bins.

    Returns
    -------
    ndarray (n, B), lower is better
    """
    at_once = max(1, _CHUNK // evidence.n_bins**2)
    parts = [beliefs[k : k + at_once] for k in range(0, len(beliefs), at_once)]
    return np.concatenate([BELIEF_CRITERIA[criterion](part, evidence) for part in parts])
