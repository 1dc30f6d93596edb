"""Beliefs and fusion of orientations (docs/method.md).

The next camera pose is a move M (3, 3) from the first camera: what is seen as R there is M R. Every
pose here is in the first camera, so a rotation of the world changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.orientations.errors import SAME_DEG, OrientationErrors, apart
from nbv.core.orientations.group import Array, Orientations, inverse

AGREE_DEG = 25.0
"""Estimates nearer than this are of the same pose; their mean has a smaller error than each."""

_AGREE = np.cos(np.radians(AGREE_DEG))


@dataclass(frozen=True)
class OrientationBelief:
    """A distribution of the pose after one view or more.

    Attributes
    ----------
    support : ndarray (m, 3, 3)
        Possible poses in the first camera.
    probability : ndarray (m,)
        Sums to 1.
    votes : ndarray (n_views,) int
        Index of the pose of the support that each view's estimate supports.
    errors : OrientationErrors
    """

    support: Orientations
    probability: Array
    votes: NDArray[np.intp]
    errors: OrientationErrors

    @property
    def _answer(self) -> int:
        """Index of the most probable pose of those that the estimates support."""
        return int(self.votes[np.argmax(self.probability[self.votes])])

    @property
    def pose(self) -> Orientations:
        """The fused pose (3, 3).

        It is the most probable pose among those the estimates support; ties go to the earlier
        view.
        """
        return np.asarray(self.support[self._answer])

    @property
    def n_agreeing(self) -> int:
        """The number of views whose estimates have the fused pose as their mean."""
        return int((self.votes == self._answer).sum())

    @property
    def error_deg(self) -> float:
        """The expected error of the fused pose, degrees."""
        distance = self.errors.symmetry.distance_deg(self.support, self.pose)
        small = self.errors.small_errors_deg(self.n_agreeing)
        return float(self.probability @ distance + small.mean())

    def probability_within(self, error_deg: float) -> float:
        """Return the probability that the fused pose errs by less."""
        distance = self.errors.symmetry.distance_deg(self.support, self.pose)
        near = float(self.probability[distance < max(error_deg, AGREE_DEG)].sum())
        small = self.errors.small_errors_deg(self.n_agreeing)
        # Small errors have a size, but no direction.
        return near * float((small < error_deg).mean())


def belief(
    errors: OrientationErrors,
    estimates: Orientations,
    moves: Orientations,
    ratios: Array | None = None,
) -> OrientationBelief:
    """Return the belief after n views: V of the first estimate, times L of each further one.

    There is an estimate (n, 3, 3) in each view. Moves (n, 3, 3) are from the first camera to each;
    the first is the identity. `ratios` (n,) are likelihood ratios of a flip, given each estimate's
    score; by default 1.
    """
    support, votes = _support(errors, inverse(moves) @ estimates)
    ratios = np.ones(len(votes)) if ratios is None else ratios
    weights = errors.conditional("estimate", support, None, votes[:1], ratios[0])[0, 0]
    for vote, move, ratio in zip(votes[1:], moves[1:], ratios[1:], strict=True):
        likelihood = errors.conditional("truth", support, move[None])[0, :, vote]
        # The score rates the estimate; without a flip the estimate is the truth.
        weights = weights * likelihood * np.where(np.arange(len(support)) == vote, 1.0, ratio)
        weights = weights / weights.sum()
    return OrientationBelief(support, weights, votes, errors)


def _support(
    errors: OrientationErrors, seen: Orientations
) -> tuple[Orientations, NDArray[np.intp]]:
    """Return the support, and the index in it of each of the estimates (n, 3, 3)."""
    symmetry = errors.symmetry
    possible = symmetry.canonical(seen[:1]) @ errors.possible
    votes = np.full(len(seen), -1)
    means: list[Orientations] = []
    for i in range(len(seen)):
        if votes[i] < 0:
            near = (votes < 0) & (symmetry.cosine(seen[i : i + 1], seen)[0] > _AGREE)
            votes[near] = len(means)
            means.append(symmetry.mean(seen[near]))
    # A pose that an estimate supports is not held twice.
    return apart(np.stack(means), possible[1:], SAME_DEG, symmetry), votes


def hypotheses_belief(
    errors: OrientationErrors, hypotheses: Orientations, ratios: Array
) -> OrientationBelief:
    """Return the belief after one view whose estimator gave several poses (n, 3, 3), best first.

    It is the mean of V of each, weighted by the likelihood that it is no flip, 1 / `ratios` (n,).
    """
    support, votes = _support(errors, hypotheses)
    rows = errors.conditional("estimate", support, None, votes, ratios[:, None])[0]
    return OrientationBelief(support, (1 / ratios / (1 / ratios).sum()) @ rows, votes, errors)
