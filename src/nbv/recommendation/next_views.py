"""How every next view is chosen after any number of views, and over several elevations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg, nearest_bin, travel_deg
from nbv.recommendation.belief import Belief, coarser
from nbv.recommendation.criteria import CRITERIA
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.fusion import Rotations
from nbv.recommendation.lookup import least_cost_delta

BISECTING_DEG = (180, 90, 270, 45, 225, 135, 315)
COARSE_BINS = 120
"""Of the beliefs that criteria are asked about: 27 times faster than 360, and as good."""


NextView = Callable[[Belief, Rotations, np.random.Generator], Rotations]
"""A policy for any number of views: ``policy(belief, taken_deg, rng)`` is the next rotation (n,).

`belief` is of n poses in their first views; `taken_deg` (n, t) are the rotations of the views so
far. All rotations count from the first view, whose own is 0.
"""


def recommended_next(
    criterion: str, coarse: Evidence, min_separation_deg: float, n_views: int | None = None
) -> NextView:
    """Return the policy that takes the view of least cost.

    Parameters
    ----------
    criterion : str
        A name in `nbv.recommendation.criteria.FOR_MORE_VIEWS`.
    coarse : Evidence
        Of fewer bins than the beliefs; rotations are multiples of its bin.
    min_separation_deg : float
        From every view so far: an estimator errs alike from nearly the same place, and no
        criterion that takes views as independent can know.
    n_views : int, optional
        In all. Then they travel no farther than as many evenly spaced views; where too little
        travel is left for that, the nearest view is taken.
    """

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        cost = CRITERIA[criterion](coarser(belief, coarse), coarse, "posterior")
        bin_deg = 360.0 / coarse.n_bins
        rotations = np.arange(coarse.n_bins) * bin_deg
        apart = circular_distance_deg(taken_deg[:, :, None], rotations).min(axis=1)
        cost = np.where(apart < min_separation_deg, np.inf, cost)
        if n_views is None:
            return least_cost_delta(cost)
        travel = travel_deg(rotations - taken_deg[:, -1:])
        # Each view after the next one needs as much at the least.
        reserve = (n_views - 1 - taken_deg.shape[1]) * np.ceil(min_separation_deg / bin_deg)
        so_far = travel_deg(np.diff(taken_deg, axis=1)).sum(axis=1, keepdims=True)
        left = evenly_spaced_travel_deg(n_views) - reserve * bin_deg - so_far
        within = np.where(travel <= left, cost, np.inf)
        nearest = np.where(np.isfinite(cost), travel, np.inf)
        none = np.isinf(within).all(axis=1, keepdims=True)
        return least_cost_delta(np.where(none, nearest, within))

    return next_view


def evenly_spaced_travel_deg(n_views: int) -> float:
    """Return the travel of views 360° / n apart."""
    return (n_views - 1) * 360.0 / n_views


def random_next(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
    """Return the centre of a bin from which no view was taken, all equally likely."""
    n_bins = belief.probabilities.shape[1]
    free = np.ones((len(taken_deg), n_bins), dtype=bool)
    np.put_along_axis(free, nearest_bin(taken_deg, n_bins), values=False, axis=1)
    drawn = np.where(free, rng.random(free.shape), -1.0)
    return np.asarray(drawn.argmax(axis=1) * (360 // n_bins), dtype=np.int64)


def bisecting_next(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
    """Return the opposite view, then the quarters, then the eighths."""
    n, taken = taken_deg.shape
    return np.full(n, BISECTING_DEG[taken - 1], dtype=np.int64)


def evenly_spaced_next(n_views: int) -> NextView:
    """Return the policy that takes the next of `n_views` views spaced evenly, to the bin."""

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        n, taken = taken_deg.shape
        n_bins = belief.probabilities.shape[1]
        return np.full(n, round(taken * n_bins / n_views) * (360 // n_bins), dtype=np.int64)

    return next_view


def best_view(
    costs: Mapping[int, NDArray[np.floating[Any]]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rotation and the elevation of least cost, (n,) each.

    Parameters
    ----------
    costs : mapping of int to ndarray (n, B)
        By elevation; of equals the first elevation, there the smallest travel.
    """
    deltas = np.stack([least_cost_delta(cost) for cost in costs.values()])
    least = np.stack([cost.min(axis=1) for cost in costs.values()])
    best = least.argmin(axis=0)
    rows = np.arange(best.size)
    return deltas[best, rows], np.array(list(costs))[best].astype(np.int64)
