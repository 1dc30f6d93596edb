"""Simulation of any number of views: policies that choose the next view, and `follow`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import circular_distance_deg, nearest_bin, travel_deg
from nbv.core.circle.belief import Belief, first_belief
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.distributions import (
    NEGLIGIBLE_PROBABILITY,
    mean_direction_deg,
    product_of,
)
from nbv.core.circle.evidence import Evidence
from nbv.core.circle.fusion import Rotations
from nbv.core.circle.lookup import least_cost_delta

Floats = NDArray[np.floating]
Indices = NDArray[np.intp]

FOR_MORE_VIEWS = ("information_gain", "expected_dispersion", "bayes_error")
"""Criteria that are defined after any number of views."""

BISECTING_DEG = (180, 90, 270, 45, 225, 135, 315)

NextView = Callable[[Belief, Rotations, np.random.Generator], Rotations]
"""A policy for any number of views: ``policy(belief, taken_deg, rng)`` is the next rotation (n,).

`belief` is of n poses in the frames of their first views; `taken_deg` (n, t) are the rotations of
the views so far. All rotations count from the first view, whose rotation is 0.
"""


def updated(
    belief: Belief,
    estimate_deg: NDArray[np.float64],
    delta_deg: NDArray[np.int64],
    evidence: Evidence,
) -> Belief:
    """Update a belief by the estimate of another view, by Bayes' rule.

    Views are assumed to be independent given the pose. `delta_deg` (n,) is the rotation from the
    first view to that one, and the evidence that of the estimator that took it.
    """
    n_bins = evidence.n_bins
    rotated = nearest_bin(delta_deg, n_bins)[:, None] + np.arange(n_bins)
    likelihood = evidence.second[rotated, nearest_bin(estimate_deg, n_bins)[:, None]]
    product = belief.probabilities * likelihood
    rows = np.asarray(product / product.sum(axis=1, keepdims=True))
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def multiplied(belief: Belief, distributions: Floats, delta_deg: NDArray[np.int64]) -> Belief:
    """Update a belief by the distribution (n, B) of another view, in its frame; see `product_of`.

    `delta_deg` (n,) is the rotation from the first view to it, a multiple of 360 / B.
    """
    product = product_of(belief.probabilities, distributions, delta_deg)
    rows = (product / product.sum(axis=1, keepdims=True)).astype(np.float32)
    return replace(belief, probabilities=rows, n_views=belief.n_views + 1)


def coarser(belief: Belief, evidence: Evidence) -> Belief:
    """Return the belief in the wider bins of evidence of the same estimator.

    The quotient of the two numbers of bins must be an odd integer.
    """
    width = belief.probabilities.shape[1] // evidence.n_bins
    centred = np.roll(belief.probabilities, width // 2, axis=1)
    rows = centred.reshape(len(centred), evidence.n_bins, width).sum(axis=2)
    first_bin = belief.first_bin
    if first_bin is not None:
        first_bin = (first_bin + width // 2) // width % evidence.n_bins
    return Belief(np.asarray(rows), evidence, first_bin, belief.n_views)


def recommended_next(criterion: str, coarse: Evidence, min_separation_deg: float) -> NextView:
    """Return the policy that takes the view of least cost.

    Parameters
    ----------
    criterion : str
        A name in `FOR_MORE_VIEWS`.
    coarse : Evidence
        Evidence with fewer bins than the beliefs; rotations are multiples of its bin.
    min_separation_deg : float
        Smallest distance from all previous views: errors of neighbouring views are similar, but
        criteria assume that views are independent.
    """

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        cost = CRITERIA[criterion](coarser(belief, coarse), coarse, "posterior")
        bin_deg = 360.0 / coarse.n_bins
        rotations = np.arange(coarse.n_bins) * bin_deg
        apart = circular_distance_deg(taken_deg[:, :, None], rotations).min(axis=1)
        return least_cost_delta(np.where(apart < min_separation_deg, np.inf, cost))

    return next_view


def random_next(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
    """Draw a bin without a view so far, all equally likely, and return its centre."""
    n_bins = belief.probabilities.shape[1]
    free = np.ones((len(taken_deg), n_bins), dtype=bool)
    np.put_along_axis(free, nearest_bin(taken_deg, n_bins), values=False, axis=1)
    drawn = np.where(free, rng.random(free.shape), -1.0)
    return np.asarray(drawn.argmax(axis=1) * (360 // n_bins), dtype=np.int64)


def bisecting_next(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
    """Take the opposite view, then the quarters, then the eighths of the circle."""
    n, taken = taken_deg.shape
    return np.full(n, BISECTING_DEG[taken - 1], dtype=np.int64)


def evenly_spaced_next(n_views: int) -> NextView:
    """Return the policy of `n_views` evenly spaced views, rounded to bins."""

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        n, taken = taken_deg.shape
        n_bins = belief.probabilities.shape[1]
        return np.full(n, round(taken * n_bins / n_views) * (360 // n_bins), dtype=np.int64)

    return next_view


METRICS = (
    "error_deg",
    "travel_deg",
    "log_likelihood",
    "inside_50_percent",
    "inside_90_percent",
)
"""The results of `follow` for each number of views; the last three measure calibration."""


class Views(Protocol):
    """An estimator's outputs for sweeps of n objects, and the beliefs after them."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of objects, number of evenly spaced views, and the shape of an output."""

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return the beliefs after first views."""

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return the beliefs after another view, `delta_deg` from the first one."""


