"""Rotations that a camera may take, and the best of them by their cost."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import circular_distance_deg, nearest_bin, wrap_deg
from nbv.core.lookup import LookupTable
from nbv.errors import UserError
from nbv.robot.moves import as_rotations

MIN_SEPARATION_DEG = 15.0
"""From every view so far: an estimator errs alike from nearly the same place."""

N_ALTERNATIVES = 5


def signed_deg(rotation_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotations in [0, 360) in (-180, 180]."""
    return np.where(rotation_deg > 180.0, rotation_deg - 360.0, rotation_deg)


@cache
def bins_deg(n_bins: int) -> NDArray[np.float64]:
    """Return the rotations of all bins of a full turn, in (-180, 180]."""
    rotation_deg = signed_deg(np.arange(n_bins, dtype=np.float64) * (360.0 / n_bins))
    rotation_deg.flags.writeable = False
    return rotation_deg


def as_allowed(allowed_deg: ArrayLike) -> NDArray[np.float64]:
    """Return allowed rotations (m,) once each, in (-180, 180], by their place in [0, 360).

    Errors as of `nbv.robot.moves.as_rotations`.
    """
    given = as_rotations(allowed_deg)
    rotation_deg = given[np.unique(wrap_deg(given), return_index=True)[1]]
    # A rotation that is in the range already keeps its bits.
    is_within = (rotation_deg > -180.0) & (rotation_deg <= 180.0)
    return np.where(is_within, rotation_deg, signed_deg(wrap_deg(rotation_deg)))


def as_travel(max_travel_deg: float) -> float:
    """Return a longest travel; UserError where it is none."""
    try:
        given = float(max_travel_deg)
    except (TypeError, ValueError):
        given = float("nan")
    if not given >= 0:
        raise UserError(f"a longest travel of {max_travel_deg}°: give degrees, 0 or more")
    return given


def at_rotations(
    cost: NDArray[np.floating], rotation_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return costs (m,) at rotations, of those of the bins (B,); linear between bins."""
    bins = np.arange(len(cost)) * (360.0 / len(cost))
    return np.asarray(np.interp(rotation_deg, bins, cost, period=360.0))


def are_neighbours(rotation_deg: NDArray[np.float64], width: float) -> list[bool]:
    """Return whether each rotation (m,) and the next one all round are at most a width apart.

    They are in (-180, 180], by their place in [0, 360); the width is that of a bin, degrees.
    """
    gap = np.concatenate([rotation_deg[1:], rotation_deg[:1]]) - rotation_deg
    found: list[bool] = (gap % 360.0 <= width + 1e-9).tolist()
    return found


def best_rotations(
    rotation_deg: Sequence[float], cost: NDArray[np.floating], near: Sequence[bool]
) -> list[tuple[float, float]]:
    """Return rotations of less cost than their neighbours within a bin's width, best first.

    Parameters
    ----------
    rotation_deg : sequence of float (m,)
        In (-180, 180], by their place in [0, 360).
    cost : ndarray (m,)
        No NaN.
    near : sequence of bool (m,)
        From `are_neighbours`.

    Returns
    -------
    list of (rotation, cost)
        Of equal costs the one of less travel first; all are `MIN_SEPARATION_DEG` or more apart, and
        there are at most `N_ALTERNATIVES` after the first.
    """
    # In Python: quicker than many operations on a hundred numbers.
    costs = cost.tolist()
    left = [
        (own, rotation)
        for own, after, before, is_near, was_near, rotation in zip(
            *(costs, costs[1:] + costs[:1], costs[-1:] + costs[:-1]),
            *(near, [*near[-1:], *near[:-1]], rotation_deg),
            strict=True,
        )
        if not ((is_near and after < own) or (was_near and before < own))
    ]
    least, most = MIN_SEPARATION_DEG, 360.0 - MIN_SEPARATION_DEG
    found: list[tuple[float, float]] = []
    for of_rotation, rotation in sorted(left, key=lambda one: (one[0], abs(one[1]), one[1] % 360)):
        if all(least <= abs(rotation - other) <= most for other, _ in found):
            found.append((rotation, of_rotation))
        if len(found) > N_ALTERNATIVES:
            break
    return found


def ranked_rotations(
    lookup: LookupTable,
    estimate_deg: float,
    allowed_deg: ArrayLike | None = None,
    max_travel_deg: float = 180.0,
) -> list[tuple[float, float]]:
    """Return the rotations of a lookup table for an estimate and their costs, best first.

    As in `LookupTable.recommend`, a rotation travels more than a bin. Without limits the table's
    own is the first: what it was made with, such as a cost of travel, counts for it.

    Parameters
    ----------
    lookup : LookupTable
    estimate_deg : float
    allowed_deg, max_travel_deg
        See `nbv.Recommender.recommend`.

    Raises
    ------
    UserError
        Where no rotation is allowed.
    """
    max_travel_deg = as_travel(max_travel_deg)
    n_bins = len(lookup.cost)
    width = 360.0 / n_bins
    of_bins = lookup.cost[nearest_bin(estimate_deg, n_bins)]
    of_all = bins_deg(n_bins)
    rotation_deg = of_all if allowed_deg is None else as_allowed(allowed_deg)
    travel = np.abs(rotation_deg)
    is_allowed = (travel > width) & (travel <= max_travel_deg)
    if not is_allowed.any():
        raise UserError(
            "no admissible rotation; relax `allowed_deg` or `max_travel_deg`: a rotation is more "
            f"than {width:g}°"
        )
    rotation_deg = rotation_deg[is_allowed]
    near = are_neighbours(rotation_deg, width)
    ranked = best_rotations(rotation_deg.tolist(), at_rotations(of_bins, rotation_deg), near)
    if allowed_deg is not None or max_travel_deg < of_all.max():
        return ranked
    own = float(signed_deg(np.asarray(lookup.recommend(estimate_deg), dtype=np.float64)))
    own_cost = float(of_bins[nearest_bin(own, n_bins)])
    others = [one for one in ranked if circular_distance_deg(one[0], own) >= MIN_SEPARATION_DEG]
    return [(own, own_cost), *others]
