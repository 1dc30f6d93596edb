"""How every next view is chosen after any number of views."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg, nearest_bin, travel_deg
from nbv.core.belief import Belief, coarser
from nbv.core.criteria import CRITERIA
from nbv.core.evidence import Evidence
from nbv.core.fusion import Rotations
from nbv.core.lookup import least_cost_delta

# Of sums of angles.
_ROUNDING_DEG = 1e-6

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
        A name in `nbv.core.criteria.FOR_MORE_VIEWS`.
    coarse : Evidence
        Of fewer bins than the beliefs; rotations are multiples of its bin.
    min_separation_deg : float
        From every view so far: an estimator errs alike from nearly the same place, and no
        criterion that takes views as independent can know.
    n_views : int, optional
        In all. Then they travel no farther than as many evenly spaced views.
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
        travel += travel_deg(np.diff(taken_deg, axis=1)).sum(axis=1, keepdims=True)
        n_more = n_views - 1 - taken_deg.shape[1]
        travel += shortest_walk_deg(taken_deg, coarse.n_bins, n_more, min_separation_deg)
        return least_cost_delta(
            np.where(travel <= evenly_spaced_travel_deg(n_views) + _ROUNDING_DEG, cost, np.inf)
        )

    return next_view


def shortest_walk_deg(
    taken_deg: Rotations, n_bins: int, n_more: int, min_separation_deg: float
) -> NDArray[np.float64]:
    """Return the travel that more views need at the most, from each next rotation, (n, B) degrees.

    They are taken on the way round from there, one way or the other, each as soon as it is far
    enough from all others. inf where there is no room for them.

    Parameters
    ----------
    taken_deg : ndarray (n, t)
        Rotations of the views so far.
    n_bins : int
        B; rotations are multiples of 360 / B.
    n_more : int
        Views after the next one.
    min_separation_deg : float
    """
    different, row_of = np.unique(taken_deg, axis=0, return_inverse=True)
    rotations = np.arange(n_bins) * (360.0 / n_bins)
    apart = circular_distance_deg(different[:, :, None], rotations).min(axis=1)
    free, step = apart >= min_separation_deg, math.ceil(min_separation_deg * n_bins / 360.0)
    walks = []
    for way in (1, -1):
        found, last = np.zeros(free.shape, dtype=int), np.zeros(free.shape, dtype=int)
        for walked in range(1, n_bins + 1 - step):
            ahead = np.roll(free, -way * walked, axis=1)
            here = ahead & (walked - last >= step) & (found < n_more)
            found, last = found + here, np.where(here, walked, last)
        walks.append(np.where(found == n_more, last * (360.0 / n_bins), np.inf))
    return np.asarray(np.minimum(*walks)[row_of.ravel()])


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