@dataclass(frozen=True)
class EstimatedViews:
    """Estimates (n_objects, n_views) in degrees; beliefs are updated with the evidence."""

    estimate_deg: NDArray[np.float64]
    evidence: Evidence

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Views`."""
        return self.estimate_deg.shape

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return V[e] for the first estimates."""
        return first_belief(self.estimate_deg[objects, views], self.evidence)

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `updated`."""
        return updated(belief, self.estimate_deg[objects, views], delta_deg, self.evidence)


@dataclass(frozen=True)
class DistributionViews:
    """Distributions (n_objects, n_views, B), which are multiplied; n_views is a multiple of B."""

    distributions: Floats
    evidence: Evidence

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Views`."""
        return self.distributions.shape

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return the distributions of the first images."""
        return Belief(self.distributions[objects, views].astype(np.float32), self.evidence)

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `multiplied`."""
        return multiplied(belief, self.distributions[objects, views], delta_deg)


def first_views(views: Views, start_every_deg: int) -> tuple[Indices, NDArray[np.int64], Belief]:
    """Return object, azimuth in degrees and belief of all first views, object by object."""
    n_objects, n_azimuths = views.shape[:2]
    azimuths = np.arange(0, 360, start_every_deg)
    objects = np.repeat(np.arange(n_objects), len(azimuths))
    starts = np.tile(azimuths, n_objects)
    return objects, starts, views.first(objects, nearest_bin(starts, n_azimuths))


def follow(
    policy: NextView,
    views: Views,
    *,
    n_views: int,
    start_every_deg: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Simulate a policy from several first views of each object.

    Parameters
    ----------
    policy : callable
        The policy for every next view.
    views : Views
        First views and rotations are multiples of 360 / their number.
    n_views : int
        Total number of views.
    start_every_deg : int
        Distance between first views.
    rng : numpy.random.Generator
        The policy's random numbers.

    Returns
    -------
    ndarray (5, n_objects, n_starts, n_views)
        `METRICS` after each view: error and total travel in degrees; the log density of the true
        pose, nats per degree; whether the regions of 50 and 90 % contain it, percent
        (`region_coverage`).
    """
    n_objects, n_azimuths = views.shape[:2]
    objects, starts, belief = first_views(views, start_every_deg)
    taken = np.zeros((len(objects), 1), dtype=np.int64)
    travelled = np.zeros(len(objects))
    reached = np.empty((len(METRICS), len(objects), n_views))
    for view in range(n_views):
        if view:
            delta = policy(belief, taken, rng)
            view_bins = nearest_bin(starts + delta, n_azimuths)
            belief = views.further(belief, objects, view_bins, delta)
            travelled = travelled + travel_deg(delta - taken[:, -1])
            taken = np.column_stack([taken, delta])
        error_deg = circular_distance_deg(mean_direction_deg(belief.probabilities), starts)
        reached[:, :, view] = [error_deg, travelled, *_calibration(belief, starts)]
    return reached.reshape(len(METRICS), n_objects, -1, n_views)


def region_coverage(
    probabilities: Floats, bins: NDArray[np.integer], level: float
) -> NDArray[np.float64]:
    """Return whether the highest-density region contains the truth `bins` (n,), in [0, 1].

    The region is the smallest set of bins (B) with the probability `level`, in (0, 1). Bins at its
    threshold belong to it in part, so that truths drawn from the distributions are inside with
    exactly the probability `level`.
    """
    at_truth = np.take_along_axis(probabilities, bins[:, None], axis=1)
    denser = np.where(probabilities > at_truth, probabilities, 0.0).sum(axis=1, dtype=np.float64)
    equal = np.where(probabilities == at_truth, probabilities, 0.0).sum(axis=1, dtype=np.float64)
    share = np.zeros(len(at_truth))
    np.divide(level - denser, equal, out=share, where=equal > 0)
    return np.clip(share, 0.0, 1.0)


def _calibration(belief: Belief, truth_deg: NDArray[np.int64]) -> Iterator[Floats]:
    n_bins = belief.probabilities.shape[1]
    bins = nearest_bin(truth_deg, n_bins)
    p_true = np.take_along_axis(belief.probabilities, bins[:, None], axis=1)[:, 0]
    yield np.log(np.maximum(p_true, NEGLIGIBLE_PROBABILITY) * (n_bins / 360.0))
    for level in (0.5, 0.9):
        yield 100.0 * region_coverage(belief.probabilities, bins, level)
