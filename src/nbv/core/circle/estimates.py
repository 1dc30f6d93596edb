"""An estimator's output for full sweeps of objects: azimuths, or distributions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.logits import floored, log_softmax

Floats = NDArray[np.float64]

COLUMNS = ("object_id", "azimuth_deg", "estimate_deg")
"""The columns of a table of estimates."""


@dataclass(frozen=True)
class Estimates:
    """Azimuth estimates for full sweeps of n objects.

    Attributes
    ----------
    object_ids : tuple of str
    estimate_deg : ndarray (n, n_views) float64
        In [0, 360); view k has the azimuth 360 k / n_views.
    """

    object_ids: tuple[str, ...]
    estimate_deg: NDArray[np.float64]

    @property
    def azimuth_deg(self) -> NDArray[np.float64]:
        """The true azimuth of each view, (n_views,)."""
        n_views = self.estimate_deg.shape[1]
        return np.asarray(np.arange(n_views) * (360.0 / n_views))


@dataclass(frozen=True)
class Posteriors:
    """Distributions of the azimuth for full sweeps of n objects.

    Attributes
    ----------
    object_ids : tuple of str
    log_posterior : ndarray (n, n_views, k)
        log p(class | image) at the temperature; view v has the azimuth 360 v / n_views.
    temperature : float
        Divisor of the network's logits.
    """

    object_ids: tuple[str, ...]
    log_posterior: NDArray[np.floating]
    temperature: float

    @property
    def distributions(self) -> Floats:
        """p(class | image), (n, n_views, k), with the floor `LEAST_PROBABILITY`."""
        return floored(np.exp(self.log_posterior.astype(np.float64)))


def posteriors_of(object_ids: Sequence[str], logits: Floats, temperature: float) -> Posteriors:
    """Return softmax(logits / temperature) for the logits (n, n_views, k) of full sweeps."""
    return Posteriors(tuple(object_ids), log_softmax(logits / temperature), temperature)
