"""Looking again and again: error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg, travel_deg
from nbv.calibration.estimates import Estimates
from nbv.recommendation.belief import (
    BELIEF_CRITERIA,
    Beliefs,
    coarser,
    first_beliefs,
    mean_direction_deg,
    updated,
    worth,
)
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.fusion import Rotations
from nbv.recommendation.lookup import least_ambiguous_delta

COLUMNS = ("method", "n_views", "object_id", "error_deg", "travel_deg")
BISECTING_DEG = (180, 90, 270, 45, 225, 135, 315)
COARSE_BINS = 120


@dataclass(frozen=True)
class Walk:
    """What is known when the next view is chosen.

    Attributes
    ----------
    beliefs : ndarray (n, B)
        Of the pose in the first view.
    taken_deg : ndarray (n, t) int
        Rotations of the views so far, counted from the first, which is 0.
    """

    beliefs: Beliefs
    taken_deg: Rotations


Step = Callable[[Walk, np.random.Generator], Rotations]


def recommended_step(criterion: str, coarse: Evidence, min_separation_deg: float) -> Step:
    """Return the step that a criterion over beliefs recommends.

    Parameters
    ----------
    criterion : str
        A name in `nbv.recommendation.belief.BELIEF_CRITERIA`.
    coarse : Evidence
        Of fewer bins than the beliefs; rotations are multiples of its bin.
    min_separation_deg : float
        From every view so far: an estimator errs alike from nearly the same place, and no
        criterion that takes looks as independent can know.
    """

    def step(walk: Walk, rng: np.random.Generator) -> Rotations:
        gain = worth(criterion, coarser(walk.beliefs, coarse.n_bins), coarse)
        rotations = np.arange(coarse.n_bins) * (360.0 / coarse.n_bins)
        apart = circular_distance_deg(walk.taken_deg[:, :, None], rotations).min(axis=1)
        return least_ambiguous_delta(np.where(apart < min_separation_deg, np.inf, gain))

    return step


def random_step(walk: Walk, rng: np.random.Generator) -> Rotations:
    """Return a whole degree that was not looked from before, all equally likely."""
    free = np.ones((len(walk.beliefs), 360), dtype=bool)
    np.put_along_axis(free, walk.taken_deg, values=False, axis=1)
    drawn = np.where(free, rng.random(free.shape), -1.0)
    return np.asarray(drawn.argmax(axis=1), dtype=np.int64)


def bisecting_step(walk: Walk, rng: np.random.Generator) -> Rotations:
    """Return the opposite view, then the quarters, then the eighths."""
    n, taken = walk.taken_deg.shape
    return np.full(n, BISECTING_DEG[taken - 1], dtype=np.int64)


def even_step(n_views: int) -> Step:
    """Return the step to the next of `n_views` views spaced evenly."""

    def step(walk: Walk, rng: np.random.Generator) -> Rotations:
        n, taken = walk.taken_deg.shape
        return np.full(n, round(taken * 360 / n_views), dtype=np.int64)

    return step


def follow(
    step: Step,
    test: Estimates,
    evidence: Evidence,
    *,
    n_views: int,
    start_every: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    """Follow a rule from several first views of each object.

    Parameters
    ----------
    step : callable
        Chooses the next view.
    test : Estimates
        360 views an object.
    evidence : Evidence
        360 bins; for the beliefs.
    n_views : int
        Looks in all.
    start_every : int
        Degrees between first views.
    rng : numpy.random.Generator
        Where a rule draws.

    Returns
    -------
    ndarray (2, n_objects, n_starts, n_views)
        Error and total travel after each look, degrees.
    """
    estimate_deg = test.estimate_deg
    n_objects, n_azimuths = estimate_deg.shape
    objects, starts = (
        axis.ravel()
        for axis in np.meshgrid(
            np.arange(n_objects), np.arange(0, n_azimuths, start_every), indexing="ij"
        )
    )
    beliefs = first_beliefs(estimate_deg[objects, starts], evidence)
    taken = np.zeros((len(objects), 1), dtype=np.int64)
    travelled = np.zeros(len(objects))
    reached = np.empty((2, len(objects), n_views))
    for look in range(n_views):
        if look:
            delta = step(Walk(beliefs, taken), rng)
            seen = estimate_deg[objects, (starts + delta) % n_azimuths]
            beliefs = updated(beliefs, seen, delta, evidence)
            travelled = travelled + travel_deg(delta - taken[:, -1])
            taken = np.column_stack([taken, delta])
        reached[0, :, look] = circular_distance_deg(mean_direction_deg(beliefs), starts)
        reached[1, :, look] = travelled
    return reached.reshape(2, n_objects, -1, n_views)


def sequence_rows(
    test: Estimates,
    evidences: Mapping[str, Callable[[int], Evidence]],
    settings: Mapping[str, Any],
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Return error and travel of every rule, after each number of views, object by object.

    Parameters
    ----------
    test : Estimates
        Test objects, 360 views each.
    evidences : mapping of str to callable
        For ``random``, ``opposite`` and each criterion: its evidence for a number of bins.
    settings : mapping
        The configuration's ``sequence``: ``n_views, start_every_deg, min_separation_deg``.
    rng : numpy.random.Generator

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views. Travel goes from view to view, the shorter way.
    """
    n_views = settings["n_views"]
    rows: list[pd.DataFrame] = []

    def add(method: str, step: Step, name: str, looks: int, *, only_last: bool = False) -> None:
        reached = follow(
            step,
            test,
            evidences[name](test.estimate_deg.shape[1]),
            n_views=looks,
            start_every=settings["start_every_deg"],
            rng=rng,
        ).mean(axis=2)
        for look in range(looks - 1 if only_last else 0, looks):
            rows.append(
                pd.DataFrame(
                    {
                        "method": method,
                        "n_views": look + 1,
                        "object_id": test.object_ids,
                        "error_deg": reached[0, :, look],
                        "travel_deg": reached[1, :, look],
                    }
                )
            )

    add("random", random_step, "random", n_views)
    add("bisecting", bisecting_step, "opposite", n_views)
    for looks in range(1, n_views + 1):
        add("evenly_spaced", even_step(looks), "opposite", looks, only_last=True)
    for criterion in BELIEF_CRITERIA:
        if criterion in evidences:
            coarse = evidences[criterion](COARSE_BINS)
            step = recommended_step(criterion, coarse, settings["min_separation_deg"])
            add(criterion, step, criterion, n_views)
    return pd.concat(rows, ignore_index=True)[list(COLUMNS)]
