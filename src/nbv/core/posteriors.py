"""A classifier's own distributions p(azimuth | image): their temperature, likelihood and files.

Class c of k is centred on 360 c / k degrees; between the centres the density is linear. Densities
are over B one-degree bins (B = 360), so that log-likelihoods, in nats per degree, do not depend on
k and compare with those of V: the uniform density has -log 360 = -5.886.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import nearest_bin
from nbv.errors import UserError
from nbv.files import damaged, need_distributions, read_arrays, readable, write_arrays

Floats = NDArray[np.float64]

TEMPERATURES = (0.05, 20.0)
"""The least and the largest temperature that `fit_temperature` finds."""

LEAST_PROBABILITY = 1e-6
"""Of a class: no image excludes a pose for good, however sure a network is."""


def _log_softmax(logits: NDArray[np.floating]) -> Floats:
    # Half a second of imports, which only the jobs of a classifier need.
    from scipy.special import log_softmax

    return np.asarray(log_softmax(logits, axis=-1))


@dataclass(frozen=True)
class Posteriors:
    """Distributions for full turns of objects.

    Attributes
    ----------
    object_ids : tuple of str
        n objects.
    log_posterior : ndarray (n, n_views, k)
        log p(class | image) at the temperature; view v has the azimuth 360 v / n_views.
    temperature : float
        What the network's logits were divided by.
    """

    object_ids: tuple[str, ...]
    log_posterior: NDArray[np.floating]
    temperature: float

    @property
    def distributions(self) -> Floats:
        """p(class | image), (n, n_views, k): `LEAST_PROBABILITY` or more, before it sums to 1."""
        p = np.maximum(np.exp(self.log_posterior.astype(np.float64)), LEAST_PROBABILITY)
        return np.asarray(p / p.sum(axis=-1, keepdims=True))

    @property
    def as_trained(self) -> Floats:
        """The log of the distributions at a temperature of 1, (n, n_views, k)."""
        logits = self.log_posterior.astype(np.float64) * self.temperature
        return _log_softmax(logits)


def on_degrees(posterior: Floats, n_bins: int = 360) -> Floats:
    """Return distributions over bins (..., B) from distributions over classes (..., k).

    k divides B; bin b is centred on 360 b / B degrees.
    """
    n_classes = posterior.shape[-1]
    below, part = _neighbours(np.arange(n_bins) * (360.0 / n_bins), n_classes)
    above = (below + 1) % n_classes
    mixed = (1.0 - part) * posterior[..., below] + part * posterior[..., above]
    return np.asarray(mixed * (n_classes / n_bins))


def turned(rows: NDArray[np.floating], turn_deg: ArrayLike) -> NDArray[np.float64]:
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


def _neighbours(azimuth_deg: ArrayLike, n_classes: int) -> tuple[NDArray[np.intp], Floats]:
    """Return the class centre at or below each azimuth, and how far it lies towards the next."""
    place = np.asarray(azimuth_deg, dtype=np.float64) * (n_classes / 360.0)
    below = np.floor(place)
    return below.astype(np.intp) % n_classes, place - below


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


def mean_log_likelihood(
    logits: NDArray[np.floating],
    azimuth_deg: ArrayLike,
    temperature: float,
    weight: Floats | None = None,
) -> float:
    """Return the mean log density of softmax(logits / temperature) at azimuths, nats per degree.

    Parameters and ``weight`` as of `fit_temperature`.
    """
    values = log_likelihood(_log_softmax(logits / temperature), azimuth_deg)
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


def posteriors_of(object_ids: Sequence[str], logits: Floats, temperature: float) -> Posteriors:
    """Return the distributions softmax(logits / temperature) of full turns (n, n_views, k)."""
    return Posteriors(tuple(object_ids), _log_softmax(logits / temperature), temperature)


def write_posteriors(path: str | Path, posteriors: Posteriors) -> None:
    """Write distributions, their logs as float32."""
    write_arrays(
        path,
        {
            "object_ids": np.asarray(posteriors.object_ids, dtype=np.str_),
            "log_posterior": posteriors.log_posterior.astype(np.float32),
            "temperature": np.asarray(posteriors.temperature),
        },
    )


def read_posteriors(path: str | Path, object_ids: Sequence[str]) -> Posteriors:
    """Read what `write_posteriors` wrote.

    Raises
    ------
    UserError
        Where it is about other objects than those given, or in another order, or is damaged.
    """
    stored = read_arrays(path, ("object_ids", "log_posterior", "temperature"))
    names = tuple(str(name) for name in stored["object_ids"])
    if names != tuple(object_ids):
        raise UserError(f"{path}: not of the objects that the estimates are of; make both again")
    with readable(path):
        posteriors = Posteriors(names, stored["log_posterior"], float(stored["temperature"]))
        _, n_views, n_classes = posteriors.log_posterior.shape
        as_kept = np.exp(posteriors.log_posterior.astype(np.float64))
        need_distributions(path, as_kept, (len(names), n_views, n_classes))
        if not 0.0 < posteriors.temperature < np.inf:
            raise damaged(path, f"the temperature {posteriors.temperature} is not above 0")
    return posteriors
