"""Beliefs, fusion and the choice of the next camera pose, in three dimensions (docs/method.md).

The next camera pose is a move M (3, 3) from the first camera: what is seen as R there is M R. Every
pose here is in the first camera, so turning the world changes nothing.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.rotation_errors import RotationErrors
from nbv.core.rotations import Array, Rotations, chordal_mean, inverse, viewing_direction
from nbv.errors import UserError, nearest

AGREE_DEG = 25.0
"""Estimates nearer than this are of one pose: their mean has a smaller error than each."""

MOST_FIRST_VIEWS = 12
"""Of each instance, to choose a kernel in seconds."""

_AGREE = np.cos(np.radians(AGREE_DEG))


@dataclass(frozen=True)
class RotationBelief:
    """A distribution of the pose after one view or more.

    Attributes
    ----------
    support : ndarray (m, 3, 3)
        Possible poses in the first camera.
    probability : ndarray (m,)
        Sums to 1.
    votes : ndarray (n_views,) int
        The pose of the support that each view's estimate stands for.
    errors : RotationErrors
    """

    support: Rotations
    probability: Array
    votes: NDArray[np.intp]
    errors: RotationErrors

    @property
    def pose(self) -> Rotations:
        """The fused pose (3, 3).

        It is the most probable of the poses that an estimate voted for, of equal ones the earlier.
        Where all errors are one density (`flip_deg` = 0), it is the mean.
        """
        if not self.errors.flip_deg:
            return chordal_mean(self.support, self.probability)
        voted = self.probability[self.votes]
        return np.asarray(self.support[self.votes[np.argmax(voted)]])

    def probability_within(self, error_deg: float) -> float:
        """Return the probability that the fused pose errs by less."""
        distance = self.errors.symmetry.distance_deg(self.support, self.pose)
        near = float(self.probability[distance < max(error_deg, AGREE_DEG)].sum())
        right = self.errors.error_deg[~self.errors.is_flip]
        # Of small errors it is known how large they are, not where.
        return near * float((right < error_deg).mean()) if len(right) else near


def belief(
    errors: RotationErrors,
    estimates: Rotations,
    moves: Rotations,
    scores: Sequence[float] | Array | None = None,
) -> RotationBelief:
    """Return the belief after n views: V of the first estimate, times L of each further one.

    Parameters
    ----------
    errors : RotationErrors
    estimates : ndarray (n, 3, 3)
        The estimate in each view.
    moves : ndarray (n, 3, 3)
        The move from the first camera to each; the first is the identity.
    scores : (n,), optional
        The estimator's scores.
    """
    support, votes = _support(errors, inverse(moves) @ estimates)
    weights = _weights(errors, support, votes, np.arange(len(support)), moves, scores)
    return RotationBelief(support, weights / weights.sum(), votes, errors)


def _weights(
    errors: RotationErrors,
    support: Rotations,
    votes: NDArray[np.intp],
    rows: NDArray[np.intp],
    moves: Rotations,
    scores: Sequence[float] | Array | None,
) -> Array:
    """Return V L … L, up to a factor, at some poses of the support, rows (r,)."""
    ratios = np.ones(len(votes))
    if scores is not None and errors.ratio is not None:
        ratios = errors.ratio(scores)
    weights = errors.conditional("estimate", support, None, votes[:1], ratios[0])[0, 0, rows]
    for vote, move, ratio in zip(votes[1:], moves[1:], ratios[1:], strict=True):
        likelihood = errors.conditional("truth", support, move[None], rows)[0, :, vote]
        # A score is of the estimate, and what is not a flip is at the truth.
        weights = weights * likelihood * np.where(rows == vote, 1.0, ratio)
        weights = weights / weights.sum()
    return np.asarray(weights)


def _support(errors: RotationErrors, seen: Rotations) -> tuple[Rotations, NDArray[np.intp]]:
    """Return the support, and which pose of it each of the estimates (n, 3, 3) stands for."""
    symmetry, possible = errors.symmetry, errors.possible_poses(seen[0])
    if not errors.flip_deg:
        return possible, symmetry.cosine(seen, possible).argmax(axis=1)
    votes = np.full(len(seen), -1)
    means: list[Rotations] = []
    for i in range(len(seen)):
        if votes[i] < 0:
            near = (votes < 0) & (symmetry.cosine(seen[i : i + 1], seen)[0] > _AGREE)
            votes[near] = len(means)
            means.append(symmetry.mean(seen[near]))
    return np.concatenate([np.stack(means), possible[1:]]), votes


def average(errors: RotationErrors, estimates: Rotations, moves: Rotations) -> Rotations:
    """Return the mean (3, 3) of estimates (n, 3, 3), each moved back to the first view (Eq. 7)."""
    return errors.symmetry.mean(inverse(moves) @ estimates)


def posterior(
    errors: RotationErrors,
    estimates: Rotations,
    moves: Rotations,
    scores: Sequence[float] | Array | None = None,
) -> Rotations:
    """Return the pose (3, 3) of `belief` after all views, V of the first and L of the others."""
    if not errors.flip_deg:
        return belief(errors, estimates, moves, scores).pose
    support, votes = _support(errors, inverse(moves) @ estimates)
    voted = np.unique(votes)  # of which the belief is not needed anywhere else
    if len(voted) == 1:
        return np.asarray(support[voted[0]])
    weights = _weights(errors, support, votes, voted, moves, scores)
    return np.asarray(support[voted[np.argmax(weights)]])


def _entropy(distributions: Array) -> Array:
    """Return the entropy along the last axis, in nats, with 0 log 0 = 0."""
    logs = np.log(np.maximum(distributions, np.finfo(float).tiny))
    return -np.asarray((distributions * logs).sum(axis=-1))


@dataclass(frozen=True)
class NextViews:
    """The views that a belief foresees.

    Attributes
    ----------
    belief : RotationBelief
        Of a support of m poses.
    moves : ndarray (k, 3, 3)
        From the first camera to each of the views.
    """

    belief: RotationBelief
    moves: Rotations

    @cached_property
    def likelihood(self) -> Array:
        """L of each pose of the support in each view, (k, m, m)."""
        return self.belief.errors.conditional("truth", self.belief.support, self.moves)


def pose_ambiguity(ahead: NextViews) -> Array:
    """Return the entropy of the pose after two views, by Eqs. 1 to 6 with T = V, (k,) in nats.

    Raises
    ------
    ValueError
        If the belief is after more than one view: Eq. 6 has one factor for each of two views.
    """
    first = ahead.belief
    if len(first.votes) > 1:
        raise ValueError(f"pose_ambiguity is defined for two views, not {len(first.votes) + 1}")
    pose = first.errors.conditional("estimate", first.support)[0]
    product = pose * first.errors.conditional("estimate", first.support, ahead.moves)
    total = product.sum(axis=2, keepdims=True)
    uniform = np.full_like(product, 1 / product.shape[2])
    np.divide(product, total, out=uniform, where=total > 0)
    return _entropy(first.probability @ uniform)


def information_gain(ahead: NextViews) -> Array:
    """Return the expected entropy of the pose after the next view, (k,) in nats."""
    first, likelihood = ahead.belief, ahead.likelihood
    noise = _entropy(likelihood) @ first.probability
    gained = _entropy(first.probability @ likelihood) - noise
    return np.asarray(_entropy(first.probability) - gained)


def expected_error(ahead: NextViews) -> Array:
    """Return the expected error of the posterior fusion after the next view, (k,) in degrees.

    Errors below `flip_deg` are not counted: they do not depend on the view.
    """
    first = ahead.belief
    errors, support = first.errors, first.support
    if not errors.flip_deg:
        joint = first.probability[:, None] * ahead.likelihood
        weights = np.swapaxes(joint, 1, 2).reshape(-1, len(support))
        fused = chordal_mean(support, np.maximum(weights, np.finfo(float).tiny))
        angles = np.degrees(np.arccos(errors.symmetry.cosine(fused, support)))
        return np.asarray((weights * angles).reshape(len(ahead.moves), -1).sum(axis=1))
    return np.asarray(expected_losses(ahead, _distances(first)[None])[0])


def _distances(belief: RotationBelief) -> Array:
    """Return the angles (m, m) between the poses of the support, degrees."""
    support = belief.support
    distance = np.degrees(np.arccos(belief.errors.symmetry.cosine(support, support)))
    np.fill_diagonal(distance, 0)
    return np.asarray(distance)


def expected_losses(ahead: NextViews, losses: Array) -> Array:
    """Return expected losses of the fusion after the next view, (n, k).

    `losses` (n, m, m) are those of an answer of the support where another pose of it is true. The
    answer is what an estimate stands for: the next one's own pose, or one voted for before.
    """
    first = ahead.belief
    joint = first.probability[:, None] * ahead.likelihood
    voted = np.unique(first.votes)
    before = joint[:, voted].argmax(axis=1)[:, None]
    chance = np.take_along_axis(joint[:, voted], before, axis=1)[:, 0]
    own = np.diagonal(joint, axis1=1, axis2=2)
    result = []
    for loss in losses:
        cost = np.take_along_axis(loss[voted] @ joint, before, axis=1)[:, 0]
        result.append(np.where(own > chance, (loss * joint).sum(axis=1), cost).sum(axis=1))
    return np.stack(result)


def chances_within(ahead: NextViews, errors_deg: Sequence[float]) -> Array:
    """Return the probability that the pose after the next view errs by less, (n, k)."""
    first = ahead.belief
    distance = _distances(first)
    losses = np.stack([1.0 * (distance >= max(e, AGREE_DEG)) for e in errors_deg])
    small = first.errors.error_deg[~first.errors.is_flip]
    shares = [(small < error_deg).mean() if len(small) else 1.0 for error_deg in errors_deg]
    return np.asarray((1 - expected_losses(ahead, losses)) * np.reshape(shares, (-1, 1)))


def hypotheses_belief(
    errors: RotationErrors, hypotheses: Rotations, scores: Sequence[float] | Array | None = None
) -> RotationBelief:
    """Return the belief after one view whose estimator gave several poses (n, 3, 3), best first.

    It is the mean of V of each, weighted by the likelihood that its score is of no flip.
    """
    support, votes = _support(errors, hypotheses)
    ratios = np.ones(len(hypotheses))
    if scores is not None and errors.ratio is not None:
        ratios = errors.ratio(scores)
    rows = errors.conditional("estimate", support, None, votes, ratios[:, None])[0]
    return RotationBelief(support, (1 / ratios / (1 / ratios).sum()) @ rows, votes, errors)


Criterion = Callable[[NextViews], Array]
CRITERIA: dict[str, Criterion] = {
    "pose_ambiguity": pose_ambiguity,
    "information_gain": information_gain,
    "expected_error": expected_error,
}
"""Criteria: the cost (k,) of each of the next views, lower is better."""


def choose_kernel(
    errors: RotationErrors,
    groups: Sequence[Hashable] | NDArray[Any],
    concentrations: Sequence[float],
    pseudo_observations: Sequence[float],
) -> RotationErrors:
    """Return the same pairs with the kernel of least error, by cross-validation of decisions.

    Pairs of one group, an instance, are views of one object that differ by their true moves. For
    each group the pairs of all others choose a second view by `expected_error` and fuse by
    `posterior`. Among equals the widest kernel and most pseudo-observations win.

    Raises
    ------
    UserError
        If there are fewer than two groups of two views.
    """
    labels = np.unique(np.asarray(groups), return_inverse=True)[1]
    views = [np.flatnonzero(labels == k) for k in np.unique(labels)]
    if sum(len(own) > 1 for own in views) < 2:
        raise UserError("a kernel is chosen by two instances or more with two views each")
    best, least = errors, np.inf
    for kappa, alpha in itertools.product(
        sorted(concentrations), sorted(pseudo_observations, reverse=True)
    ):
        candidate = replace(errors, concentration=kappa, pseudo_observations=alpha)
        means = [_decision_error_deg(candidate, own) for own in views if len(own) > 1]
        if (error := float(np.mean(means))) < least:
            best, least = candidate, error
    return best


def _decision_error_deg(errors: RotationErrors, own: NDArray[np.intp]) -> float:
    """Return the mean error of two views among some pairs, by the errors of all others."""
    estimate, truth = errors.estimate[own], errors.truth[own]
    others = replace(
        errors, estimate=np.delete(errors.estimate, own, 0), truth=np.delete(errors.truth, own, 0)
    )
    poses = []
    firsts = np.arange(0, len(own), 1 + (len(own) - 1) // MOST_FIRST_VIEWS)
    for i in firsts:
        moves = truth @ truth[i].T
        rest = np.delete(np.arange(len(own)), i)
        first = belief(others, estimate[[i]], moves[[i]])
        pair = [i, rest[best_move(expected_error(NextViews(first, moves[rest])), moves[rest])]]
        poses.append(posterior(others, estimate[pair], moves[pair]))
    return float(errors.symmetry.distance_deg(np.stack(poses), truth[firsts]).mean())


def turn_deg(moves: Rotations) -> Array:
    """Return the angle (k,) by which the camera moves around the object, in [0, 180]."""
    forward = viewing_direction(moves)[..., 2]
    return np.degrees(np.arccos(np.clip(-forward, -1, 1)))


def costs_of(criterion: str, ahead: NextViews) -> Array:
    """Return the costs (k,) of the next views by a criterion's name.

    Raises
    ------
    UserError
        For an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise UserError(f"criterion {criterion!r} is unknown: {nearest(criterion, CRITERIA)}")
    return CRITERIA[criterion](ahead)


def best_move(costs: Array | None, moves: Rotations) -> int:
    """Return the index of the move of least cost, among equals that of the smallest turn.

    Without costs, because calibration shows no dependence on the view, it is the farthest; see
    `RotationErrors.depends_on_view`.
    """
    turns = turn_deg(moves)
    if costs is None:
        return int(np.argmax(turns))
    return int(np.lexsort((turns, np.round(costs, 9)))[0])
