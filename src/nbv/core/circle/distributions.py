"""Distributions on the circle: rotate, multiply and summarise them.

A distribution has B probabilities; bin b is centred on 360 b / B degrees. `nbv.core.circle.logits`,
the only part that trainings need, makes distributions from logits.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import direction_deg, nearest_bin

Floats = NDArray[np.float64]

FLAT = 1e-5
"""Share of a distribution: a mean direction of a shorter resultant is rounding."""

NEGLIGIBLE_PROBABILITY = 1e-12
"""Floor before a logarithm: a smaller probability would be lost in rounding."""


def rotated(rows: NDArray[np.floating], rotation_deg: ArrayLike) -> Floats:
    """Return p(theta + rotation) as a function of theta, (..., B), for distributions (..., B).

    Exact for whole bins, linear in between. `rotation_deg` is a number, or an array with one
    rotation for each row.
    """
    n_bins = rows.shape[-1]
    rotation_bins = np.asarray(rotation_deg, dtype=np.float64) * (n_bins / 360.0)
    whole = np.floor(rotation_bins)
    part = (rotation_bins - whole)[..., None]
    index = (np.arange(n_bins) + whole.astype(np.intp)[..., None]) % n_bins
    shape = np.broadcast_shapes(rows.shape, index.shape)
    rows = np.broadcast_to(rows, shape)
    lower, upper = (
        np.take_along_axis(rows, np.broadcast_to(i, shape), axis=-1)
        for i in (index, (index + 1) % n_bins)
    )
    return np.asarray((1 - part) * lower + part * upper, dtype=np.float64)


def in_object_frame(sweep: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the distributions of a sweep (..., B, B), rotated so that bin 0 is the true pose.

    View k of B has the azimuth 360 k / B.
    """
    bins = np.arange(sweep.shape[-1])
    index = (bins + bins[:, None]) % len(bins)
    return np.take_along_axis(sweep, np.broadcast_to(index, sweep.shape), axis=-1)


def product_of(
    first: NDArray[np.floating[Any]],
    second: NDArray[np.floating[Any]],
    delta_deg: NDArray[np.floating[Any]] | NDArray[np.int64],
) -> NDArray[np.floating[Any]]:
    """Return first(theta) second(theta + delta), (n, B), in the frame of the first view.

    This is Bayes' rule for images that are independent given the pose, with a uniform prior. If the
    two distributions exclude each other, the result is `first`.
    """
    n_bins = first.shape[1]
    index = (np.arange(n_bins) + nearest_bin(delta_deg, n_bins).reshape(-1, 1)) % n_bins
    product = first * np.take_along_axis(second, index, axis=1)
    return np.where(product.sum(axis=1, keepdims=True) > 0, product, first)


def product_of_views(
    distributions: NDArray[np.floating], rotations_deg: Sequence[float]
) -> NDArray[np.float64]:
    """Return the product (B,) of the distributions (n, B) of n views, in the frame of the first.

    `rotations_deg` has the rotation from the first view to each view. The distribution of a single
    view, which must sum to 1, is only rotated.
    """
    if len(distributions) == 1:
        return rotated(distributions[0], rotations_deg[0])
    total = _log_product(distributions, rotations_deg)
    product = np.exp(total - total.max())
    return np.asarray(product / product.sum())


def log_bayes_factor(distributions: NDArray[np.floating], rotations_deg: Sequence[float]) -> float:
    """Return the log Bayes factor of one common pose against unrelated poses of n views, nats.

    It is log(B^(n - 1) sum_theta prod_i p_i(theta + rotation_i)), 0 for one view. With calibrated
    distributions and correct rotations it is below log t with a probability of at most t (Markov's
    inequality). The distributions (n, B) are above 0.
    """
    n, n_bins = distributions.shape
    if n == 1:
        return 0.0
    total = _log_product(distributions, rotations_deg)
    most = float(total.max())
    evidence = float(np.exp(total - most).sum())
    return most + math.log(evidence) + float(n - 1) * math.log(n_bins)


def _log_product(distributions: NDArray[np.floating], rotations_deg: Sequence[float]) -> Floats:
    return np.asarray(np.log(rotated(distributions, rotations_deg)).sum(axis=0))


def mean_direction_deg(
    probabilities: NDArray[np.floating[Any]], otherwise_deg: Floats | None = None
) -> Floats:
    """Return the mean directions (n,) of distributions (n, B), in [0, 360).

    Where the resultant is shorter than `FLAT`, it is `otherwise_deg` (n,); without it the likeliest
    bin, the first of those that differ by rounding alone.
    """
    n_bins = probabilities.shape[1]
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    cosine, sine = probabilities @ np.cos(angles), probabilities @ np.sin(angles)
    mean_deg = direction_deg(cosine, sine)
    is_flat = np.hypot(cosine, sine) <= FLAT * probabilities.sum(axis=1)
    if is_flat.any():
        if otherwise_deg is None:
            is_likeliest = probabilities >= (1 - FLAT) * probabilities.max(axis=1, keepdims=True)
            otherwise_deg = is_likeliest.argmax(axis=1) * (360.0 / n_bins)
        mean_deg = np.where(is_flat, otherwise_deg, mean_deg)
    return mean_deg


def product_directions_deg(
    first: NDArray[np.floating], second: NDArray[np.floating], otherwise_deg: ArrayLike
) -> Floats:
    """Return the mean direction of the product of each of n distributions with each of m.

    It is the direction of ``sum_u c(u) c'(u) exp(i u)`` for c of `first` (..., n, B) and c' of
    `second` (..., m, B) in the same frame, (..., n, m) in [0, 360): one matrix product serves all
    pairs. Where the resultant is shorter than `FLAT`, it is `otherwise_deg`, which broadcasts.
    """
    angles = 2 * np.pi * np.arange(first.shape[-1]) / first.shape[-1]
    parts = (np.cos(angles), np.sin(angles))
    others = np.swapaxes(second, -1, -2)
    cosine, sine = (first * part.astype(first.dtype) @ others for part in parts)
    is_flat = np.hypot(cosine, sine) <= FLAT * (first @ others)
    return np.where(is_flat, otherwise_deg, direction_deg(cosine, sine))


def direction_and_spread_deg(belief: NDArray[np.floating]) -> tuple[float, float]:
    """Return a belief's (B,) mean direction and circular standard deviation, degrees.

    The direction is in [-180, 180]. The standard deviation is sqrt(-2 log R) with the resultant
    length R.
    """
    n_bins = len(belief)
    moment = complex(belief @ np.exp(2j * np.pi * np.arange(n_bins) / n_bins))
    length = max(abs(moment), NEGLIGIBLE_PROBABILITY)
    spread = math.sqrt(max(-2.0 * math.log(length), 0.0))
    return math.degrees(cmath.phase(moment)), math.degrees(spread)


def estimate_likelihood(distributions: NDArray[np.floating]) -> Floats:
    """Return L[viewpoint, estimate] (k, k) for estimates drawn from the images' distributions.

    It is the mean of p(class | image) over all images of a viewpoint, as smooth as the
    distributions (n, n_views, k) and without a parameter. The n objects must be unknown to the
    network and have at least k views each.
    """
    _, n_views, n_classes = distributions.shape
    view_means = distributions.mean(axis=0)
    viewpoint = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_classes)
    sums = np.zeros((n_classes, n_classes))
    np.add.at(sums, viewpoint, view_means)
    return np.asarray(sums / sums.sum(axis=1, keepdims=True))
