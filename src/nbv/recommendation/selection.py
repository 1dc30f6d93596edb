"""Choosing the density's smoothing and pseudo-observations by the decisions they lead to.

The density's own likelihood prefers sharp rows where estimates hardly ever occur, and an argmin
finds just those. So each candidate is judged by the two-view error of its recommendations on
calibration objects that its table was not built from; test objects are never seen.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg
from nbv.recommendation.fusion import average, second_look
from nbv.recommendation.lookup import LookupTable, build_lookup

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Choice:
    """The density settings chosen, and the error in degrees that each candidate made."""

    bandwidth_deg: float
    pseudo_observations: float
    candidate_error_deg: dict[tuple[float, float], float]


def chosen_lookup(
    estimate_deg: NDArray[np.float64], criterion: str, settings: Mapping[str, Any]
) -> LookupTable:
    """Build a lookup table with the density settings that decide best.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    criterion : str
    settings : mapping
        The configuration's ``density``: the criterion's own settings, the candidates
        ``bandwidths_deg`` and ``pseudo_observations``, and ``n_parts``.
    """
    choice = choose_density(
        estimate_deg,
        criterion,
        settings,
        bandwidths_deg=settings["bandwidths_deg"],
        pseudo_observations=settings["pseudo_observations"],
        n_parts=settings["n_parts"],
    )
    return build_lookup(
        estimate_deg,
        criterion,
        settings,
        bandwidth_deg=choice.bandwidth_deg,
        pseudo_observations=choice.pseudo_observations,
    )


def two_view_error_deg(
    estimate_deg: NDArray[np.float64], delta_deg: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the error after averaging two views.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n.
    delta_deg : ndarray (n_objects, n_views) int
        The rotation taken from each view; a multiple of 360 / n.

    Returns
    -------
    ndarray (n_objects, n_views), degrees in [0, 180]
    """
    n_views = estimate_deg.shape[1]
    fused = average(estimate_deg, second_look(estimate_deg, delta_deg), delta_deg)
    return circular_distance_deg(fused, np.arange(n_views) * (360.0 / n_views))


def choose_density(
    estimate_deg: NDArray[np.float64],
    criterion: str,
    settings: Mapping[str, Any],
    *,
    bandwidths_deg: Sequence[float],
    pseudo_observations: Sequence[float],
    n_parts: int = 5,
    n_bins: int = 120,
) -> Choice:
    """Cross-validate the decision over calibration objects.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        Calibration estimates.
    criterion, settings
        As in `nbv.recommendation.lookup.build_lookup`.
    bandwidths_deg, pseudo_observations : sequences of float
        The candidates are all pairs. Where there is but one, nothing is computed.
    n_parts : int
        Parts that the objects are divided into (every n-th object); fewer where there are fewer
        objects. One object alone cannot be cross-validated: the widest candidate is taken.
    n_bins : int
        Bins of the tables compared: coarser than the final one, which changes no choice among
        bandwidths well above 360 / n_bins degrees and costs (360 / n_bins)³ less.

    Returns
    -------
    Choice
        Least mean error; of equals, the largest bandwidth and then the most pseudo-observations.
    """
    candidates = sorted(itertools.product(bandwidths_deg, pseudo_observations), reverse=True)
    n_objects = len(estimate_deg)
    parts = min(n_parts, n_objects)
    if len(candidates) == 1 or parts < 2:
        return Choice(*candidates[0], candidate_error_deg={})
    part_of = np.arange(n_objects) % parts
    errors = {}
    for bandwidth, alpha in candidates:
        total = 0.0
        for part in range(parts):
            held_out = estimate_deg[part_of == part]
            table = build_lookup(
                estimate_deg[part_of != part],
                criterion,
                settings,
                bandwidth_deg=bandwidth,
                pseudo_observations=alpha,
                n_bins=n_bins,
            )
            total += two_view_error_deg(held_out, table.recommend(held_out)).sum()
        errors[bandwidth, alpha] = float(total / estimate_deg.size)
    best = min(errors, key=errors.__getitem__)
    log.info(
        "density: bandwidth %g deg, %g pseudo-observations (two-view error %.2f deg; worst %.2f)",
        *best,
        errors[best],
        max(errors.values()),
    )
    return Choice(*best, candidate_error_deg=errors)
