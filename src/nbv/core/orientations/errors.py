"""V and L of orientations, from pairs of an estimate and the truth (docs/method.md).

An estimator has similar errors where it sees the object from similar directions, whatever the
camera's roll. Pairs are weighted by a kernel in this direction: the estimate's for V, the truth's
for L. A pair with a small error says that the estimate is right there. A pair with a larger error,
a flip, says where the pose is instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.orientations.group import (
    ASYMMETRIC,
    Array,
    Floats,
    Orientations,
    Symmetry,
    inverse,
    spiral,
    viewing_direction,
)

Given = Literal["estimate", "truth"]

MOST_KINDS = 16
"""Kinds of flips, rotations within `SAME_DEG`; rarer ones lead anywhere."""

MOST_CELLS = 2000
"""Viewing directions, at most, in which pairs are counted: more pairs are counted together."""

STRENGTHS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Pseudo-observations that `shrinkage` compares: never none, and never so many that none count."""

FIXED_STRENGTH = 10.0
"""With too few groups for `shrinkage`; chosen in docs/reference/rotations/protocol.md."""

FEWEST_GROUPS = 4
"""Instances or scenes of all objects, from which `shrinkage` compares strengths."""

MOST_PARTS = 200
"""Parts of an object's groups that `shrinkage` leaves out, at most, one at a time."""

LEAST_GAIN = 2.0
"""A larger gain of log likelihood has a probability of a few per cent by chance."""

SPACING_DEG = 60.0
"""Angle between the other possible poses."""

SAME_DEG = 20.0
"""Flips of a kind, and poses of a support that are one, are nearer than this."""

MOST_RATIO = 50.0
"""A score never changes the odds of a flip by more than this factor."""

