"""Evidence about an estimator: its calibration estimates and their conditionals."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.density import Conditionals, conditionals
from nbv.core.circle.distributions import estimate_likelihood

Float32Array = NDArray[np.float32]

COARSE_BINS = 120
"""Bins of the evidence that chooses views: 27 times faster than 360, and as accurate."""


@dataclass(frozen=True)
class Evidence:
    """Calibration data of one estimator, shared by all criteria and fusion rules.

    Attributes
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates; view k of n has the azimuth 360 k / n. Empty if the conditionals are
        derived from distributions.
    conditionals : Conditionals
        V and L with B bins; n must be a multiple of B if a criterion rotates views.
    bandwidth_deg, pseudo_observations : float
        Parameters of the density.
    settings : mapping
        The configuration's ``density`` and ``affinity``, from which criteria take parameters.
    distributions : ndarray (n_objects, n_views, B) float32, optional
        p(azimuth | image) of calibration images, if the conditionals are derived from them.
    cache : dict
        Cache of `once`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> estimates = np.arange(0.0, 360.0, 10.0)[None]  # one object, always right
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> params = {"bandwidth_deg": 8, "pseudo_observations": 3, "n_bins": 36}
    >>> evidence = nbv.gather_evidence(estimates, density, **params)
    >>> evidence.n_bins, evidence.n_views
    (36, 36)
    """

    estimate_deg: NDArray[np.float64]
    conditionals: Conditionals
    bandwidth_deg: float
    pseudo_observations: float
    settings: Mapping[str, Any]
    distributions: NDArray[np.float32] | None = None
    cache: dict[Any, Float32Array] = field(default_factory=dict, repr=False, compare=False)

    def once(self, key: Any, make: Callable[[], Float32Array]) -> Float32Array:
        """Return the cached result of `make` for a key, computed by the first call."""
        if key not in self.cache:
            self.cache[key] = make()
        return self.cache[key]

    @property
    def n_bins(self) -> int:
        """B, the number of bins around the circle."""
        return self.conditionals.n_bins

    @property
    def n_views(self) -> int:
        """Number of views of each calibration object."""
        views = self.estimate_deg if self.distributions is None else self.distributions
        return int(views.shape[1])

    @cached_property
    def viewpoint(self) -> Float32Array:
        """V[estimate, viewpoint], (B, B) float32."""
        return self.conditionals.viewpoint.astype(np.float32)

    @cached_property
    def second(self) -> Float32Array:
        """L stacked twice, (2 B, B) float32, whose rows delta to delta + B are L[theta + delta]."""
        return np.tile(self.conditionals.estimate.astype(np.float32), (2, 1))

    @cached_property
    def moments(self) -> Float32Array:
        """`first_moments` of the rows of V for every rotation, (B, 2, B, B) float32.

        ``moments[delta, :, e1, e2]``: its direction is the posterior mean pose, its length the
        resultant length times p(e2 | e1, delta).
        """
        return self.first_moments(self.viewpoint, range(self.n_bins))

    def first_moments(self, probabilities: Float32Array, deltas: range) -> Float32Array:
        """Return the posteriors' first moments after each next estimate, (n_deltas, 2, n, B).

        These are the real and the imaginary part of sum_theta b(theta) L[theta + delta, e]
        exp(i theta) for distributions b (n, B) and rotations delta in bins.
        """
        n, n_bins = probabilities.shape
        angles = 2 * np.pi * np.arange(n_bins) / n_bins
        parts = [probabilities * np.cos(angles), probabilities * np.sin(angles)]
        # Stacked, so that one matrix product serves both parts.
        moments = self.predicted(np.concatenate(parts).astype(np.float32), deltas)
        return moments.reshape(len(deltas), 2, n, n_bins)

    def predicted(self, weights: Float32Array, deltas: range) -> Float32Array:
        """Return sum_theta w(theta) L[theta + delta, e], (n_deltas, n, B), for weights (n, B)."""
        n, n_bins = weights.shape
        sums = np.empty((len(deltas), n, n_bins), dtype=np.float32)
        for i, delta in enumerate(deltas):
            np.matmul(weights, self.second[delta : delta + n_bins], out=sums[i])
        return sums


def gather_evidence(
    estimate_deg: NDArray[np.float64],
    settings: Mapping[str, Any],
    *,
    bandwidth_deg: float,
    pseudo_observations: float,
    n_bins: int = 360,
) -> Evidence:
    """Build evidence from calibration estimates.

    Parameters
    ----------
    estimate_deg, settings
        See `Evidence`.
    bandwidth_deg, pseudo_observations, n_bins
        See `nbv.core.circle.density.conditionals`.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> estimates = np.arange(360.0)[None]  # one object, always right
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> nbv.gather_evidence(estimates, density, bandwidth_deg=8, pseudo_observations=3).n_bins
    360
    """
    n_views = estimate_deg.shape[1]
    azimuth_deg = np.broadcast_to(np.arange(n_views) * (360.0 / n_views), estimate_deg.shape)
    pair = conditionals(
        estimate_deg,
        azimuth_deg,
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        n_bins=n_bins,
    )
    return Evidence(estimate_deg, pair, bandwidth_deg, pseudo_observations, settings)


def evidence_of_distributions(
    distributions: NDArray[np.floating[Any]], settings: Mapping[str, Any]
) -> Evidence:
    """Build evidence from distributions (n_objects, n_views, B) of calibration images.

    Bins are the classifier's classes. The conditionals are not smoothed: distributions are smooth.
    So the bandwidth is 0, without pseudo-observations.
    """
    estimates = estimate_likelihood(distributions)
    pair = Conditionals(estimates.T / estimates.sum(axis=0)[:, None], estimates)
    views = distributions.astype(np.float32)
    return Evidence(np.empty((0, len(estimates))), pair, 0.0, 0.0, settings, views)
