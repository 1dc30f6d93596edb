"""Policies for the second view, and their simulation on the views of objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from nbv.core.choose import named
from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.belief import Belief
from nbv.core.circle.criteria import CRITERIA
from nbv.core.circle.evidence import Evidence
from nbv.core.circle.fusion import (
    FUSIONS,
    OF_DISTRIBUTIONS,
    Rotations,
    at_second_view,
    rotation_errors_deg,
)
from nbv.core.circle.lookup import CostTable, build_lookup, least_cost_delta, recommended_delta

Angles = NDArray[np.float64]

SINGLE = "none"
ORACLE = "oracle"


@dataclass(frozen=True)
class HeldOutViews:
    """Estimates for full sweeps of objects, and the data that policies and fusion rules use.

    Attributes
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n; 360 / n is a whole number.
    evidence : Evidence, optional
        Evidence from calibration objects; required by criteria without `lookup`, by ``oracle`` and
        by the fusion ``posterior``.
    rng : numpy.random.Generator, optional
        Required by ``random``.
    lookup : CostTable, optional
        The policy's table, if it exists already.
    distributions : ndarray (n_objects, n_views, B), optional
        p(azimuth | image) of each view; criteria then use them instead of the estimates.
    """

    estimate_deg: Angles
    evidence: Evidence | None = None
    rng: np.random.Generator | None = None
    lookup: CostTable | None = None
    distributions: Angles | None = None


@dataclass(frozen=True)
class TwoViews:
    """Results of a second view for every first view, (n_objects, n_views) each.

    Attributes
    ----------
    delta_deg : ndarray of int64, or None
        The rotation to the second view; None without a second view.
    second_deg : ndarray, or None
        The estimate of the second view.
    pose_deg : ndarray
        The fused pose in the frame of the first view.
    """

    delta_deg: Rotations | None
    second_deg: Angles | None
    pose_deg: Angles

    @property
    def error_deg(self) -> Angles:
        """The distance of the fused pose from the true one, degrees in [0, 180]."""
        n_views = self.pose_deg.shape[1]
        return circular_distance_deg(self.pose_deg, np.arange(n_views) * (360.0 / n_views))


def _random(views: HeldOutViews, fusion: str) -> Rotations:
    """Draw any other view, all equally likely; distributions are rotated by whole classes."""
    if views.rng is None:
        raise ValueError("policy 'random' needs a generator")
    shape = views.estimate_deg.shape
    n = shape[1]
    if fusion in OF_DISTRIBUTIONS and views.distributions is not None:
        n = views.distributions.shape[-1]
    return np.asarray(views.rng.integers(1, n, shape) * (360 // n))


def _opposite(views: HeldOutViews, fusion: str) -> Rotations:
    return np.full(views.estimate_deg.shape, 180, dtype=np.int64)


def _oracle(views: HeldOutViews, fusion: str) -> Rotations:
    """Return the rotation of least true error from each view; among equals, the shortest travel.

    It bounds all methods with the same fusion.
    """
    if views.evidence is None:
        raise ValueError("policy 'oracle' needs evidence")
    outputs = views.distributions if fusion in OF_DISTRIBUTIONS else views.estimate_deg
    if outputs is None:
        raise ValueError(f"fusion {fusion!r} needs distributions")
    errors = rotation_errors_deg(outputs, views.evidence, fusion)
    by_view = errors.reshape(len(errors), -1).T
    return least_cost_delta(by_view).reshape(views.estimate_deg.shape)


def _recommended(criterion: str, views: HeldOutViews, fusion: str) -> Rotations:
    """Return the rotation of least cost for each image's distribution, or for each estimate."""
    if views.lookup is not None:
        return views.lookup.least_cost(views.estimate_deg)
    if views.evidence is None:
        raise ValueError(f"policy {criterion!r} needs a lookup table or evidence")
    if views.distributions is None:
        return build_lookup(views.evidence, criterion, fusion).least_cost(views.estimate_deg)
    rows = views.distributions.reshape(-1, views.evidence.n_bins).astype(np.float32)
    cost = CRITERIA[criterion](Belief(rows, views.evidence), views.evidence, fusion)
    return recommended_delta(cost, views.evidence.settings).reshape(views.estimate_deg.shape)


Policy = Callable[[HeldOutViews, str], Rotations]
POLICIES: dict[str, Policy] = {
    "random": _random,
    "opposite": _opposite,
    **{criterion: partial(_recommended, criterion) for criterion in CRITERIA},
    ORACLE: _oracle,
}
"""Rotations from every view: ``policy(views, fusion)``, (n_objects, n_views) degrees."""


def needs_lookup(policy: str) -> bool:
    """Return whether a policy uses a lookup table, if it uses estimates.

    Raises
    ------
    UserError
        For an unknown policy.
    """
    named("policy", policy, {SINGLE: None, **POLICIES})
    return policy in CRITERIA


def two_views(policy: str, fusion: str, views: HeldOutViews) -> TwoViews:
    """Choose a second view for every first view and fuse the two.

    The policy is ``none`` (a single view) or a name in `POLICIES`, the fusion one in
    `nbv.core.circle.fusion.FUSIONS`.

    Raises
    ------
    ValueError
        If `views` lacks data that the policy or the fusion needs.
    """
    if policy == SINGLE:
        return TwoViews(None, None, views.estimate_deg)
    return take_second_views(POLICIES[policy](views, fusion), fusion, views)


def take_second_views(delta_deg: Rotations, fusion: str, views: HeldOutViews) -> TwoViews:
    """Fuse every first view with the view after its rotation, (n_objects, n_views) degrees."""
    second_deg = at_second_view(views.estimate_deg, delta_deg)
    first, second = views.estimate_deg, second_deg
    if fusion in OF_DISTRIBUTIONS:
        if views.distributions is None:
            raise ValueError(f"fusion {fusion!r} needs distributions")
        first, second = views.distributions, at_second_view(views.distributions, delta_deg)
    pose_deg = FUSIONS[fusion](first, second, delta_deg, views.evidence)
    return TwoViews(delta_deg, second_deg, pose_deg)
