"""Choosing the density by its own likelihood, as statistics would and decisions should not."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.angles import nearest_bin
from nbv.recommendation.evidence import gather_evidence
from nbv.recommendation.selection import COARSE_BINS, Choice


def most_likely_density(
    estimate_deg: NDArray[np.float64], settings: Mapping[str, Any], *, n_bins: int = COARSE_BINS
) -> Choice:
    """Cross-validate the log-likelihood of V over calibration objects.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    settings : mapping
        The configuration's ``density``, as in `nbv.recommendation.selection.choose_densities`.
    n_bins : int
        Of the densities compared.

    Returns
    -------
    Choice
        The candidate under which held-out viewpoints are likeliest given their estimates; of
        equals the widest. No two-view error is known of it.
    """
    candidates = sorted(
        itertools.product(settings["bandwidths_deg"], settings["pseudo_observations"]), reverse=True
    )
    n_objects, n_views = estimate_deg.shape
    parts = min(settings["n_parts"], n_objects)
    if len(candidates) == 1 or parts < 2:
        return Choice(*candidates[0], candidate_error_deg={})
    part_of = np.arange(n_objects) % parts
    azimuth = nearest_bin(np.arange(n_views) * (360.0 / n_views), n_bins)
    found = {}
    for bandwidth, alpha in candidates:
        total = 0.0
        for part in range(parts):
            held_out = estimate_deg[part_of == part]
            evidence = gather_evidence(
                estimate_deg[part_of != part],
                settings,
                bandwidth_deg=bandwidth,
                pseudo_observations=alpha,
                n_bins=n_bins,
            )
            chance = evidence.likelihoods.viewpoint[nearest_bin(held_out, n_bins), azimuth]
            total += np.log(np.maximum(chance, np.finfo(float).tiny)).sum()
        found[bandwidth, alpha] = total
    return Choice(*max(found, key=found.__getitem__), candidate_error_deg={})
