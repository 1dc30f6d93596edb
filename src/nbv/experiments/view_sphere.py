"""From anywhere on the view sphere: rotation and elevation of the second view, chosen jointly.

Every elevation has an estimator of its own, hence its own L; the pose stays an azimuth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import circular_distance_deg
from nbv.core.belief import coarser, first_belief, updated
from nbv.core.criteria import CRITERIA, FOR_TWO_ESTIMATORS
from nbv.core.distributions import mean_direction_deg
from nbv.core.estimates import Estimates
from nbv.core.evidence import Evidence
from nbv.core.next_views import COARSE_BINS, best_view

COLUMNS = (
    "method",
    "elevation_deg",
    "object_id",
    "error_deg",
    "travel_deg",
    "next_elevation_deg",
)

Ints = NDArray[np.int64]
Evidences = Mapping[str, Callable[[int], Evidence]]
"""For ``opposite`` and each criterion: its evidence for a number of bins."""


def sphere_travel_deg(
    delta_deg: ArrayLike, elevation_deg: ArrayLike, next_elevation_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return the great-circle angle between two views, in [0, 180] (haversine formula)."""
    first, second = np.radians(elevation_deg), np.radians(next_elevation_deg)
    half_turn, half_rise = np.radians(delta_deg) / 2, (second - first) / 2
    chord = np.sin(half_rise) ** 2 + np.cos(first) * np.cos(second) * np.sin(half_turn) ** 2
    return np.asarray(np.degrees(2 * np.arcsin(np.sqrt(np.clip(chord, 0.0, 1.0)))))


def view_sphere_rows(
    tests: Mapping[int, Estimates],
    evidences: Mapping[int, Evidences],
    settings: Mapping[str, Any],
) -> pd.DataFrame:
    """Return the errors of staying at an elevation and of choosing it with the rotation.

    Parameters
    ----------
    tests, evidences : mapping of int
        By elevation; the test objects are the same at each.
    settings : mapping
        The configuration's ``more_views``: ``start_every_deg``.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views of each object, by the first view's elevation.
        ``opposite`` and ``<criterion>_circle`` stay at it, ``<criterion>_sphere`` need not.
    """
    parts = [_from_elevation(elevation, tests, evidences, settings) for elevation in tests]
    everything = pd.concat(parts, ignore_index=True)
    means = everything.groupby(["method", "elevation_deg", "object_id"], sort=False).mean()
    return means.reset_index()[list(COLUMNS)]


def _from_elevation(
    elevation: int,
    tests: Mapping[int, Estimates],
    evidences: Mapping[int, Evidences],
    settings: Mapping[str, Any],
) -> pd.DataFrame:
    """Return a row for every method and first view at one elevation."""
    test, mine = tests[elevation], evidences[elevation]
    n_objects, n_views = test.estimate_deg.shape
    starts = np.tile(np.arange(0, n_views, settings["start_every_deg"]), n_objects)
    objects = np.repeat(np.arange(n_objects), len(starts) // n_objects)
    first_deg = test.estimate_deg[objects, starts]

    def reach(name: str, method: str, delta: Ints, upon: Ints) -> pd.DataFrame:
        first = first_belief(first_deg, mine[name](n_views))
        pose_deg = np.empty(len(starts))
        for other in np.unique(upon):
            views = (starts + delta) % n_views
            seen = tests[int(other)].estimate_deg[objects, views]
            after = updated(first, seen, delta, evidences[int(other)][name](n_views))
            pose_deg[upon == other] = mean_direction_deg(after.probabilities)[upon == other]
        return pd.DataFrame(
            {
                "method": method,
                "elevation_deg": elevation,
                "object_id": np.array(test.object_ids)[objects],
                "error_deg": circular_distance_deg(pose_deg, starts),
                "travel_deg": sphere_travel_deg(delta, elevation, upon),
                "next_elevation_deg": upon,
            }
        )

    here = np.full(len(starts), elevation)
    parts = [reach("opposite", "opposite", np.full(len(starts), 180), here)]
    for criterion in FOR_TWO_ESTIMATORS:
        if criterion not in mine:
            continue
        first = first_belief(first_deg, mine[criterion](n_views))
        coarse = coarser(first, mine[criterion](COARSE_BINS))
        costs = {
            other: CRITERIA[criterion](
                coarse, evidences[other][criterion](COARSE_BINS), "posterior"
            )
            for other in (elevation, *(e for e in tests if e != elevation))
        }
        circle = best_view({elevation: costs[elevation]})
        parts.append(reach(criterion, f"{criterion}_circle", *circle))
        parts.append(reach(criterion, f"{criterion}_sphere", *best_view(costs)))
    return pd.concat(parts, ignore_index=True)
