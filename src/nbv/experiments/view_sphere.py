"""From anywhere on the view sphere: rotation and elevation of the second view, chosen jointly.

Every elevation has an estimator of its own, hence its own L; the pose stays an azimuth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.angles import circular_distance_deg
from nbv.calibration.estimates import Estimates
from nbv.recommendation.belief import (
    BELIEF_CRITERIA,
    coarser,
    first_beliefs,
    mean_direction_deg,
    updated,
    worth,
)
from nbv.recommendation.evidence import Evidence
from nbv.recommendation.lookup import least_ambiguous_delta

COLUMNS = (
    "method",
    "elevation_deg",
    "object_id",
    "error_deg",
    "travel_deg",
    "next_elevation_deg",
)
COARSE_BINS = 120

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


def best_view(worths: Mapping[int, NDArray[np.floating[Any]]]) -> tuple[Ints, Ints]:
    """Return the rotation and the elevation of least worth, (n,) each.

    Parameters
    ----------
    worths : mapping of int to ndarray (n, B)
        By elevation; of equals the first elevation, there the smallest travel.
    """
    deltas = np.stack([least_ambiguous_delta(worth) for worth in worths.values()])
    least = np.stack([worth.min(axis=1) for worth in worths.values()])
    chosen = least.argmin(axis=0)
    rows = np.arange(chosen.size)
    return deltas[chosen, rows], np.array(list(worths))[chosen].astype(np.int64)


def sphere_rows(
    tests: Mapping[int, Estimates],
    evidences: Mapping[int, Evidences],
    settings: Mapping[str, Any],
) -> pd.DataFrame:
    """Return the errors of staying at an elevation and of choosing it with the rotation.

    Parameters
    ----------
    tests : mapping of int to Estimates
        The same test objects at each elevation.
    evidences : mapping of int to mapping
        By elevation.
    settings : mapping
        The configuration's ``sequence``: ``start_every_deg``.

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
    """Return a row for every rule and first view at one elevation."""
    test, mine = tests[elevation], evidences[elevation]
    n_objects, n_views = test.estimate_deg.shape
    starts = np.tile(np.arange(0, n_views, settings["start_every_deg"]), n_objects)
    objects = np.repeat(np.arange(n_objects), len(starts) // n_objects)
    first_deg = test.estimate_deg[objects, starts]

    def reach(name: str, method: str, delta: Ints, upon: Ints) -> pd.DataFrame:
        beliefs = first_beliefs(first_deg, mine[name](n_views))
        for other in np.unique(upon):
            at = upon == other
            views = (starts[at] + delta[at]) % n_views
            seen = tests[int(other)].estimate_deg[objects[at], views]
            second = evidences[int(other)][name](n_views)
            beliefs[at] = updated(beliefs[at], seen, delta[at], second)
        return pd.DataFrame(
            {
                "method": method,
                "elevation_deg": elevation,
                "object_id": np.array(test.object_ids)[objects],
                "error_deg": circular_distance_deg(mean_direction_deg(beliefs), starts),
                "travel_deg": sphere_travel_deg(delta, elevation, upon),
                "next_elevation_deg": upon,
            }
        )

    here = np.full(len(starts), elevation)
    parts = [reach("opposite", "opposite", np.full(len(starts), 180), here)]
    for criterion in BELIEF_CRITERIA:
        if criterion not in mine:
            continue
        coarse = coarser(first_beliefs(first_deg, mine[criterion](n_views)), COARSE_BINS)
        worths = {
            other: worth(criterion, coarse, evidences[other][criterion](COARSE_BINS))
            for other in (elevation, *(e for e in tests if e != elevation))
        }
        circle = best_view({elevation: worths[elevation]})
        parts.append(reach(criterion, f"{criterion}_circle", *circle))
        parts.append(reach(criterion, f"{criterion}_sphere", *best_view(worths)))
    return pd.concat(parts, ignore_index=True)
