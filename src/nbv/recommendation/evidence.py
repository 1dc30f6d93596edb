"""What is known of one estimator: its answers on calibration objects, and the densities of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.calibration.density import Likelihoods, likelihoods

Table = NDArray[np.float32]


@dataclass(frozen=True)
class Evidence:
    """What every criterion and every fusion rule may draw on.

    Attributes
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates; view k of n has the azimuth 360 k / n.
    likelihoods : Likelihoods
        V and L made of them, B bins; n must be a multiple of B where a criterion rotates views.
    bandwidth_deg, pseudo_observations : float
        The density's settings.
    settings : mapping
        The configuration's ``density``: what a criterion may be set by.
    made : dict
        What several criteria share, so that it is computed once; see `once`.
    """

    estimate_deg: NDArray[np.float64]
    likelihoods: Likelihoods
    bandwidth_deg: float
    pseudo_observations: float
    settings: Mapping[str, Any]
    made: dict[Any, Table] = field(default_factory=dict, repr=False, compare=False)

    def once(self, key: Any, make: Callable[[], Table]) -> Table:
        """Return what `make` makes, made at the first call with this key and kept in `made`."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    @property
    def n_bins(self) -> int:
        """B, the number of bins round the circle."""
        return self.likelihoods.n_bins

    @cached_property
    def viewpoint(self) -> Table:
        """V[estimate, viewpoint], (B, B) float32."""
        return self.likelihoods.viewpoint.astype(np.float32)

    @cached_property
    def second(self) -> Table:
        """L twice over, (2 B, B) float32: its rows delta to delta + B are L[theta + delta]."""
        return np.tile(self.likelihoods.estimate.astype(np.float32), (2, 1))

    @cached_property
    def moments(self) -> Table:
        """The posterior's first moment after any two estimates, (B, 2, B, B) float32.

        ``moments[delta, :, e1, e2]`` are the real and the imaginary part of
        sum_theta V[e1, theta] L[theta + delta, e2] exp(i theta): its direction is the posterior
        mean pose, its length the resultant length times p(e2 | e1, delta).
        """
        n_bins = self.n_bins
        angles = 2 * np.pi * np.arange(n_bins) / n_bins
        parts = [self.viewpoint * np.cos(angles), self.viewpoint * np.sin(angles)]
        # Stacked, one product of matrices serves both parts.
        stacked = np.concatenate(parts).astype(np.float32)
        moments = np.empty((n_bins, 2 * n_bins, n_bins), dtype=np.float32)
        for delta in range(n_bins):
            np.matmul(stacked, self.second[delta : delta + n_bins], out=moments[delta])
        return moments.reshape(n_bins, 2, n_bins, n_bins)


def gather_evidence(
    estimate_deg: NDArray[np.float64],
    settings: Mapping[str, Any],
    *,
    bandwidth_deg: float,
    pseudo_observations: float,
    n_bins: int = 360,
) -> Evidence:
    """Make evidence of calibration estimates.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        The estimate for every view; view k of n has the azimuth 360 k / n.
    settings : mapping
        Kept for the criteria.
    bandwidth_deg, pseudo_observations, n_bins
        See `nbv.calibration.density.likelihoods`.
    """
    n_views = estimate_deg.shape[1]
    azimuth_deg = np.broadcast_to(np.arange(n_views) * (360.0 / n_views), estimate_deg.shape)
    pair = likelihoods(
        estimate_deg,
        azimuth_deg,
        bandwidth_deg=bandwidth_deg,
        pseudo_observations=pseudo_observations,
        n_bins=n_bins,
    )
    return Evidence(estimate_deg, pair, bandwidth_deg, pseudo_observations, settings)
