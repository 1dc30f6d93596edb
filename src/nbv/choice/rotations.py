"""Admissible rotations of the camera, ranked by their cost."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.choice.moves import as_rotations
from nbv.core.choose import ANY_VIEW_SHARE
from nbv.core.circle.angles import circular_distance_deg, is_angle, nearest_bin, wrap_deg
from nbv.core.circle.criteria import IN_DEGREES
from nbv.core.circle.lookup import CostTable
from nbv.errors import UserError, check_number

MIN_SEPARATION_DEG = 15.0
"""Least rotation from every view so far: nearby views have nearly the same error."""

N_ALTERNATIVES = 5

GUESS = (
    "no view is better than another: the pose stays a guess, as of an object that looks the same "
    "from all round"
)
GUESS_DEG = 81.0
"""A guess errs by 90° on average; the least of many uncertain errors is a few per cent lower."""

LEAST_AGREEMENT = 0.2
"""Estimates of 24 views or more that are guesses agree less with their azimuths."""


def signed_deg(rotation_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotations in [0, 360) in (-180, 180]."""
    return np.where(rotation_deg > 180.0, rotation_deg - 360.0, rotation_deg)


def bins_deg(n_bins: int) -> NDArray[np.float64]:
    """Return the rotations (n_bins,) of all bins of the circle, in (-180, 180]."""
    return signed_deg(np.arange(n_bins, dtype=np.float64) * (360.0 / n_bins))


def as_allowed(allowed_deg: ArrayLike) -> NDArray[np.float64]:
    """Return the unique allowed rotations (m,) in (-180, 180], ordered by their angle in [0, 360).

    Same errors as `nbv.choice.moves.as_rotations`.
    """
    given = as_rotations(allowed_deg)
    rotation_deg = given[np.unique(wrap_deg(given), return_index=True)[1]]
    # A rotation in the range keeps its exact value.
    is_within = (rotation_deg > -180.0) & (rotation_deg <= 180.0)
    return np.where(is_within, rotation_deg, signed_deg(wrap_deg(rotation_deg)))


def as_limit_deg(name: str, limit_deg: float) -> float:
    """Return the limit that a parameter gives; raise UserError unless it is 0 or more."""
    check_number(f"`{name}`", limit_deg)
    if not limit_deg >= 0:
        raise UserError(f"`{name}`={limit_deg}: give degrees, 0 or more")
    return float(limit_deg)


