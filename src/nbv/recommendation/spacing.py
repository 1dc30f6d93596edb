"""Views at equal steps round an object: how far apart, given what the first view shows.

Evenly spaced views are 360° / n apart. Closer ones, one way round or the other, travel less and may
tell more. The errors that n views of calibration objects really led to choose among them, for each
first view by the images that look alike. Evenly spaced views are what others have to beat.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.angles import circular_distance_deg
from nbv.recommendation.belief import Belief, mean_direction_deg
from nbv.recommendation.criteria.expected_error import BELIEFS_AT_ONCE, affinity, need_first_view
from nbv.recommendation.evidence import Evidence, Table
from nbv.recommendation.fusion import Rotations
from nbv.recommendation.next_views import NextView

# Below it a product of distributions would be lost in rounding.
_LEAST_PROBABILITY = 1e-12


def spacing_bins(n_views: int, n_bins: int, min_separation_deg: float) -> NDArray[np.int64]:
    """Return the spacings that n views may have, in bins, positive counter-clockwise.

    Evenly spaced views come first, then the others by their travel. No spacing is wider than that
    of evenly spaced views, so that none travels farther.
    """
    widest = n_bins // n_views
    sizes = np.arange(widest, 0, -1)
    sizes = sizes[(sizes == widest) | (sizes * 360.0 / n_bins >= min_separation_deg)]
    of_others = np.sort(sizes[1:])
    others = np.column_stack([of_others, -of_others]).ravel()
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


def excess_of_spacings(
    belief: Belief,
    evidence: Evidence,
    n_views: int,
    spacings: NDArray[np.int64],
    caution: float,
) -> Table:
    """Return what n views at each spacing are expected to err more than evenly spaced ones.

    A regression on the first view's distribution as of
    `nbv.recommendation.criteria.expected_error.expected_error`, of the difference between the error
    at a spacing and that at the first one. `caution` standard errors over calibration objects are
    added: few objects hold few of the rare large errors, so the least of many means is too
    hopeful. With one object alone nothing but the first spacing is trusted.

    Parameters
    ----------
    belief : Belief
        Of n first views, by the estimator of `evidence`, or ValueError is raised.
    evidence : Evidence
        Of distributions; its settings hold ``affinity``.
    n_views : int
    spacings : ndarray (S,) int
        Of `spacing_bins`.
    caution : float

    Returns
    -------
    ndarray (n, S) float32
        Degrees.
    """
    need_first_view(belief, evidence)
    if evidence.distributions is None:
        raise ValueError("spacings need evidence of distributions")
    n_bins, settings = evidence.n_bins, evidence.settings["affinity"]
    step = evidence.distributions.shape[1] // n_bins
    views = evidence.distributions[:, ::step]
    n_objects = len(views)
    errors = evidence.once(
        ("spacings", n_views, *spacings.tolist()),
        lambda: spaced_errors_deg(views, n_views, spacings),
    )
    excess = (errors - errors[0]).transpose(1, 2, 0)
    share = max(settings["pseudo_observations"], np.finfo(np.float32).tiny) / n_objects
    of_all = share * excess.mean(axis=1)
    found = []
    for start in range(0, len(belief.probabilities), BELIEFS_AT_ONCE):
        rows = belief.probabilities[start : start + BELIEFS_AT_ONCE]
        weights = step * affinity(rows, views.reshape(-1, n_bins)) ** settings["power"]
        of_view = weights.reshape(len(rows), n_objects, n_bins)
        sums = np.stack([of_view[:, o] @ excess[o] for o in range(n_objects)], axis=1) + of_all
        counts = of_view.sum(axis=2)[:, :, None] + share
        total = counts.sum(axis=1)
        mean = sums.sum(axis=1) / total
        found.append(mean + caution * _standard_error(sums, counts, mean, total))
    return np.concatenate(found).astype(np.float32)


def _standard_error(sums: Table, counts: Table, mean: Table, total: Table) -> Table:
    """Return that of a ratio of sums over objects (n, n_objects, S), linearised."""
    n_objects = sums.shape[1]
    if n_objects < 2:
        return np.where(mean == 0.0, 0.0, np.inf).astype(np.float32)
    squares = ((sums - mean[:, None] * counts) ** 2).sum(axis=1)
    return np.asarray(np.sqrt(squares * (n_objects / (n_objects - 1))) / total)


def spaced_next(evidence: Evidence, n_views: int, min_separation_deg: float) -> NextView:
    """Return the policy that takes n views at the spacing of least expected error.

    The first view chooses the spacing; the others follow at the same step. With two views there is
    no `affinity.caution`: a second view is worth so much that a mean is learned fast.
    """
    spacings = spacing_bins(n_views, evidence.n_bins, min_separation_deg)
    caution = evidence.settings["affinity"]["caution"] if n_views > 2 else 0.0

    def next_view(belief: Belief, taken_deg: Rotations, rng: np.random.Generator) -> Rotations:
        if taken_deg.shape[1] > 1:
            return np.asarray((taken_deg[:, -1] + taken_deg[:, 1]) % 360)
        excess = excess_of_spacings(belief, evidence, n_views, spacings, caution)
        chosen = spacings[excess.argmin(axis=1)] % evidence.n_bins
        return np.asarray(np.rint(chosen * (360.0 / evidence.n_bins)), dtype=np.int64)

    return next_view
