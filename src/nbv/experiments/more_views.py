"""More views than two: error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg, travel_deg
from nbv.calibration.estimates import Estimates
from nbv.recommendation.belief import first_belief, mean_direction_deg, updated
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

COLUMNS = ("method", "n_views", "object_id", "error_deg", "travel_deg")


def follow(
    policy: NextView,
    test: Estimates,
    evidence: Evidence,
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
    test : Estimates
        360 views an object.
    evidence : Evidence
        360 bins; for the beliefs.
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
    estimate_deg = test.estimate_deg
    n_objects, n_azimuths = estimate_deg.shape
    starts = np.tile(np.arange(0, n_azimuths, start_every), n_objects)
    objects = np.repeat(np.arange(n_objects), len(starts) // n_objects)
    belief = first_belief(estimate_deg[objects, starts], evidence)
    taken = np.zeros((len(objects), 1), dtype=np.int64)
    travelled = np.zeros(len(objects))
    reached = np.empty((2, len(objects), n_views))
    for view in range(n_views):
        if view:
            delta = policy(belief, taken, rng)
            seen = estimate_deg[objects, (starts + delta) % n_azimuths]
            belief = updated(belief, seen, delta, evidence)
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

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views. Travel goes from view to view, the shorter way.
    """
    rows: list[pd.DataFrame] = []

    def add(method: str, policy: NextView, name: str, views: Sequence[int]) -> None:
        reached = follow(
            policy,
            test,
            evidences[name](test.estimate_deg.shape[1]),
            n_views=views[-1],
            start_every=settings["start_every_deg"],
            rng=rng,
        ).mean(axis=2)
        for n in views:
            values = (method, n, test.object_ids, *reached[:, :, n - 1])
            rows.append(pd.DataFrame(dict(zip(COLUMNS, values, strict=True))))

    every = range(1, settings["n_views"] + 1)
    add("random", random_next, "random", every)
    add("bisecting", bisecting_next, "opposite", every)
    for last in every:
        add("evenly_spaced", evenly_spaced_next(last), "opposite", [last])
    for criterion in FOR_MORE_VIEWS:
        if criterion in evidences:
            coarse = evidences[criterion](COARSE_BINS)
            policy = recommended_next(criterion, coarse, settings["min_separation_deg"])
            add(criterion, policy, criterion, every)
    return pd.concat(rows, ignore_index=True)