def at_rotations(
    cost: NDArray[np.floating], rotation_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return costs (m,) at rotations, interpolated linearly between bins (B,)."""
    bins = np.arange(len(cost)) * (360.0 / len(cost))
    return np.asarray(np.interp(rotation_deg, bins, cost, period=360.0))


def best_rotations(
    rotation_deg: NDArray[np.float64], cost: NDArray[np.floating], width: float
) -> list[tuple[float, float]]:
    """Return the local minima of the cost as (rotation, cost), best first.

    The rotations (m,) are in (-180, 180], ordered by their angle in [0, 360); costs (m,) are
    without NaN. Rotations farther apart than `width`, that of a bin, are not neighbours. Equal
    costs are ordered by travel. All minima are `MIN_SEPARATION_DEG` or more apart; at most
    `N_ALTERNATIVES` follow the first.
    """
    is_near = (np.roll(rotation_deg, -1) - rotation_deg) % 360.0 <= width + 1e-9
    better_after = is_near & (np.roll(cost, -1) < cost)
    better_before = np.roll(is_near, 1) & (np.roll(cost, 1) < cost)
    is_minimum = ~(better_after | better_before)
    minima = zip(cost[is_minimum].tolist(), rotation_deg[is_minimum].tolist(), strict=True)
    ranked: list[tuple[float, float]] = []
    for minimum, rotation in sorted(
        minima, key=lambda pair: (pair[0], abs(pair[1]), pair[1] % 360)
    ):
        if all(_is_apart(rotation, other) for other, _ in ranked):
            ranked.append((rotation, minimum))
        if len(ranked) > N_ALTERNATIVES:
            break
    return ranked


def _is_apart(rotation_deg: float, other_deg: float) -> bool:
    return MIN_SEPARATION_DEG <= abs(rotation_deg - other_deg) <= 360.0 - MIN_SEPARATION_DEG


def farthest_of(rotation_deg: NDArray[np.float64], taken: ArrayLike) -> int:
    """Return which rotation (m,) is farthest from all `taken` so far; of equal ones the first.

    After one view it is the opposite one. Rotations are from the last view, degrees.
    """
    apart = circular_distance_deg(rotation_deg[:, None], np.asarray(taken)).min(axis=1)
    return int(np.rint(apart * 1e6).argmax())


def with_first(
    ranked: list[tuple[float, float]], first: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return ranked rotations and costs after another one, without those near it."""
    others = [each for each in ranked if _is_apart(each[0], first[0])]
    return [first, *others][: N_ALTERNATIVES + 1]


def ranked_rotations(
    lookup: CostTable,
    estimate_deg: float,
    allowed_deg: ArrayLike | None = None,
    max_travel_deg: float = 180.0,
) -> tuple[list[tuple[float, float]], tuple[str, ...]]:
    """Return a lookup table's rotations for an estimate and their costs, best first; and warnings.

    As in `nbv.LookupTable.recommend`, a rotation travels more than a bin, at most the table's
    `max_travel_deg`, and the table's cost of travel counts in the order; here it also travels
    `MIN_SEPARATION_DEG`, where one that does is admissible. The limits are those of
    `nbv.Recommender.recommend`. Warnings are those of `flat_warnings`, and one where calibration
    estimates do not follow azimuths. Raise UserError where the estimate is not an angle, or no
    rotation is admissible.
    """
    max_travel_deg = min(as_limit_deg("max_travel_deg", max_travel_deg), lookup.max_travel_deg)
    n_bins = len(lookup.cost)
    width = 360.0 / n_bins
    if not is_angle(estimate_deg):
        raise UserError(f"`estimate_deg`={estimate_deg}: give an azimuth in degrees")
    bin_costs = lookup.cost[nearest_bin(estimate_deg, n_bins)]
    rotation_deg = bins_deg(n_bins) if allowed_deg is None else as_allowed(allowed_deg)
    travel = np.abs(rotation_deg)
    is_allowed = (travel > width) & (travel <= max_travel_deg)
    if not is_allowed.any():
        raise UserError(
            "no admissible rotation; relax `allowed_deg` or `max_travel_deg`: a rotation is more "
            f"than {width:g}°, and at most the {lookup.max_travel_deg:g}° of the table"
        )
    is_apart = is_allowed & (travel >= MIN_SEPARATION_DEG)
    is_allowed = is_apart if is_apart.any() else is_allowed
    rotation_deg = rotation_deg[is_allowed]
    cost = at_rotations(bin_costs, rotation_deg)
    ranked = best_rotations(rotation_deg, cost + lookup.travel_cost * travel[is_allowed], width)
    best = [(rotation, total - lookup.travel_cost * abs(rotation)) for rotation, total in ranked]
    if _agreement(lookup) < LEAST_AGREEMENT:
        return best, (GUESS,)
    is_error = lookup.criterion in IN_DEGREES
    return best, flat_warnings(best[0][1], cost) if is_error else ()


def _agreement(lookup: CostTable) -> float:
    """Return how well calibration estimates followed azimuths, either way round, in about [0, 1].

    It is the resultant length of their differences by L, freed of the uniform pseudo-observations,
    which are all that L has where it is least. They hide it in costs: all are near log B nats.
    """
    likelihood = np.asarray(lookup.estimate_likelihood, dtype=np.float64)
    n_bins = len(likelihood)
    unit = np.exp(2j * np.pi * np.arange(n_bins) / n_bins)
    directions = likelihood @ unit
    length = max(abs(directions @ unit.conj()), abs(directions @ unit)) / n_bins
    return float(length / max(1.0 - n_bins * likelihood.min(), 1e-9))


def flat_warnings(best_deg: float, error_deg: NDArray[np.floating]) -> tuple[str, ...]:
    """Return a warning where the best expected error is that of a guess, or of any view.

    `error_deg` (m,) are the expected errors after all admissible rotations.
    """
    if best_deg > GUESS_DEG:
        return (GUESS,)
    if len(error_deg) > 1 and best_deg > ANY_VIEW_SHARE * error_deg.mean():
        return ("no view is better than another: any admissible one is as good",)
    return ()
