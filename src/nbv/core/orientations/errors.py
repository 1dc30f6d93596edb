"""V and L of orientations, from pairs of an estimate and the truth (docs/method.md).

An estimator has similar errors where it sees the object from similar directions, whatever the
camera's roll. Pairs are weighted by a kernel in this direction: the estimate's for V, the truth's
for L. A pair with a small error says that the estimate is right there. A pair with a larger error,
a flip, says where the pose is instead. Without small errors (`flip_deg` = 0) this is a kernel
density; on the circle it is that of `nbv.core.circle.density`, which a test shows.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.choose import is_surely_less
from nbv.core.orientations.group import (
    ASYMMETRIC,
    Array,
    Orientations,
    Symmetry,
    inverse,
    spiral,
    viewing_direction,
)

Given = Literal["estimate", "truth"]

NEGLIGIBLE = 1e-3
"""A flip of less weight than this is left out."""

SPACING_DEG = 40.0
"""Angle between the other possible poses."""

MOST_RATIO = 50.0
"""A score never changes the odds of a flip by more than this factor."""


@dataclass(frozen=True)
class ScoreRatio:
    """What an estimator's score says about its estimate being a flip.

    Attributes
    ----------
    scores : ndarray (n,)
        Sorted scores of calibration images. Only a score's rank among them counts.
    slope, offset : float
        log p(score | flip) / p(score | no flip) is ``offset + slope * logit(rank)``.
    """

    scores: Array
    slope: float
    offset: float

    @classmethod
    def fit(cls, scores: ArrayLike, is_flip: NDArray[np.bool_]) -> ScoreRatio:
        """Fit by logistic regression on scores (n,) and flips (n,) of any objects."""
        ordered = np.sort(np.asarray(scores, dtype=np.float64))
        features = np.stack([_logit_rank(ordered, scores), np.ones(len(ordered))], axis=1)
        n_flips = int(is_flip.sum())
        if n_flips in (0, len(is_flip)):
            return cls(ordered, 0.0, 0.0)
        weights = np.array([0.0, np.log(n_flips / (len(is_flip) - n_flips))])
        prior, ridge = weights[1], np.array([1e-3, 0.0])
        for _ in range(50):
            p = 1 / (1 + np.exp(-features @ weights))
            hessian = (features * (p * (1 - p))[:, None]).T @ features + np.diag(ridge)
            step = np.linalg.solve(hessian, features.T @ (is_flip - p) - ridge * weights)
            weights = weights + step
            if np.abs(step).max() < 1e-9:
                break
        return cls(ordered, float(weights[0]), float(weights[1] - prior))

    def __call__(self, scores: ArrayLike) -> Array:
        """Return the likelihood ratio of a flip for each score (n,)."""
        log_ratio = self.offset + self.slope * _logit_rank(self.scores, scores)
        return np.clip(np.exp(log_ratio), 1 / MOST_RATIO, MOST_RATIO)


def _logit_rank(ordered: Array, scores: ArrayLike) -> Array:
    sides = [np.searchsorted(ordered, scores, side) for side in ("left", "right")]
    rank = (np.mean(sides, axis=0) + 0.5) / (len(ordered) + 1)
    return np.asarray(np.log(rank / (1 - rank)))


@dataclass(frozen=True)
class OrientationErrors:
    """An estimator's errors on calibration images of one object or category.

    Attributes
    ----------
    estimate, truth : ndarray (n, 3, 3)
        Poses of the same image, object to camera.
    symmetry : Symmetry
    concentration : float
        Both kernels are exp(concentration (cos(angle) - 1)): 25 has a standard deviation of 11°.
    pseudo_observations : float
        Weight of the mean over all directions, where a pair seen from the same direction weighs 1.
    flip_deg : float
        A larger error is a flip; with 0 every pair is a flip.
    offsets : ndarray (m, 3, 3), optional
        Possible poses relative to the estimate; the first is the identity. By default the flips
        and about even poses `SPACING_DEG` apart.
    ratio : ScoreRatio, optional
        Needed where estimates have scores.
    """

    estimate: Orientations
    truth: Orientations
    symmetry: Symmetry = ASYMMETRIC
    concentration: float = 25.0
    pseudo_observations: float = 3.0
    flip_deg: float = 20.0
    offsets: Orientations | None = None
    ratio: ScoreRatio | None = None

    @cached_property
    def error_deg(self) -> Array:
        """The errors (n,) of the estimates modulo symmetry."""
        return self.symmetry.distance_deg(self.estimate, self.truth)

    @cached_property
    def is_flip(self) -> NDArray[np.bool_]:
        """Which pairs (n,) are flips."""
        if not self.flip_deg:
            return np.ones(len(self.estimate), dtype=bool)
        return np.asarray(self.error_deg > self.flip_deg)

    @property
    def share_of_flips(self) -> float:
        """The probability of a flip over all directions, never 0."""
        if not self.flip_deg:
            return 1.0
        return float((self.is_flip.sum() + 0.5) / (len(self.estimate) + 1))

    @cached_property
    def possible(self) -> Orientations:
        """The `offsets` (m, 3, 3), or their default."""
        if self.offsets is not None:
            return self.offsets
        flips = _apart(np.eye(3)[None], self._flips("estimate"), SPACING_DEG / 2, self.symmetry)
        return _apart(flips, spiral(2000), SPACING_DEG, self.symmetry)

    def _pairs(self, given: Given) -> tuple[Orientations, Orientations]:
        """Return what is given of the pairs, and the other."""
        return (self.estimate, self.truth) if given == "estimate" else (self.truth, self.estimate)

    def _flips(self, given: Given) -> Orientations:
        """Return the flips (f, 3, 3) on the object's axes, from what is given to the other."""
        known, other = (poses[self.is_flip] for poses in self._pairs(given))
        known = self.symmetry.canonical(known)
        return np.asarray(inverse(known) @ self.symmetry.nearest(other, known))

    def _flips_anywhere(self, given: Given, poses: Orientations, support: Orientations) -> Array:
        """Return where flips lead from poses (r, 3, 3), (r, m), whatever the direction.

        Each flip of calibration is applied to the poses; one more leads anywhere.
        """
        m, flips = len(support), self._flips(given)
        if not self.flip_deg or not len(flips):
            return np.full((len(poses), m), 1 / m)
        where = self.symmetry.canonical(poses)[:, None] @ flips
        kernel = self._near(where.reshape(-1, 3, 3), support).reshape(len(poses), -1, m)
        return np.asarray((kernel.sum(axis=1) + 1 / m) / (len(flips) + 1))

    def _near(self, poses: Orientations, support: Orientations) -> Array:
        """Return the kernel about poses (n, 3, 3) among the poses of a support, (n, m)."""
        # In place and in single precision, in half the time.
        kernel = self.symmetry.cosine(poses.astype(np.float32), support.astype(np.float32))
        kernel -= kernel.max(axis=1, keepdims=True)
        kernel *= self.concentration
        np.exp(kernel, out=kernel)
        kernel /= kernel.sum(axis=1, keepdims=True)
        return kernel

    def possible_poses(self, estimate: Orientations) -> Orientations:
        """Return the possible poses (m, 3, 3) after an estimate (3, 3)."""
        return self.symmetry.canonical(estimate[None]) @ self.possible

    def flip_probability(self, poses: Orientations, given: Given) -> Array:
        """Return the probability of a flip for each estimated or true pose (n, 3, 3)."""
        weights = self._weights(poses, self._pairs(given)[0])
        alpha = self.pseudo_observations
        flips = weights[:, self.is_flip].sum(axis=1) + alpha * self.share_of_flips
        return np.asarray(flips / (weights.sum(axis=1) + alpha))

    def _weights(self, poses: Orientations, pairs: Orientations) -> Array:
        cosine = self.symmetry.direction_cosine(*map(viewing_direction, (poses, pairs)))
        return np.asarray(np.exp(self.concentration * (cosine - 1)))

    def conditional(
        self,
        given: Given,
        support: Orientations,
        moves: Orientations | None = None,
        rows: Sequence[int] | NDArray[np.intp] | None = None,
        ratio: ArrayLike = 1.0,
    ) -> Array:
        """Return V or L among the poses of a support, seen after moves of the camera.

        Parameters
        ----------
        given : {"estimate", "truth"}
            V, p(truth | estimate), or L, p(estimate | truth).
        support : ndarray (m, 3, 3)
            Possible poses in the first view.
        moves : ndarray (k, 3, 3), optional
            The view in which the estimator answers; the first one by default.
        rows : (r,) int, optional
            Indices of what is given, in the support; all by default.
        ratio : float or ndarray (r,)
            Likelihood ratio of a flip, given each estimate's score, for V; for L see `belief`.

        Returns
        -------
        ndarray (k, r, m)
            Rows that sum to 1, of poses in the first view.
        """
        m = len(support)
        moves = np.eye(3)[None] if moves is None else moves
        rows = np.arange(m) if rows is None else np.asarray(rows)
        poses = (moves[:, None] @ support[rows]).reshape(-1, 3, 3)
        known, other = self._pairs(given)
        weights = self._weights(poses, known)
        alpha, share = self.pseudo_observations, self.share_of_flips
        right = weights[:, ~self.is_flip].sum(axis=1) + alpha * (1 - share)
        flips = np.flatnonzero(self.is_flip)
        anywhere = alpha * share * self._flips_anywhere(given, support[rows], support)
        result = np.tile(anywhere, (len(moves), 1))
        i, k = np.nonzero(weights[:, flips] > NEGLIGIBLE)
        if len(i):
            pair = flips[k]
            element = self.symmetry.towards(viewing_direction(poses[i]), known[pair])
            roll = _roll(poses[i] @ inverse(known[pair] @ element))
            where = inverse(moves[i // len(rows)]) @ roll @ other[pair]
            from scipy.sparse import csr_array

            entries = weights[i, pair].astype(np.float32), (i, np.arange(len(i)))
            by_row = csr_array(entries, shape=(len(poses), len(i)))
            result += np.asarray(by_row @ self._near(where, support))
        result = result.reshape(len(moves), len(rows), m) * np.reshape(ratio, (-1, 1))
        result[:, np.arange(len(rows)), rows] += right.reshape(len(moves), -1)
        total = result.sum(axis=2, keepdims=True)
        np.divide(result, total, out=result, where=total > 0)
        result[total[..., 0] <= 0] = 1 / m
        return np.asarray(result)

    def depends_on_view(self, groups: Sequence[Hashable] | NDArray[Any]) -> bool:
        """Return whether the viewing direction says more about flips than their share does.

        It compares the log likelihoods of the flips of each group, an instance or an object, given
        the pairs of all others. A gain of more than a standard error over groups counts.
        """
        labels = np.unique(np.asarray(groups), return_inverse=True)[1]
        n_groups = int(labels.max()) + 1
        if n_groups < 2:
            return False
        gains = np.empty(n_groups)
        for label in range(n_groups):
            held_out = labels == label
            others = replace(self, estimate=self.estimate[~held_out], truth=self.truth[~held_out])
            by_view = others.flip_probability(self.estimate[held_out], "estimate")
            shares = np.full_like(by_view, others.share_of_flips)
            flips = self.is_flip[held_out]
            by_view, shares = (np.where(flips, p, 1 - p) for p in (by_view, shares))
            gains[label] = np.log(by_view / shares).sum()
        return is_surely_less(-gains, factor=1.0)


def _apart(
    kept: Orientations, more: Orientations, spacing_deg: float, symmetry: Symmetry
) -> Orientations:
    """Return orientations, and those of `more` that are apart from all before."""
    nearest = np.cos(np.radians(spacing_deg))
    free = symmetry.cosine(more, kept).max(axis=1) < nearest
    chosen: list[int] = []
    while free.any():
        chosen.append(int(np.argmax(free)))
        free &= symmetry.cosine(more, more[chosen[-1:]])[:, 0] < nearest
    return np.concatenate([kept, more[chosen]])


def _roll(a: Orientations) -> Orientations:
    """Return the rotation about the optical axis nearest to each orientation (n, 3, 3)."""
    angle = np.arctan2(a[:, 1, 0] - a[:, 0, 1], a[:, 0, 0] + a[:, 1, 1])
    roll = np.zeros_like(a)
    roll[:, 0, 0] = roll[:, 1, 1] = np.cos(angle)
    roll[:, 1, 0] = np.sin(angle)
    roll[:, 0, 1] = -roll[:, 1, 0]
    roll[:, 2, 2] = 1
    return roll
