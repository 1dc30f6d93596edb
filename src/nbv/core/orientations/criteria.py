"""What is expected of the pose after the next view, by orientations (docs/method.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nbv.core.orientations.belief import AGREE_DEG, OrientationBelief
from nbv.core.orientations.errors import ScoreRatio
from nbv.core.orientations.group import Array, Orientations, viewing_direction

N_COMPARED = 12
"""Candidates of least expected error that are compared for `optimism_deg`."""


def bayes_error(
    before: OrientationBelief,
    moves: Orientations,
    within_deg: Sequence[float],
    ratio: ScoreRatio | None = None,
) -> tuple[Array, Array]:
    """Return the expected error of the pose after the next view, and its probabilities.

    It is the Bayes risk of the fused pose, the expectation under V, L and the next score, as
    `nbv.core.circle.criteria.bayes_error` is on the circle. Errors below `flip_deg` are taken to
    depend on the number of views alone.

    Parameters
    ----------
    before : OrientationBelief
        Its support has m poses.
    moves : ndarray (k, 3, 3)
        Moves from the first camera to each of the views.
    within_deg : sequence of n floats
    ratio : ScoreRatio, optional
        What the next estimate's score will say; by default it has none.

    Returns
    -------
    error_deg : ndarray (k,)
    within : ndarray (n, k)
        Probabilities that the error is less than each of `within_deg`.
    """
    errors, support = before.errors, before.support
    distance = np.degrees(np.arccos(errors.symmetry.cosine(support, support)))
    np.fill_diagonal(distance, 0)
    joint = before.probability[:, None] * errors.conditional("truth", support, moves)
    pose = np.arange(len(support))
    right = joint[:, pose, pose]
    joint[:, pose, pose] = 0
    # The answer is the pose of the next estimate, or one that an earlier estimate supports.
    voted = np.unique(before.votes)
    is_voted = 1.0 * (voted[:, None] == pose)
    losses = [distance, *(1.0 * (distance >= max(deg, AGREE_DEG)) for deg in within_deg)]
    of_next = [(loss * joint).sum(axis=1) for loss in losses]
    of_voted = [(loss[voted] @ joint, loss[voted] * right[:, None]) for loss in losses]
    risks = np.zeros((len(losses), len(moves)))
    for if_right, if_flip in (
        ((1.0, 1.0),) if ratio is None else ratio.shares(errors.share_of_flips)
    ):
        chances = if_flip * joint[:, voted] + if_right * is_voted * right[:, None]
        earlier = chances.argmax(axis=1)[:, None]
        is_next = if_right * right > np.take_along_axis(chances, earlier, axis=1)[:, 0]
        for risk, other, (flip, same) in zip(risks, of_next, of_voted, strict=True):
            kept = np.take_along_axis(if_flip * flip + if_right * same, earlier, axis=1)[:, 0]
            risk += np.where(is_next, if_flip * other, kept).sum(axis=1)
    small = errors.small_errors_deg(before.n_agreeing + 1)
    shares = np.array([(small < deg).mean() for deg in within_deg])
    return risks[0] + small.mean(), (1 - risks[1:]) * shares[:, None]


def optimism_deg(
    before: OrientationBelief,
    moves: Orientations,
    error_deg: Array,
    ratio: ScoreRatio | None = None,
) -> float:
    """Return by how much the least of expected errors (k,) is too low, 0 or more.

    The least of uncertain numbers is optimistic, as in `nbv.core.alike.expected`: each half of the
    groups errs more at the candidate that the other half chooses than at its own. Twice as many
    groups vary by the square root of two less. Shrinkage has already raised the least.
    """
    errors = before.errors
    if not errors.depends_on_view:
        return 0.0
    least = np.argsort(error_deg, kind="stable")[:N_COMPARED]
    first, second = (
        bayes_error(replace(before, errors=half), moves[least], (), ratio)[0]
        for half in errors.halves
    )
    more = first[second.argmin()] - first.min() + second[first.argmin()] - second.min()
    unshrunk = replace(before, errors=errors.unshrunk)
    raised = error_deg.min() - bayes_error(unshrunk, moves[least[:1]], (), ratio)[0][0]
    return max(0.0, float(more / 2 / np.sqrt(2) - raised))


def view_angle_deg(moves: Orientations) -> Array:
    """Return the angle (k,) between the viewing directions before and after moves, in [0, 180]."""
    forward = viewing_direction(moves)[..., 2]
    return np.degrees(np.arccos(np.clip(-forward, -1, 1)))
