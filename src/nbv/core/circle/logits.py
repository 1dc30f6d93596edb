"""From a classifier's logits to distributions of the azimuth, with a temperature.

Class c of k is centred on 360 c / k degrees; the density is linear between the centres. It is per
degree, so that log-likelihoods (nats per degree) do not depend on k: the uniform density has
-log 360 = -5.886.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

LEAST_PROBABILITY = 1e-6
"""Floor of a class: no image excludes a pose for good, however sure the network is."""

TEMPERATURES = (0.05, 20.0)
"""Bounds of `fit_temperature`."""


def log_softmax(logits: NDArray[np.floating]) -> Floats:
    """Return the logs of softmax(logits) over the last axis."""
    # An import of half a second, which only jobs of a classifier need.
    from scipy import special

    return np.asarray(special.log_softmax(logits, axis=-1))


def softmax(logits: Floats) -> Floats:
    """Return exp(logits) divided by its sum along the last axis."""
    p = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(p / p.sum(axis=-1, keepdims=True))


def from_logits(logits: NDArray[np.floating], temperature: float) -> Floats:
    """Return softmax(logits / temperature) (..., k) with the floor `LEAST_PROBABILITY`."""
    return floored(softmax(logits.astype(np.float64) / temperature))


def floored(distributions: Floats) -> Floats:
    """Return distributions (..., B) with the floor `LEAST_PROBABILITY`."""
    p = np.maximum(distributions, LEAST_PROBABILITY)
    return np.asarray(p / p.sum(axis=-1, keepdims=True))


def on_degrees(posterior: Floats, n_bins: int = 360) -> Floats:
    """Resample distributions over classes (..., k) to bins (..., B), where k divides B."""
    n_classes = posterior.shape[-1]
    below, part = _neighbours(np.arange(n_bins) * (360.0 / n_bins), n_classes)
    above = (below + 1) % n_classes
    mixed = (1.0 - part) * posterior[..., below] + part * posterior[..., above]
    return np.asarray(mixed * (n_classes / n_bins))


def log_likelihood(log_posterior: NDArray[np.floating], azimuth_deg: ArrayLike) -> Floats:
    """Return the log densities (...) at azimuths, in nats per degree.

    `log_posterior` (..., k) are logs of distributions over classes; azimuths broadcast to (...).
    """
    n_classes = log_posterior.shape[-1]
    below, part = _neighbours(np.broadcast_to(azimuth_deg, log_posterior.shape[:-1]), n_classes)
    lower, upper = (
        np.take_along_axis(log_posterior, bins[..., None], axis=-1)[..., 0].astype(np.float64)
        for bins in (below, (below + 1) % n_classes)
    )
    with np.errstate(divide="ignore"):
        mixed = np.logaddexp(lower + np.log1p(-part), upper + np.log(part))
    return np.asarray(mixed + np.log(n_classes / 360.0))


def _neighbours(azimuth_deg: ArrayLike, n_classes: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the class centre at or below each azimuth, and the fraction towards the next."""
    classes = np.asarray(azimuth_deg, dtype=np.float64) * (n_classes / 360.0)
    below = np.floor(classes)
    return below.astype(np.intp) % n_classes, classes - below


def mean_log_likelihood(
    logits: NDArray[np.floating],
    azimuth_deg: ArrayLike,
    temperature: float,
    weight: Floats | None = None,
) -> float:
    """Return the mean log density of softmax(logits / temperature) at the true azimuths.

    In nats per degree; `logits`, `azimuth_deg` and `weight` are those of `fit_temperature`.
    """
    values = log_likelihood(log_softmax(logits / temperature), azimuth_deg)
    return float(values.mean() if weight is None else np.average(values, weights=weight))


def fit_temperature(logits: Floats, azimuth_deg: ArrayLike, weight: Floats | None = None) -> float:
    """Fit T of softmax(logits / T) to the true azimuths by maximum likelihood.

    T lies within `TEMPERATURES`; above 1 the network is overconfident.

    Parameters
    ----------
    logits : ndarray (..., k)
        Outputs for images that the network was not trained on.
    azimuth_deg : array-like, broadcasting to (...)
        True azimuths.
    weight : ndarray (...), optional
        Weight of each image.
    """
    return likeliest_temperature(lambda t: mean_log_likelihood(logits, azimuth_deg, t, weight))


def likeliest_temperature(log_likelihood_at: Callable[[float], float]) -> float:
    """Return the temperature within `TEMPERATURES` of the largest log-likelihood."""
    from scipy.optimize import minimize_scalar

    def loss(log_temperature: float) -> float:
        return -log_likelihood_at(float(np.exp(log_temperature)))

    bounds = tuple(np.log(TEMPERATURES))
    return float(np.exp(minimize_scalar(loss, bounds=bounds, method="bounded").x))
