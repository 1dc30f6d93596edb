"""Beliefs, fusion and the choice of the next camera pose, in three dimensions (docs/method.md).

The next camera pose is a move M (3, 3) from the first camera: what is seen as R there is M R. Every
pose here is in the first camera, so turning the world changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.rotation_errors import RotationErrors
from nbv.core.rotations import Array, Rotations, chordal_mean, viewing_direction
from nbv.errors import UserError, nearest

AGREE_DEG = 25.0
"""Estimates nearer than this are of one pose: their mean has a smaller error than each."""
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

    @property
    def expected_error_deg(self) -> float:
        """The expected error of the fused pose, errors below `flip_deg` not counted."""
        distance = self.errors.symmetry.distance_deg(self.support, self.pose)
        return float(self.probability @ distance)


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
    seen = moves.mT @ estimates
    support, votes = _support(errors, seen)
    ratios = np.ones(len(seen))
    if scores is not None and errors.ratio is not None:
        ratios = errors.ratio(scores)
    probability = errors.conditional("estimate", support, None, votes[:1], ratios[0])[0, 0]
    for vote, move, ratio in zip(votes[1:], moves[1:], ratios[1:], strict=True):
        likelihood = errors.conditional("truth", support, move[None])[0, :, vote]
        # A score is of the estimate, and what is not a flip is at the truth.
        likelihood = np.where(np.arange(len(support)) == vote, likelihood, likelihood * ratio)
        probability = probability * likelihood
        probability = probability / probability.sum()
    return RotationBelief(support, probability, votes, errors)


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
    return errors.symmetry.mean(moves.mT @ estimates)


def posterior(
    errors: RotationErrors,
    estimates: Rotations,
    moves: Rotations,
    scores: Sequence[float] | Array | None = None,
) -> Rotations:
    """Return the pose (3, 3) of `belief` after all views, V of the first and L of the others."""
    if errors.flip_deg:
        agreed = errors.symmetry.cosine(seen := moves.mT @ estimates, seen[:1])
        if agreed.min() > _AGREE:
            return errors.symmetry.mean(seen)
    return belief(errors, estimates, moves, scores).pose


def _entropy(distributions: Array) -> Array:
    """Return the entropy along the last axis, in nats, with 0 log 0 = 0."""
    logs = np.log(np.maximum(distributions, np.finfo(float).tiny))
    return -np.asarray((distributions * logs).sum(axis=-1))


def pose_ambiguity(first: RotationBelief, moves: Rotations) -> Array:
    """Return the entropy of the pose after two views, by Eqs. 1 to 6 with T = V, (k,) in nats."""
    pose = first.errors.conditional("estimate", first.support)[0]
    product = pose * first.errors.conditional("estimate", first.support, moves)
    total = product.sum(axis=2, keepdims=True)
    uniform = np.full_like(product, 1 / product.shape[2])
    np.divide(product, total, out=uniform, where=total > 0)
    return _entropy(first.probability @ uniform)


def information_gain(first: RotationBelief, moves: Rotations) -> Array:
    """Return the expected entropy of the pose after the next view, (k,) in nats."""
    likelihood = first.errors.conditional("truth", first.support, moves)
    noise = _entropy(likelihood) @ first.probability
    gained = _entropy(first.probability @ likelihood) - noise
    return np.asarray(_entropy(first.probability) - gained)


def expected_error(first: RotationBelief, moves: Rotations) -> Array:
    """Return the expected error of the posterior fusion after the next view, (k,) in degrees.

    Errors below `flip_deg` are not counted: they do not depend on the view.
    """
    errors, support = first.errors, first.support
    joint = first.probability[:, None] * errors.conditional("truth", support, moves)
    if not errors.flip_deg:
        weights = np.swapaxes(joint, 1, 2).reshape(-1, len(support))
        fused = chordal_mean(support, np.maximum(weights, np.finfo(float).tiny))
        angles = np.degrees(np.arccos(errors.symmetry.cosine(fused, support)))
        return np.asarray((weights * angles).reshape(len(moves), -1).sum(axis=1))
    distance = np.degrees(np.arccos(errors.symmetry.cosine(support, support)))
    np.fill_diagonal(distance, 0)
    # What it costs to answer each estimate with the estimate itself or with the first one.
    costs = np.stack([(distance * joint).sum(axis=1), distance[0] @ joint])
    own, was = np.diagonal(joint, axis1=1, axis2=2), joint[:, 0]
    return np.asarray(np.where(own > was, costs[0], costs[1]).sum(axis=1))


Criterion = Callable[[RotationBelief, Rotations], Array]
CRITERIA: dict[str, Criterion] = {
    "pose_ambiguity": pose_ambiguity,
    "information_gain": information_gain,
    "expected_error": expected_error,
}
"""Criteria: the cost (k,) of each move (k, 3, 3) under a belief, lower is better."""


def turn_deg(moves: Rotations) -> Array:
    """Return the angle (k,) by which the camera moves around the object, in [0, 180]."""
    forward = viewing_direction(moves)[..., 2]
    return np.degrees(np.arccos(np.clip(-forward, -1, 1)))


def costs_of(criterion: str, first: RotationBelief, moves: Rotations) -> Array:
    """Return the costs (k,) of moves by a criterion's name.

    Raises
    ------
    UserError
        For an unknown criterion.
    """
    if criterion not in CRITERIA:
        raise UserError(f"criterion {criterion!r} is unknown: {nearest(criterion, CRITERIA)}")
    return CRITERIA[criterion](first, moves)


def best_move(costs: Array | None, moves: Rotations) -> int:
    """Return the index of the move of least cost, among equals that of the smallest turn.

    Without costs, because calibration shows no dependence on the view, it is the farthest; see
    `RotationErrors.depends_on_view`.
    """
    turns = turn_deg(moves)
    if costs is None:
        return int(np.argmax(turns))
    return int(np.lexsort((turns, np.round(costs, 9)))[0])
