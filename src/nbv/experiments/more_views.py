"""More views than two: error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg, travel_deg
from nbv.calibration.estimates import Estimates
from nbv.calibration.posteriors import Posteriors
from nbv.recommendation.belief import (
    Belief,
    first_belief,
    mean_direction_deg,
    multiplied,
    updated,
)
from nbv.recommendation.criteria import FOR_MORE_VIEWS
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.next_views import (
    COARSE_BINS,
    NextView,
    bisecting_next,
    evenly_spaced_next,
    random_next,
    recommended_next,
)
from nbv.recommendation.spacing import spaced_next

COLUMNS = ("method", "n_views", "object_id", "error_deg", "travel_deg")

Indices = NDArray[np.intp] | NDArray[np.int64]


class Views(Protocol):
    """What is seen of n objects from each of their azimuths, and how beliefs come of it."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of objects and of azimuths, then what else there is."""

    def first(self, objects: Indices, azimuths: Indices) -> Belief:
        """Return the beliefs after first views."""

    def further(
        self, belief: Belief, objects: Indices, azimuths: Indices, delta_deg: NDArray[np.int64]
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

    def first(self, objects: Indices, azimuths: Indices) -> Belief:
        """Return V[e] of each first estimate."""
        return first_belief(self.estimate_deg[objects, azimuths], self.evidence)

    def further(
        self, belief: Belief, objects: Indices, azimuths: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `nbv.recommendation.belief.updated`."""
        return updated(belief, self.estimate_deg[objects, azimuths], delta_deg, self.evidence)


@dataclass(frozen=True)
class DistributionViews:
    """Distributions (n_objects, n_views, B), fused by product; n_views is a multiple of B."""

    distributions: NDArray[np.float64]
    evidence: Evidence

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Views`."""
        return self.distributions.shape

    def first(self, objects: Indices, azimuths: Indices) -> Belief:
        """Return what the first images say."""
        return Belief(self.distributions[objects, azimuths].astype(np.float32), self.evidence)

    def further(
        self, belief: Belief, objects: Indices, azimuths: Indices, delta_deg: NDArray[np.int64]
    ) -> Belief:
        """Return `nbv.recommendation.belief.multiplied`."""
        return multiplied(belief, self.distributions[objects, azimuths], delta_deg)


def follow(
    policy: NextView,
    views: Views,
    *,
    n_views: int,
    start_every: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Follow a policy from several first views of each object.

    Parameters
    ----------
    policy : callable
        Chooses every next view.
    views : Views
        Of test objects, 360 an object.
    n_views : int
        Views in all.
    start_every : int
        Degrees between first views.
    rng : numpy.random.Generator
        Where a policy draws.

    Returns
    -------
    ndarray (2, n_objects, n_starts, n_views)
        Error and total travel after each view, degrees.
    """
    n_objects, n_azimuths = views.shape[:2]
    starts = np.tile(np.arange(0, n_azimuths, start_every), n_objects)
    objects = np.repeat(np.arange(n_objects), len(starts) // n_objects)
    belief = views.first(objects, starts)
    taken = np.zeros((len(objects), 1), dtype=np.int64)
    travelled = np.zeros(len(objects))
    reached = np.empty((2, len(objects), n_views))
    for view in range(n_views):
        if view:
            delta = policy(belief, taken, rng)
            belief = views.further(belief, objects, (starts + delta) % n_azimuths, delta)
            travelled = travelled + travel_deg(delta - taken[:, -1])
            taken = np.column_stack([taken, delta])
        pose_deg = mean_direction_deg(belief.probabilities)
        reached[0, :, view] = circular_distance_deg(pose_deg, starts)
        reached[1, :, view] = travelled
    return reached.reshape(2, n_objects, -1, n_views)


def more_views_rows(
    test: Estimates,
    evidences: Mapping[str, Callable[[int], Evidence]],
    settings: Mapping[str, Any],
    rng: np.random.Generator,
    posteriors: Posteriors | None = None,
    of_distributions: Evidence | None = None,
) -> pd.DataFrame:
    """Return error and travel of every policy, after each number of views, object by object.

    Parameters
    ----------
    test : Estimates
        Test objects, 360 views each.
    evidences : mapping of str to callable
        For ``random``, ``opposite`` and each criterion: its evidence for a number of bins. The
        pose ambiguity, which is defined for two views alone, is left out.
    settings : mapping
        The configuration's ``more_views``: ``n_views, start_every_deg, min_separation_deg``.
    rng : numpy.random.Generator
    posteriors, of_distributions : optional
        The test objects' distributions, and evidence of those of calibration objects: policies with
        the fusion ``product`` are added.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views. Travel goes from view to view, the shorter way.
    """
    rows: list[pd.DataFrame] = []
    every = range(1, settings["n_views"] + 1)
    apart_deg = settings["min_separation_deg"]

    def add(method: str, policy: NextView, views: Views, numbers: Sequence[int]) -> None:
        reached = follow(
            policy,
            views,
            n_views=numbers[-1],
            start_every=settings["start_every_deg"],
            rng=rng,
        ).mean(axis=2)
        for n in numbers:
            values = (method, n, test.object_ids, *reached[:, :, n - 1])
            rows.append(pd.DataFrame(dict(zip(COLUMNS, values, strict=True))))

    def of(name: str) -> Views:
        return EstimatedViews(test.estimate_deg, evidences[name](test.estimate_deg.shape[1]))

    add("random", random_next, of("random"), every)
    add("bisecting", bisecting_next, of("opposite"), every)
    for last in every:
        add("evenly_spaced", evenly_spaced_next(last), of("opposite"), [last])
    for criterion in FOR_MORE_VIEWS:
        if criterion in evidences:
            coarse = evidences[criterion](COARSE_BINS)
            add(criterion, recommended_next(criterion, coarse, apart_deg), of(criterion), every)
    if posteriors is not None and of_distributions is not None:
        seen = DistributionViews(posteriors.distributions, of_distributions)
        by_gain = recommended_next("information_gain", of_distributions, apart_deg)
        add("random_product", random_next, seen, every)
        add("information_gain_product", by_gain, seen, every)
        for last in every:
            add("evenly_spaced_product", evenly_spaced_next(last), seen, [last])
            spaced = spaced_next(of_distributions, last, apart_deg)
            add("expected_error_product", spaced, seen, [last])
    return pd.concat(rows, ignore_index=True)
