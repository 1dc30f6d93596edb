"""Distributions on the circle: rotate, multiply and summarise them.

A distribution has B probabilities; bin b is centred on 360 b / B degrees.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import direction_deg, nearest_bin

Floats = NDArray[np.float64]


def rotated(rows: NDArray[np.floating], turn_deg: ArrayLike) -> NDArray[np.float64]:
    """Return p(theta + turn) as a function of theta, (..., B), of distributions (..., B).

    Exact for whole bins; linear in between. ``turn_deg`` is one for all, or one for each row. For
    the number 0.0 the result may be the argument itself.
    """
    if isinstance(turn_deg, float) and turn_deg == 0.0:  # a single frame, mostly
        return np.asarray(rows, dtype=np.float64)
    n_bins = rows.shape[-1]
    place = np.asarray(turn_deg, dtype=np.float64) * (n_bins / 360.0)
    below = np.floor(place)
    part = (place - below)[..., None]
    index = (np.arange(n_bins) + below.astype(np.intp)[..., None]) % n_bins
    shape = np.broadcast_shapes(rows.shape, index.shape)
    own = np.broadcast_to(rows, shape)
    at = (np.broadcast_to(each, shape) for each in (index, (index + 1) % n_bins))
    here, next_ = (np.take_along_axis(own, each, axis=-1) for each in at)
    return np.asarray((1 - part) * here + part * next_, dtype=np.float64)


def product_of(
    own: NDArray[np.floating[Any]],
    other: NDArray[np.floating[Any]],
    delta_deg: NDArray[np.floating[Any]] | NDArray[np.int64],
) -> NDArray[np.floating[Any]]:
    """Return own(theta) other(theta + delta), (n, B), in the frame of the first view.

    Bayes' rule for images that are independent given the pose, with a uniform prior. Where the two
    distributions exclude each other it is the own one.
    """
    n_bins = own.shape[1]
    seen = (np.arange(n_bins) + nearest_bin(delta_deg, n_bins).reshape(-1, 1)) % n_bins
    both = own * np.take_along_axis(other, seen, axis=1)
    return np.where(both.sum(axis=1, keepdims=True) > 0, both, own)


def product_of_views(
    distributions: NDArray[np.floating], rotations_deg: Sequence[float]
) -> NDArray[np.float64]:
    """Return the product (B,) of the distributions (n, B) of views, in the frame of the first view.

    Of one view it is the view's own distribution, which must sum to 1. ``rotations_deg`` are those
    from the first view to each one.
    """
    if len(distributions) == 1:
        return rotated(distributions[0], rotations_deg[0])
    total = _log_product(distributions, rotations_deg)
    product = np.exp(total - total.max())
    return np.asarray(product / product.sum())


def log_bayes_factor(distributions: NDArray[np.floating], rotations_deg: Sequence[float]) -> float:
    """Return how much more probable views are of one pose than of unrelated poses.

    The natural logarithm of B^(n - 1) sum_theta prod_i p_i(theta + rotation_i); 0 for one view.
    Where distributions are calibrated and the rotations right, it is below log t with a probability
    of t at the most (Markov's inequality).

    Parameters
    ----------
    distributions : (n, B)
        Above 0.
    rotations_deg : sequence of float
        From the first view to each one.
    """
    n, n_bins = distributions.shape
    if n == 1:
        return 0.0
    total = _log_product(distributions, rotations_deg)
    most = float(total.max())
    evidence = float(np.exp(total - most).sum())
    return most + math.log(evidence) + float(n - 1) * math.log(n_bins)


def _log_product(
    distributions: NDArray[np.floating], rotations_deg: Sequence[float]
) -> NDArray[np.float64]:
    return np.asarray(np.log(rotated(distributions, rotations_deg)).sum(axis=0))


def mean_direction_deg(probabilities: NDArray[np.floating[Any]]) -> Floats:
    """Return the mean direction of each distribution (n, B), in [0, 360)."""
    angles = 2 * np.pi * np.arange(probabilities.shape[1]) / probabilities.shape[1]
    return direction_deg(probabilities @ np.cos(angles), probabilities @ np.sin(angles))


def direction_and_spread_deg(belief: NDArray[np.floating]) -> tuple[float, float]:
    """Return a belief's (B,) mean direction and circular standard deviation, degrees.

    The direction is in [-180, 180]. The standard deviation is sqrt(-2 log R), where R is the
    resultant length.
    """
    moment = complex(belief @ _unit_vectors(len(belief)))
    spread = math.sqrt(max(-2.0 * math.log(max(abs(moment), 1e-12)), 0.0))
    return math.degrees(cmath.phase(moment)), math.degrees(spread)


@cache
def _unit_vectors(n_bins: int) -> NDArray[np.complex128]:
    return np.asarray(np.exp(2j * np.pi * np.arange(n_bins) / n_bins))


def region_coverage(
    probabilities: NDArray[np.floating], bins: NDArray[np.integer], level: float
) -> Floats:
    """Return whether the densest region of a probability holds the truth, (n,) in [0, 1].

    The region is the smallest set of bins with the probability `level`. It holds a part of the bins
    that are just dense enough, so that of truths drawn from the distributions themselves exactly
    the share `level` is inside.

    Parameters
    ----------
    probabilities : ndarray (n, B)
    bins : ndarray (n,) int
        Of the truth.
    level : float
        In (0, 1).
    """
    own = np.take_along_axis(probabilities, bins[:, None], axis=1)
    denser = np.where(probabilities > own, probabilities, 0.0).sum(axis=1, dtype=np.float64)
    alike = np.where(probabilities == own, probabilities, 0.0).sum(axis=1, dtype=np.float64)
    share = np.zeros(len(own))
    np.divide(level - denser, alike, out=share, where=alike > 0)
    return np.clip(share, 0.0, 1.0)


def estimate_likelihood(distributions: NDArray[np.floating]) -> Floats:
    """Return L[viewpoint, estimate] (k, k) of estimates that are drawn from images' distributions.

    The mean of p(class | image) over all images of a viewpoint, which is as smooth as the
    distributions (n, n_views, k) and has no setting. They are of objects that the network was not
    trained on, with at least k views each.
    """
    _, n_views, n_classes = distributions.shape
    of_view = distributions.mean(axis=0)
    viewpoint = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_classes)
    sums = np.zeros((n_classes, n_classes))
    np.add.at(sums, viewpoint, of_view)
    return np.asarray(sums / sums.sum(axis=1, keepdims=True))
