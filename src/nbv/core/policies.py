"""How the second view is chosen, and the one way to choose it, take it and fuse both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg
from nbv.core.belief import Belief
from nbv.core.criteria import CRITERIA
from nbv.core.evidence import Evidence
from nbv.core.fusion import (
    FUSIONS,
    OF_DISTRIBUTIONS,
    Rotations,
    at_second_view,
    rotation_errors_deg,
)
from nbv.core.lookup import (
    LookupTable,
    build_lookup,
    least_cost_delta,
    recommended_delta,
)
from nbv.errors import UserError, nearest

Angles = NDArray[np.float64]

SINGLE = "none"
ORACLE = "oracle"


@dataclass(frozen=True)
class Turns:
    """Full turns of objects, and what a method may know when it chooses and fuses views.

    Attributes
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n; 360 / n is a whole number.
    evidence : Evidence, optional
        Of calibration objects; needed by criteria without `lookup`, by ``oracle`` and by the
        fusion ``posterior``.
    rng : numpy.random.Generator, optional
        Needed by ``random``.
    lookup : LookupTable, optional
        The table of the policy, where it is made already.
    distributions : ndarray (n_objects, n_views, B), optional
        p(azimuth | image) of each view; a criterion then goes by them instead of the estimates.
    """

    estimate_deg: Angles
    evidence: Evidence | None = None
    rng: np.random.Generator | None = None
    lookup: LookupTable | None = None
    distributions: Angles | None = None


@dataclass(frozen=True)
class TwoViews:
    """What comes of a second view from every first one, (n_objects, n_views) each.

    Attributes
    ----------
    delta_deg : ndarray of int64, or None
        The rotation to the second view; None where none was taken.
    second_deg : ndarray, or None
        The estimate from there.
    pose_deg : ndarray
        The fused pose in the frame of the first view.
    """

    delta_deg: Rotations | None
    second_deg: Angles | None
    pose_deg: Angles

    @property
    def error_deg(self) -> Angles:
        """The distance between fused and true pose, degrees in [0, 180]."""
        n_views = self.pose_deg.shape[1]
        return circular_distance_deg(self.pose_deg, np.arange(n_views) * (360.0 / n_views))


def _random(turns: Turns, fusion: str) -> Rotations:
    """Return a view other than the first, all equally likely; of distributions, whole classes."""
    if turns.rng is None:
        raise ValueError("policy 'random' needs a generator")
    shape = turns.estimate_deg.shape
    n = shape[1]
    if fusion in OF_DISTRIBUTIONS and turns.distributions is not None:
        n = turns.distributions.shape[-1]
    return np.asarray(turns.rng.integers(1, n, shape) * (360 // n))


def _opposite(turns: Turns, fusion: str) -> Rotations:
    return np.full(turns.estimate_deg.shape, 180, dtype=np.int64)


def _oracle(turns: Turns, fusion: str) -> Rotations:
    """Return the rotation of least error from each view, as only the truth can tell.

    The bound of all methods that fuse alike. Of equals the smallest travel.
    """
    if turns.evidence is None:
        raise ValueError("policy 'oracle' needs evidence")
    of_views = turns.estimate_deg if fusion not in OF_DISTRIBUTIONS else turns.distributions
    if of_views is None:
        raise ValueError(f"fusion {fusion!r} needs distributions")
    errors = rotation_errors_deg(of_views, turns.evidence, fusion)
    by_view = errors.reshape(len(errors), -1).T
    return least_cost_delta(by_view).reshape(turns.estimate_deg.shape)


def _recommended(criterion: str, turns: Turns, fusion: str) -> Rotations:
    """Return the rotation of least cost at each image's distribution, or at each estimate."""
    if turns.lookup is not None:
        return turns.lookup.least_cost(turns.estimate_deg)
    if turns.evidence is None:
        raise ValueError(f"policy {criterion!r} needs a lookup table or evidence")
    if turns.distributions is None:
        return build_lookup(turns.evidence, criterion, fusion).least_cost(turns.estimate_deg)
    rows = turns.distributions.reshape(-1, turns.evidence.n_bins).astype(np.float32)
    cost = CRITERIA[criterion](Belief(rows, turns.evidence), turns.evidence, fusion)
    return recommended_delta(cost, turns.evidence.settings).reshape(turns.estimate_deg.shape)


Policy = Callable[[Turns, str], Rotations]
POLICIES: dict[str, Policy] = {
    "random": _random,
    "opposite": _opposite,
    **{criterion: partial(_recommended, criterion) for criterion in CRITERIA},
    ORACLE: _oracle,
}
"""Rotations from every view, given the turns and the name of the fusion rule."""


def needs_lookup(policy: str) -> bool:
    """Say whether a policy follows a lookup table, where it goes by estimates.

    Raises
    ------
    UserError
        Where there is no such policy.
    """
    if policy != SINGLE and policy not in POLICIES:
        known = [SINGLE, *POLICIES]
        raise UserError(f"policy {policy!r} is unknown: {nearest(policy, known)}")
    return policy in CRITERIA


def two_views(policy: str, fusion: str, turns: Turns) -> TwoViews:
    """Choose a second view from every first one, take it, and fuse the two.

    Parameters
    ----------
    policy : str
        ``none`` (one view alone) or a name in `POLICIES`.
    fusion : str
        A name in `nbv.core.fusion.FUSIONS`.
    turns : Turns

    Raises
    ------
    ValueError
        Where the policy or the fusion needs what `turns` has not.
    """
    if policy == SINGLE:
        return TwoViews(None, None, turns.estimate_deg)
    return take_second_views(POLICIES[policy](turns, fusion), fusion, turns)


def take_second_views(delta_deg: Rotations, fusion: str, turns: Turns) -> TwoViews:
    """Take the views that rotations (n_objects, n_views) lead to, and fuse them with the first."""
    first = turns.estimate_deg
    second = seen = at_second_view(first, delta_deg)
    if fusion in OF_DISTRIBUTIONS:
        if turns.distributions is None:
            raise ValueError(f"fusion {fusion!r} needs distributions")
        first, seen = turns.distributions, at_second_view(turns.distributions, delta_deg)
    return TwoViews(delta_deg, second, FUSIONS[fusion](first, seen, delta_deg, turns.evidence))
