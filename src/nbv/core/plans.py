"""Plans for several views, chosen by the first one: at equal steps, or step by step.

Evenly spaced views are 360° / n apart. Closer ones, one way round or the other, travel less and may
tell more; views chosen step by step by the information gain find what is hidden. No plan is best
for all objects: a half-turn is seen best by even spacing, a hidden handle step by step. So the
errors that each plan really led to on calibration objects decide, for each first view by the images
that look alike, and evenly spaced views are what other plans have to beat. No plan travels farther
than they do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg
from nbv.core.belief import Belief
from nbv.core.criteria import BELIEFS_AT_ONCE, check_first_view, view_weights
from nbv.core.distributions import mean_direction_deg
from nbv.core.evidence import Evidence, Table, evidence_of_distributions
from nbv.core.fusion import Rotations
from nbv.core.next_views import NextView, recommended_next
from nbv.core.simulation import DistributionViews, follow

# Below it a product of distributions would be lost in rounding.
_LEAST_PROBABILITY = 1e-12
# Parts of the calibration objects; the evidence of the others chooses a part's views step by step.
_PARTS = 5


def spacing_bins(n_views: int, n_bins: int, min_separation_deg: float) -> NDArray[np.int64]:
    """Return the spacings that n views may have, in bins, positive counter-clockwise.

    Evenly spaced views come first, then the others by their travel. No spacing is wider than that
    of evenly spaced views, so that none travels farther.
    """
    widest = n_bins // n_views
    sizes = np.arange(1, widest)
    sizes = sizes[sizes * 360.0 / n_bins >= min_separation_deg]
    others = np.column_stack([sizes, -sizes]).ravel()
    return np.concatenate([[widest], others, [-widest]]).astype(np.int64)


def spaced_errors_deg(
    distributions: NDArray[np.floating], n_views: int, spacings: NDArray[np.int64]
) -> Table:
    """Return the error of the product of n views at each spacing, from every view.

    Parameters
    ----------
    distributions : ndarray (n_objects, B, B)
        p(azimuth | image) of views one bin apart.
    n_views : int
    spacings : ndarray (S,) int
        In bins.

    Returns
    -------
    ndarray (S, n_objects, B) float32
        Degrees.
    """
    n_objects, n_bins, _ = distributions.shape
    logs = np.log(np.maximum(distributions, _LEAST_PROBABILITY)).astype(np.float32)
    azimuth_deg = np.arange(n_bins) * (360.0 / n_bins)
    errors = np.empty((len(spacings), n_objects, n_bins), dtype=np.float32)
    for place, spacing in enumerate(spacings):
        total = logs.copy()
        for view in range(1, n_views):
            turn = -view * int(spacing)
            total += np.roll(logs, (turn, turn), axis=(1, 2))
        fused = np.exp(total - total.max(axis=-1, keepdims=True)).reshape(-1, n_bins)
        pose_deg = mean_direction_deg(fused).reshape(n_objects, n_bins)
        errors[place] = circular_distance_deg(pose_deg, azimuth_deg)
    return errors


def at_spacing(spacing_deg: Rotations) -> NextView:
    """Return the policy that takes every next view at a step (n,) of its own."""

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        return np.asarray((taken_deg[:, -1] + spacing_deg) % 360)

    return next_view


def step_by_step(evidence: Evidence, min_separation_deg: float, n_views: int) -> NextView:
    """Return the policy of the information gain that travels no farther than even spacing."""
    return recommended_next("information_gain", evidence, min_separation_deg, n_views)


def step_by_step_errors_deg(evidence: Evidence, n_views: int, min_separation_deg: float) -> Table:
    """Return the errors (n_objects, B) that n views chosen by the information gain led to, degrees.

    From every view of calibration objects a bin apart. Views of one part of the objects are chosen
    with the evidence of all others; one object alone has its own.
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
            rng=np.random.default_rng(0),  # nothing is drawn
        )
        errors[own] = reached[0, :, :, -1]
    return errors


@dataclass(frozen=True)
class Plans:
    """Plans for n views, and what they led to.

    Attributes
    ----------
    spacing_deg : ndarray (S,) int64
        Of the plans at equal steps, evenly spaced views first.
    errors_deg : ndarray (P, n_objects, B) float32
        Of each plan from each view of calibration objects. Plans that are not at equal steps come
        last: of three views and more, one that goes step by step.
    caution : float
        Standard errors; see `excess_of_plans`.
    """

    spacing_deg: NDArray[np.int64]
    errors_deg: Table
    caution: float


def plans_of(evidence: Evidence, n_views: int, min_separation_deg: float) -> Plans:
    """Return the plans for n views.

    Two views have every rotation of ``min_separation_deg`` or more for a plan and no caution, as
    `expected_error` has: the second view brings so much that its mean error is known soon.

    Parameters
    ----------
    evidence : Evidence
        Of distributions.
    n_views : int
        2 or more.
    min_separation_deg : float
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


def excess_of_plans(belief: Belief, evidence: Evidence, errors: Table, caution: float) -> Table:
    """Return what each plan is expected to err more than the first one.

    A regression on the first view's distribution as of
    `nbv.core.criteria`, of the difference between a plan's
    errors and those of the first plan. `caution` standard errors over calibration objects are
    added: few objects hold few of the rare large errors, so the least of many means is too
    hopeful. With one object alone nothing but the first plan is trusted.

    Parameters
    ----------
    belief : Belief
        Of n first views, by the estimator of `evidence`, or ValueError is raised.
    evidence : Evidence
        Of distributions; its settings hold ``affinity``.
    errors : ndarray (P, n_objects, B)
        Of each plan from each view of the calibration objects, degrees.
    caution : float

    Returns
    -------
    ndarray (n, P) float32
        Degrees.
    """
    check_first_view(belief, evidence)
    n_bins, settings = evidence.n_bins, evidence.settings["affinity"]
    views = _views_a_bin_apart(evidence)
    n_objects = len(views)
    excess = (errors - errors[0]).transpose(1, 2, 0)
    share = max(settings["pseudo_observations"], np.finfo(np.float32).tiny) / n_objects
    of_all = share * excess.mean(axis=1)
    found = []
    for start in range(0, len(belief.probabilities), BELIEFS_AT_ONCE):
        rows = belief.probabilities[start : start + BELIEFS_AT_ONCE]
        weights = view_weights(rows, views.reshape(-1, n_bins), settings["power"])
        of_view = weights.reshape(len(rows), n_objects, n_bins)
        sums = np.stack([of_view[:, o] @ excess[o] for o in range(n_objects)], axis=1) + of_all
        counts = of_view.sum(axis=2)[:, :, None] + share
        total = counts.sum(axis=1)
        mean = sums.sum(axis=1) / total
        found.append(mean + caution * _standard_error(sums, counts, mean, total))
    return np.concatenate(found).astype(np.float32)


def _standard_error(sums: Table, counts: Table, mean: Table, total: Table) -> Table:
    """Return that of a ratio of sums over objects (n, n_objects, P), linearised."""
    n_objects = sums.shape[1]
    if n_objects < 2:
        return np.where(mean == 0.0, 0.0, np.inf).astype(np.float32)
    squares = ((sums - mean[:, None] * counts) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(squares * (n_objects / (n_objects - 1))) / total)
