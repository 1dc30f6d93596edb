"""Beliefs about a pose: from a network's logits, turned, fused and summed up."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from nbv.core.posteriors import LEAST_PROBABILITY, turned

ELEVATION_BANDWIDTH_DEG = 10.0


def distributions_of(logits: NDArray[np.floating], temperature: float) -> NDArray[np.float64]:
    """Return softmax(logits / temperature) (n, B), `LEAST_PROBABILITY` or more in every class."""
    scaled = logits.astype(np.float64) / temperature
    p = np.exp(scaled - scaled.max(axis=-1, keepdims=True))
    p = np.maximum(p / p.sum(axis=-1, keepdims=True), LEAST_PROBABILITY)
    return np.asarray(p / p.sum(axis=-1, keepdims=True))


def fused(
    distributions: NDArray[np.floating], rotations_deg: Sequence[float]
) -> NDArray[np.float64]:
    """Return the product (B,) of the distributions (n, B) of views, in the frame of the first view.

    Of one view it is the view's own distribution, which must sum to 1. ``rotations_deg`` are those
    from the first view to each one.
    """
    if len(distributions) == 1:
        return turned(distributions[0], rotations_deg[0])
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
    return np.asarray(np.log(turned(distributions, rotations_deg)).sum(axis=0))


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


def elevation_share(known_deg: NDArray[np.floating], elevation_deg: float) -> NDArray[np.float64]:
    """Return how much calibration turns (S,) count for frames of an elevation.

    A normal kernel of `ELEVATION_BANDWIDTH_DEG`, in which the nearest turn counts 1. A turn of
    unknown elevation (NaN) counts 1 too, and so do all turns for frames of unknown elevation.
    """
    if math.isnan(elevation_deg) or np.isnan(known_deg).all():
        return np.ones(len(known_deg))
    apart = ((known_deg - elevation_deg) / ELEVATION_BANDWIDTH_DEG) ** 2
    share = np.exp(-0.5 * (apart - np.nanmin(apart)))
    return np.asarray(np.nan_to_num(share, nan=1.0), dtype=np.float64)