SCORE_BINS = 8
"""Bins of the next view's score."""


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
        """Fit by logistic regression on scores (n,) and flips (n,) of any objects.

        A slope that gains less than `LEAST_GAIN` over none is not shown, and is 0.
        """
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
        fitted, constant = (
            -np.logaddexp(0, np.where(is_flip, -1, 1) * (features @ each)).sum()
            for each in (weights, np.array([0.0, prior]))
        )
        if fitted < constant + LEAST_GAIN:
            return cls(ordered, 0.0, 0.0)
        return cls(ordered, float(weights[0]), float(weights[1] - prior))

    def __call__(self, scores: ArrayLike) -> Array:
        """Return the likelihood ratio of a flip for each score (n,)."""
        log_ratio = self.offset + self.slope * _logit_rank(self.scores, scores)
        return np.clip(np.exp(log_ratio), 1 / MOST_RATIO, MOST_RATIO)

    def shares(self, share_of_flips: float) -> Array:
        """Return the shares (`SCORE_BINS`, 2) of right estimates and of flips, by their scores.

        Bins are of equal probability.
        """
        quantiles = (np.arange(SCORE_BINS) + 0.5) / SCORE_BINS
        ratio = self(np.quantile(self.scores, quantiles, method="nearest"))
        shares = np.stack([np.ones(SCORE_BINS), ratio]) / (1 + share_of_flips * (ratio - 1))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True)).T


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
        Pairs that stand in each direction for the object's share of flips; see `shrinkage`.
    flip_deg : float
        A larger error is a flip.
    share : float, optional
        Share of flips of all objects, towards which that of this one is shrunk.
    ratio : ScoreRatio, optional
        Needed where estimates have scores.
    group : ndarray (n,), optional
        The instance or scene of each pair, whose errors are alike. By default each pair is a group.
    """

    estimate: Orientations
    truth: Orientations
    symmetry: Symmetry = ASYMMETRIC
    concentration: float = 25.0
    pseudo_observations: float = FIXED_STRENGTH
    flip_deg: float = 20.0
    share: float | None = None
    ratio: ScoreRatio | None = None
    group: NDArray[Any] | None = None

    @cached_property
    def error_deg(self) -> Array:
        """The errors (n,) of the estimates modulo symmetry."""
        return self.symmetry.distance_deg(self.estimate, self.truth)

    @cached_property
    def is_flip(self) -> NDArray[np.bool_]:
        """Which pairs (n,) are flips."""
        return np.asarray(self.error_deg > self.flip_deg)

    def small_errors_deg(self, n_views: int) -> Array:
        """Return the errors, without flips, of the mean of estimates of several views, (r,).

        Errors of views of one group are correlated; where groups are unknown, they are one error.
        Where every pair is a flip, the error is 0.
        """
        variance = (1 + (n_views - 1) * self._correlation) / n_views
        small = np.zeros(1) if self.is_flip.all() else self.error_deg[~self.is_flip]
        return np.asarray(small * np.sqrt(variance))

    @cached_property
    def _correlation(self) -> float:
        """Correlation of the errors, without flips, of two views of a group, in [0, 1]."""
        truth, labels = self.truth[~self.is_flip], self.labels[~self.is_flip]
        n = np.bincount(labels)
        if not (n_pairs := int((n * (n - 1)).sum())):
            return 1.0
        relative = inverse(truth) @ self.symmetry.nearest(self.estimate[~self.is_flip], truth)
        from scipy.spatial.transform import Rotation

        error = Rotation.from_matrix(relative).as_rotvec()
        sums = np.zeros((len(n), 3))
        np.add.at(sums, labels, error)
        if not (squares := np.square(error).sum()):
            return 1.0
        products = np.square(sums).sum() - squares
        return float(np.clip(products / n_pairs / (squares / len(error)), 0, 1))

    @property
    def depends_on_view(self) -> bool:
        """Whether flips depend on the viewing direction, by `shrinkage`."""
        return bool(self.is_flip.any()) and self.pseudo_observations < STRENGTHS[-1]

    @property
    def share_of_flips(self) -> float:
        """The probability of a flip over all directions, never 0."""
        n, n_flips = len(self.estimate), self.is_flip.sum()
        if self.share is None:
            return float((n_flips + 0.5) / (n + 1))
        # A pair weighs 1 / (2 concentration) in the mean over all directions.
        pairs = self.pseudo_observations * 2 * self.concentration
        return float(_shrunk(n_flips, n, self.share, pairs))

    @cached_property
    def possible(self) -> Orientations:
        """Possible poses (m, 3, 3) relative to an estimate; the first is the identity.

        They are the kinds of flips, and about even poses `SPACING_DEG` apart.
        """
        kinds = self._kinds["estimate"].rotations
        kinds = apart(np.eye(3)[None], kinds, SAME_DEG, self.symmetry)
        return apart(kinds, spiral(2000), SPACING_DEG, self.symmetry)

    @cached_property
    def labels(self) -> NDArray[np.intp]:
        """The number (n,) of each pair's group."""
        if self.group is None:
            return np.arange(len(self.estimate))
        return np.asarray(np.unique(self.group, return_inverse=True)[1])

    @cached_property
    def halves(self) -> tuple[OrientationErrors, ...]:
        """The errors on every second group, and on the others; of a single group, on its pairs."""
        labels = self.labels if self.labels.any() else np.arange(len(self.estimate))
        return tuple(
            replace(self, estimate=self.estimate[k], truth=self.truth[k], group=labels[k])
            for k in (labels % 2 == 0, labels % 2 == 1)
        )

    @cached_property
    def unshrunk(self) -> OrientationErrors:
        """The errors with hardly any shrinkage."""
        return replace(self, pseudo_observations=0.01)

    @cached_property
    def _kinds(self) -> dict[Given, _Kinds]:
        v = _Kinds.of(self, self.estimate, self.truth)
        return {"estimate": v, "truth": _Kinds.of(self, self.truth, self.estimate)}

    def _counts(self, poses: Orientations, given: Given) -> Array:
        """Return weighted counts of right estimates, and of each kind of flips, (n, 1 + J)."""
        kinds, share = self._kinds[given], self.share_of_flips
        prior = np.concatenate([[1 - share], share * kinds.share])
        # In place and in single precision, in half the time.
        directions = viewing_direction(poses).astype(np.float32)
        weights = self.symmetry.direction_cosine(directions, kinds.directions)
        weights -= 1
        weights *= np.float32(self.concentration)
        np.exp(weights, out=weights)
        return np.asarray(weights @ kinds.counts + self.pseudo_observations * prior)

    def _near(self, poses: Orientations, support: Orientations) -> Floats:
        """Return the kernel about poses (n, 3, 3) among the poses of a support, (n, m)."""
        kernel = self.symmetry.cosine(poses.astype(np.float32), support.astype(np.float32))
        kernel -= kernel.max(axis=1, keepdims=True)
        kernel *= self.concentration
        np.exp(kernel, out=kernel)
        kernel /= kernel.sum(axis=1, keepdims=True)
        return kernel

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
        counts = self._counts(poses, given)
        rotations = self._kinds[given].rotations
        seen = self.symmetry.canonical(poses)
        back = np.repeat(inverse(moves), len(rows), axis=0) @ seen
        where = (back[:, None] @ rotations).reshape(-1, 3, 3)
        near = self._near(where, support).reshape(len(poses), -1, m)
        result = np.einsum("nj,njm->nm", counts[:, 1:-1], near) + counts[:, -1:] / m
        result = result.reshape(len(moves), len(rows), m) * np.reshape(ratio, (-1, 1))
        result[:, np.arange(len(rows)), rows] += counts[:, 0].reshape(len(moves), -1)
        return np.asarray(result / result.sum(axis=2, keepdims=True))


