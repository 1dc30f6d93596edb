"""Choosing the density by its own likelihood, as statistics would and decisions should not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.angles import nearest_bin
from nbv.recommendation.density_selection import (
    COARSE_BINS,
    Choice,
    density_candidates,
    density_trials,
)


def most_likely_density(
    estimate_deg: NDArray[np.float64], settings: Mapping[str, Any], *, n_bins: int = COARSE_BINS
) -> Choice:
    """Cross-validate the log-likelihood of V over calibration objects.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    settings : mapping
        The configuration's ``density``, as in `choose_densities`.
    n_bins : int
        Of the densities compared.

    Returns
    -------
    Choice
        The candidate under which held-out viewpoints are likeliest given their estimates; of
        equals the widest. No two-view error is known of it.
    """
    n_views = estimate_deg.shape[1]
    azimuth = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_bins)
    found = dict.fromkeys(density_candidates(settings), 0.0)
    for trial in density_trials(estimate_deg, settings, n_bins):
        rows = nearest_bin(estimate_deg[trial.held_out], n_bins)
        chance = trial.evidence.likelihoods.viewpoint[rows, azimuth]
        found[trial.candidate] += np.log(np.maximum(chance, np.finfo(float).tiny)).sum()
    return Choice(*max(found, key=found.__getitem__), candidate_error_deg={})
