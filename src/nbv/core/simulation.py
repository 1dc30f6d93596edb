"""Following a policy from view to view."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg, nearest_bin, travel_deg
from nbv.core.belief import Belief, first_belief, multiplied, updated
from nbv.core.distributions import mean_direction_deg, region_coverage
from nbv.core.evidence import Evidence
from nbv.core.next_views import NextView

Floats = NDArray[np.floating]
Indices = NDArray[np.intp]

FIGURES = (
    "error_deg",
    "travel_deg",
    "log_likelihood",
    "inside_50_percent",
    "inside_90_percent",
)
"""What `follow` returns of each view: among others how well the belief knows the truth."""

# Of a belief in the truth; less would be lost in rounding, and one view would rule a mean.
_LEAST_PROBABILITY = 1e-12


class Views(Protocol):
    """What is seen of n objects from each of their views, and how beliefs come of it."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of objects and of evenly spaced views, then what else there is."""

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return the beliefs after first views."""

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return the beliefs after one view more, `delta_deg` from the first one."""


@dataclass(frozen=True)
class EstimatedViews:
    """Estimates (n_objects, n_views) in degrees, fused by posterior with the evidence."""

    estimate_deg: NDArray[np.float64]
    evidence: Evidence

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Views`."""
        return self.estimate_deg.shape

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return V[e] of each first estimate."""
        return first_belief(self.estimate_deg[objects, views], self.evidence)

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `nbv.core.belief.updated`."""
        return updated(belief, self.estimate_deg[objects, views], delta_deg, self.evidence)


@dataclass(frozen=True)
class DistributionViews:
    """Distributions (n_objects, n_views, B), fused by product; n_views is a multiple of B."""

    distributions: Floats
    evidence: Evidence

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Views`."""
        return self.distributions.shape

    def first(self, objects: Indices, views: Indices) -> Belief:
        """Return what the first images say."""
        return Belief(self.distributions[objects, views].astype(np.float32), self.evidence)

    def further(
        self, belief: Belief, objects: Indices, views: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `nbv.core.belief.multiplied`."""
        return multiplied(belief, self.distributions[objects, views], delta_deg)


def first_views(views: Views, start_every_deg: int) -> tuple[Indices, NDArray[np.int64], Belief]:
    """Return object, azimuth in degrees and belief of every first view, object by object."""
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
    """Follow a policy from several first views of each object.

    Parameters
    ----------
    policy : callable
        Chooses every next view.
    views : Views
        First views and rotations are multiples of 360 / their number.
    n_views : int
        Views in all.
    start_every_deg : int
        Between first views.
    rng : numpy.random.Generator
        Where a policy draws.

    Returns
    -------
    ndarray (5, n_objects, n_starts, n_views)
        `FIGURES` after each view: error and total travel in degrees; the log of the belief in the
        truth, nats per degree; whether the regions of 50 and 90 % hold the truth, percent
        (`nbv.core.distributions.region_coverage`).
    """
    n_objects, n_azimuths = views.shape[:2]
    objects, starts, belief = first_views(views, start_every_deg)
    taken = np.zeros((len(objects), 1), dtype=np.int64)
    travelled = np.zeros(len(objects))
    reached = np.empty((len(FIGURES), len(objects), n_views))
    for view in range(n_views):
        if view:
            delta = policy(belief, taken, rng)
            seen_from = nearest_bin(starts + delta, n_azimuths)
            belief = views.further(belief, objects, seen_from, delta)
            travelled = travelled + travel_deg(delta - taken[:, -1])
            taken = np.column_stack([taken, delta])
        reached[:, :, view] = [_error_deg(belief, starts), travelled, *_knowledge(belief, starts)]
    return reached.reshape(len(FIGURES), n_objects, -1, n_views)


def _error_deg(belief: Belief, truth_deg: NDArray[np.int64]) -> Floats:
    return circular_distance_deg(mean_direction_deg(belief.probabilities), truth_deg)


def _knowledge(belief: Belief, truth_deg: NDArray[np.int64]) -> Iterator[Floats]:
    n_bins = belief.probabilities.shape[1]
    bins = nearest_bin(truth_deg, n_bins)
    of_truth = np.take_along_axis(belief.probabilities, bins[:, None], axis=1)[:, 0]
    yield np.log(np.maximum(of_truth, _LEAST_PROBABILITY) * (n_bins / 360.0))
    for level in (0.5, 0.9):
        yield 100.0 * region_coverage(belief.probabilities, bins, level)
