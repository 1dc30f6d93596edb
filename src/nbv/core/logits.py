"""From a classifier's logits to distributions over azimuths, and the temperature in between.

Class c of k is centred on 360 c / k degrees; between the centres the density is linear. Densities
are over one-degree bins, so that log-likelihoods, in nats per degree, do not depend on k: the
uniform density has -log 360 = -5.886.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

LEAST_PROBABILITY = 1e-6
"""Of a class: no image excludes a pose for good, however sure a network is."""

TEMPERATURES = (0.05, 20.0)
"""The least and the largest temperature that `fit_temperature` finds."""


def log_softmax(logits: NDArray[np.floating]) -> Floats:
    """Return the logs of softmax(logits) over the last axis."""
    # Half a second of imports, which only the jobs of a classifier need.
    from scipy.special import log_softmax as of_scipy

    return np.asarray(of_scipy(logits, axis=-1))


def softmax(logits: Floats) -> Floats:
    """Return exp(logits) over its sum, along the last axis."""
    p = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(p / p.sum(axis=-1, keepdims=True))


def from_logits(logits: NDArray[np.floating], temperature: float) -> Floats:
    """Return softmax(logits / temperature) (..., k), each class at `LEAST_PROBABILITY` or more."""
    return floored(softmax(logits.astype(np.float64) / temperature))


def floored(distributions: Floats) -> Floats:
    """Return distributions (..., B) with each class at `LEAST_PROBABILITY` or more."""
    p = np.maximum(distributions, LEAST_PROBABILITY)
    return np.asarray(p / p.sum(axis=-1, keepdims=True))


def on_degrees(posterior: Floats, n_bins: int = 360) -> Floats:
    """Return distributions over bins (..., B) from distributions over classes (..., k).

    k divides B; bin b is centred on 360 b / B degrees.
    """
    n_classes = posterior.shape[-1]
    below, part = _neighbours(np.arange(n_bins) * (360.0 / n_bins), n_classes)
    above = (below + 1) % n_classes
    mixed = (1.0 - part) * posterior[..., below] + part * posterior[..., above]
    return np.asarray(mixed * (n_classes / n_bins))


def log_likelihood(log_posterior: NDArray[np.floating], azimuth_deg: ArrayLike) -> Floats:
    """Return the log densities (...) at azimuths, in nats per degree.

    Parameters
    ----------
    log_posterior : ndarray (..., k)
        Logs of distributions over classes.
    azimuth_deg : array-like, broadcasting to (...)
    """
    n_classes = log_posterior.shape[-1]
    below, part = _neighbours(np.broadcast_to(azimuth_deg, log_posterior.shape[:-1]), n_classes)
    at = [
        np.take_along_axis(log_posterior, bins[..., None], axis=-1)[..., 0].astype(np.float64)
        for bins in (below, (below + 1) % n_classes)
    ]
    with np.errstate(divide="ignore"):
        mixed = np.logaddexp(at[0] + np.log1p(-part), at[1] + np.log(part))
    return np.asarray(mixed + np.log(n_classes / 360.0))


def _neighbours(azimuth_deg: ArrayLike, n_classes: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the class centre at or below each azimuth, and how far it lies towards the next."""
    place = np.asarray(azimuth_deg, dtype=np.float64) * (n_classes / 360.0)
    below = np.floor(place)
    return below.astype(np.intp) % n_classes, place - below


def mean_log_likelihood(
    logits: NDArray[np.floating],
    azimuth_deg: ArrayLike,
    temperature: float,
    weight: Floats | None = None,
) -> float:
    """Return the mean log density of softmax(logits / temperature) at azimuths, nats per degree.

    Parameters and ``weight`` as of `fit_temperature`.
    """
    values = log_likelihood(log_softmax(logits / temperature), azimuth_deg)
    return float(values.mean() if weight is None else np.average(values, weights=weight))


def fit_temperature(logits: Floats, azimuth_deg: ArrayLike, weight: Floats | None = None) -> float:
    """Return the T of softmax(logits / T) under which the true azimuths are likeliest.

    It lies within `TEMPERATURES`; above 1 the network was too sure of itself.

    Parameters
    ----------
    logits : ndarray (..., k)
        Of images that the network was not trained on.
    azimuth_deg : array-like, broadcasting to (...)
        The truth.
    weight : ndarray (...), optional
        How much each image counts.
    """
    from scipy.optimize import minimize_scalar

    def loss(log_temperature: float) -> float:
        return -mean_log_likelihood(logits, azimuth_deg, float(np.exp(log_temperature)), weight)

    bounds = tuple(np.log(TEMPERATURES))
    return float(np.exp(minimize_scalar(loss, bounds=bounds, method="bounded").x))