@dataclass(frozen=True)
class _Kinds:
    """The flips of one conditional by the rotation on the object's axes, and where they occur.

    Attributes
    ----------
    rotations : ndarray (J, 3, 3)
        From what is given to the other, for each kind.
    share : ndarray (J + 1,)
        Share of each kind among the flips; the last leads anywhere.
    directions : ndarray (p, 3)
        Viewing directions of pairs.
    counts : ndarray (p, J + 2)
        Right pairs, flips of each kind, and other flips there.
    """

    rotations: Orientations
    share: Array
    directions: NDArray[np.float32]
    counts: NDArray[np.float32]

    @classmethod
    def of(cls, errors: OrientationErrors, known: Orientations, other: Orientations) -> _Kinds:
        """Sort flips into kinds, the most frequent first, and pairs into directions."""
        symmetry, flips = errors.symmetry, np.flatnonzero(errors.is_flip)
        known = symmetry.canonical(known)
        rotations = inverse(known[flips]) @ symmetry.nearest(other[flips], known[flips])
        column = np.zeros(len(known), dtype=np.intp)
        means: list[Orientations] = []
        near = symmetry.cosine(rotations, rotations) > np.cos(np.radians(SAME_DEG))
        free = np.ones(len(flips), dtype=bool)
        while free.any() and len(means) < MOST_KINDS:
            members = near[(near & free).sum(axis=1).argmax()] & free
            if members.sum() < 2:
                break
            means.append(symmetry.mean(rotations[members]))
            column[flips[members]] = len(means)
            free &= ~members
        n_kinds = len(means)
        column[flips[free]] = n_kinds + 1
        directions, cell = _cells(viewing_direction(known))
        counts = np.zeros((len(directions), n_kinds + 2))
        np.add.at(counts, (cell, column), 1)
        # The first flip of a kind does not say that there will be another one of its kind.
        discount = np.zeros(n_kinds + 2)
        discount[1:-1] = 1 / counts.sum(axis=0)[1:-1]
        counts[:, -1] += counts @ discount
        counts *= 1 - discount
        numbers = counts.sum(axis=0)[1:] + np.eye(n_kinds + 1)[-1]
        rotations = np.stack(means) if means else np.empty((0, 3, 3))
        single = directions.astype(np.float32), counts.astype(np.float32)
        return cls(rotations, numbers / numbers.sum(), *single)


def _cells(directions: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return at most `MOST_CELLS` mean directions (p, 3), and the one of each direction (n,)."""
    if len(directions) <= MOST_CELLS:
        return directions, np.arange(len(directions))
    centres = viewing_direction(spiral(MOST_CELLS))
    cell = np.unique((directions @ centres.T).argmax(axis=1), return_inverse=True)[1]
    means = np.zeros((cell.max() + 1, 3))
    np.add.at(means, cell, directions)
    return means / np.linalg.norm(means, axis=1, keepdims=True), cell


def _shrunk(n_flips: Any, n: Any, share: Any, pseudo_pairs: Any) -> Array:
    """Return shares of flips, shrunk towards another share by so many pairs."""
    return np.asarray((n_flips + pseudo_pairs * share) / (n + pseudo_pairs), dtype=np.float64)


def shrinkage(objects: Sequence[OrientationErrors]) -> float:
    """Return the pseudo-observations with which flips of left-out groups are the likeliest.

    A flip's probability is shrunk from the share near its direction towards the object's share,
    and this towards the share of all objects. One number serves both: so many pairs in each
    direction. The likelihood is that of the flips of each group given all others. Unless it is
    larger than with the most pseudo-observations by `LEAST_GAIN` nats, flips are not shown to
    depend on the view, and the most are taken.

    Returns
    -------
    float
        One of `STRENGTHS`; `FIXED_STRENGTH` with fewer than `FEWEST_GROUPS` groups in all.
    """
    if sum(int(errors.labels.max()) + 1 for errors in objects) < FEWEST_GROUPS:
        return FIXED_STRENGTH
    n_all = sum(len(errors.labels) for errors in objects)
    flips_all = sum(int(errors.is_flip.sum()) for errors in objects)
    strengths, likelihood = np.array(STRENGTHS)[:, None], np.zeros(len(STRENGTHS))
    for errors in objects:
        directions, flips = viewing_direction(errors.estimate), errors.is_flip
        part = errors.labels % MOST_PARTS
        for rows in part == np.unique(part)[:, None]:
            cosine = errors.symmetry.direction_cosine(directions[rows], directions[~rows])
            weights = np.exp(errors.concentration * (cosine - 1))
            share = (flips_all - flips[rows].sum() + 0.5) / (n_all - rows.sum() + 1)
            pairs = 2 * errors.concentration * strengths
            of_object = _shrunk(flips[~rows].sum(), (~rows).sum(), share, pairs)
            p = _shrunk(weights @ flips[~rows], weights.sum(axis=1), of_object, strengths)
            likelihood += np.log(np.where(flips[rows], p, 1 - p)).sum(axis=1)
    is_shown = likelihood.max() > likelihood[-1] + LEAST_GAIN
    return STRENGTHS[int(likelihood.argmax()) if is_shown else -1]


def apart(
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
