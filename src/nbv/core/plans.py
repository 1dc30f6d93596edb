"""Plans for several views, chosen after the first one: at equal spacing, or step by step.

Evenly spaced views are 360 / n degrees apart. Closer views, clockwise or counter-clockwise, travel
less and may be more informative; views chosen step by step by the information gain find hidden
parts. No plan is best for all objects: even spacing resolves half-turns, step by step finds a
hidden handle. So the plan is chosen by the errors of each plan on calibration objects with similar
first images, with evenly spaced views as the reference. No plan travels farther than the reference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from studies.simulation import DistributionViews, NextView, follow, recommended_next

from nbv.core.angles import circular_distance_deg
from nbv.core.belief import Belief
from nbv.core.criteria import BELIEFS_AT_ONCE, check_first_view, view_weights
from nbv.core.distributions import (
    NEGLIGIBLE_PROBABILITY,
    mean_direction_deg,
    products_at_spacing,
)
from nbv.core.evidence import Evidence, Float32Array, evidence_of_distributions
from nbv.core.fusion import Rotations


def spacing_bins(n_views: int, n_bins: int, min_separation_deg: float) -> NDArray[np.int64]:
    """Return the possible spacings of n views, in bins, positive counter-clockwise.

    Even spacing comes first, then closer spacings in the order of their travel.
    """
    widest = n_bins // n_views
    sizes = np.arange(1, widest)
    sizes = sizes[sizes * 360.0 / n_bins >= min_separation_deg]
    others = np.column_stack([sizes, -sizes]).ravel()
    return np.concatenate([[widest], others, [-widest]]).astype(np.int64)


def spaced_errors_deg(
    distributions: NDArray[np.floating], n_views: int, spacings: NDArray[np.int64]
) -> Float32Array:
    """Return the error of the product of n views at each spacing, from every view.

    In degrees, (S, n_objects, B), for the distributions (n_objects, B, B) of sweeps of views one
    bin apart, and spacings (S,) in bins.
    """
    n_objects, n_bins, _ = distributions.shape
    logs = np.log(np.maximum(distributions, NEGLIGIBLE_PROBABILITY)).astype(np.float32)
    azimuth_deg = np.arange(n_bins) * (360.0 / n_bins)
    errors = np.empty((len(spacings), n_objects, n_bins), dtype=np.float32)
    for i, spacing in enumerate(spacings):
        products = products_at_spacing(logs, n_views, int(spacing))
        pose_deg = mean_direction_deg(products.reshape(-1, n_bins)).reshape(n_objects, n_bins)
        errors[i] = circular_distance_deg(pose_deg, azimuth_deg)
    return errors


def at_spacing(spacing_deg: Rotations) -> NextView:
    """Return the policy of equal steps, one step (n,) for each pose."""

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        return np.asarray((taken_deg[:, -1] + spacing_deg) % 360)

    return next_view


def step_by_step(evidence: Evidence, min_separation_deg: float, n_views: int) -> NextView:
    """Return the information-gain policy that travels no farther than evenly spaced views."""
    return recommended_next("information_gain", evidence, min_separation_deg, n_views)


# Parts of the calibration objects for cross-validation.
_PARTS = 5


def step_by_step_errors_deg(
    evidence: Evidence, n_views: int, min_separation_deg: float
) -> Float32Array:
    """Return the cross-validated errors of `step_by_step` from every view, (n_objects, B) degrees.

    The views of each part of the calibration objects are chosen with the evidence of the other
    parts; a single object uses its own evidence.
    """
    distributions, n_bins = _distributions(evidence), evidence.n_bins
    n_objects = len(distributions)
    part_of = np.arange(n_objects) % min(_PARTS, n_objects)
    errors = np.empty((n_objects, n_bins), dtype=np.float32)
    for part in range(part_of.max() + 1):
        own = part_of == part
        others = distributions[~own] if n_objects > 1 else distributions
        known = evidence_of_distributions(others, evidence.settings)
        reached = follow(
            step_by_step(known, min_separation_deg, n_views),
            DistributionViews(distributions[own], known),
            n_views=n_views,
            start_every_deg=360 // n_bins,
            rng=np.random.default_rng(0),  # not used
        )
        errors[own] = reached[0, :, :, -1]
    return errors


@dataclass(frozen=True)
class Plans:
    """Plans for n views, and their errors on calibration objects.

    Attributes
    ----------
    spacing_deg : ndarray (S,) int64
        Spacings of the plans at equal steps, even spacing first.
    errors_deg : ndarray (P, n_objects, B) float32
        The error of each plan from each view. For three or more views, the plan `step_by_step`
        follows the plans at equal steps.
    caution : float
        Number of standard errors; see `excess_of_plans`.
    """

    spacing_deg: NDArray[np.int64]
    errors_deg: Float32Array
    caution: float


def plans_of(evidence: Evidence, n_views: int, min_separation_deg: float) -> Plans:
    """Return the plans for n views.

    For two views the plans are the rotations of `min_separation_deg` or more, without caution, as
    in `expected_error`: a second view helps so much that few objects suffice.

    Parameters
    ----------
    evidence : Evidence
        Evidence from distributions.
    n_views : int
        2 or more.
    min_separation_deg : float
        Smallest spacing.
    """
    spacings = spacing_bins(n_views, evidence.n_bins, min_separation_deg)
    errors = spaced_errors_deg(_views_a_bin_apart(evidence), n_views, spacings)
    degrees = np.rint(spacings * (360.0 / evidence.n_bins)).astype(np.int64)
    if n_views == 2:
        return Plans(degrees, errors, 0.0)
    by_gain = step_by_step_errors_deg(evidence, n_views, min_separation_deg)
    errors = np.concatenate([errors, by_gain[None]])
    return Plans(degrees, errors, evidence.settings["affinity"]["caution"])


def choose_plan(belief: Belief, evidence: Evidence, plans: Plans) -> NDArray[np.intp]:
    """Return the plan of least `excess_of_plans` for each first view, (n,)."""
    excess = excess_of_plans(belief, evidence, plans.errors_deg, plans.caution)
    return np.asarray(excess.argmin(axis=1))


def _distributions(evidence: Evidence) -> NDArray[np.float32]:
    if evidence.distributions is None:
        raise ValueError("plans need evidence of distributions")
    return evidence.distributions


def _views_a_bin_apart(evidence: Evidence) -> NDArray[np.float32]:
    return _distributions(evidence)[:, :: evidence.n_views // evidence.n_bins]


def excess_of_plans(
    belief: Belief, evidence: Evidence, errors: Float32Array, caution: float
) -> Float32Array:
    """Return the expected error of each plan minus that of the first plan.

    It is a kernel regression on the first view's distribution, as in `nbv.core.criteria`, plus
    `caution` standard errors over calibration objects: few objects contain few of the rare large
    errors, so the least of many means is too optimistic. With a single object, only the first plan
    is finite. In degrees, (n, P), for beliefs after n first views, and errors (P, n_objects, B) of
    each plan from each view of the calibration objects.

    Raises
    ------
    ValueError
        If the belief is not after one view by the estimator of `evidence`.
    """
    check_first_view(belief, evidence)
    n_bins, settings = evidence.n_bins, evidence.settings["affinity"]
    views = _views_a_bin_apart(evidence)
    n_objects = len(views)
    excess = (errors - errors[0]).transpose(1, 2, 0)
    share = max(settings["pseudo_observations"], np.finfo(np.float32).tiny) / n_objects
    prior = share * excess.mean(axis=1)
    expected = []
    for start in range(0, len(belief.probabilities), BELIEFS_AT_ONCE):
        rows = belief.probabilities[start : start + BELIEFS_AT_ONCE]
        weights = view_weights(rows, views.reshape(-1, n_bins), settings["power"])
        weights = weights.reshape(len(rows), n_objects, n_bins)
        sums = np.stack([weights[:, o] @ excess[o] for o in range(n_objects)], axis=1) + prior
        counts = weights.sum(axis=2)[:, :, None] + share
        total = counts.sum(axis=1)
        mean = sums.sum(axis=1) / total
        expected.append(mean + caution * _standard_error(sums, counts, mean, total))
    return np.concatenate(expected).astype(np.float32)


def _standard_error(
    sums: Float32Array, counts: Float32Array, mean: Float32Array, total: Float32Array
) -> Float32Array:
    """Return the linearised standard error of ratios of sums over objects (n, n_objects, P)."""
    n_objects = sums.shape[1]
    if n_objects < 2:
        return np.where(mean == 0.0, 0.0, np.inf).astype(np.float32)
    squares = ((sums - mean[:, None] * counts) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(squares * (n_objects / (n_objects - 1))) / total)
