"""The expected error of the pose after the next view, by orientations (docs/method.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nbv.core.orientations.belief import AGREE_DEG, OrientationBelief
from nbv.core.orientations.group import Array, Orientations, viewing_direction


@dataclass(frozen=True)
class NextViews:
    """Candidates for the next view, and the belief before it.

    Attributes
    ----------
    belief : OrientationBelief
        Its support has m poses.
    moves : ndarray (k, 3, 3)
        Moves from the first camera to each of the views.
    """

    belief: OrientationBelief
    moves: Orientations

    @cached_property
    def likelihood(self) -> Array:
        """L of each pose of the support in each view, (k, m, m)."""
        return self.belief.errors.conditional("truth", self.belief.support, self.moves)


def bayes_error(ahead: NextViews) -> Array:
    """Return the Bayes risk of the posterior fusion after the next view, (k,) in degrees.

    It is the expectation under V and L, as `nbv.core.circle.criteria.bayes_error` is on the circle.

    Errors below `flip_deg` are taken to depend on the number of views alone.
    """
    small = ahead.belief.errors.small_error_deg(ahead.belief.n_agreeing + 1)
    return np.asarray(expected_losses(ahead, _distances(ahead.belief)[None])[0] + small)


def _distances(belief: OrientationBelief) -> Array:
    """Return the angles (m, m) between the poses of the support, degrees."""
    support = belief.support
    distance = np.degrees(np.arccos(belief.errors.symmetry.cosine(support, support)))
    np.fill_diagonal(distance, 0)
    return np.asarray(distance)


def expected_losses(ahead: NextViews, losses: Array) -> Array:
    """Return expected losses of the fusion after the next view, (n, k).

    `losses` (n, m, m) are symmetric: the loss of one pose of the support where another is true. The
    answer is the pose of the next estimate, or one that an earlier estimate supports.
    """
    first = ahead.belief
    joint = first.probability[:, None] * ahead.likelihood
    voted = np.unique(first.votes)
    before = joint[:, voted].argmax(axis=1)[:, None]
    chance = np.take_along_axis(joint[:, voted], before, axis=1)[:, 0]
    at_estimate = np.diagonal(joint, axis1=1, axis2=2)
    result = []
    for loss in losses:
        cost = np.take_along_axis(loss[voted] @ joint, before, axis=1)[:, 0]
        result.append(np.where(at_estimate > chance, (loss * joint).sum(axis=1), cost).sum(axis=1))
    return np.stack(result)


def chances_within(ahead: NextViews, errors_deg: Sequence[float]) -> Array:
    """Return the probability that the pose after the next view errs by less, (n, k)."""
    first = ahead.belief
    distance = _distances(first)
    losses = np.stack([1.0 * (distance >= max(e, AGREE_DEG)) for e in errors_deg])
    small = first.errors.small_errors_deg(first.n_agreeing + 1)
    shares = [(small < error_deg).mean() if len(small) else 1.0 for error_deg in errors_deg]
    return np.asarray((1 - expected_losses(ahead, losses)) * np.reshape(shares, (-1, 1)))


def view_angle_deg(moves: Orientations) -> Array:
    """Return the angle (k,) between the viewing directions before and after moves, in [0, 180]."""
    forward = viewing_direction(moves)[..., 2]
    return np.degrees(np.arccos(np.clip(-forward, -1, 1)))
