"""What another view led to on calibration objects that looked alike, after any number of views.

Calibration objects are turned as the object at hand was: their distributions are multiplied after
the same rotations. Where the product is then like the belief at hand, the errors that each
further rotation really led to count. It is `expected_error` with the fusion ``product``, without
its restriction to one first view.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from nbv.recommendation.evidence import Table

COMPARED_DEG = 6.0
"""Beliefs are compared, and errors found, at most so many degrees apart, if bins are finer.

Half as much is read for a frame then as in bins of 3 degrees.
"""

MOST_COMPARED = 4000
"""First views at most that a belief is compared with: neighbours are alike.

The tables of all 15,000 views of 125 turns are much larger than the cache of a processor's core.
How many are enough: docs/reference/bundles/README.md.
"""

N_PARTS = 5
"""Of the calibration objects, for `Expected.optimism_deg`."""

_N_COUNTS = 8

FLAT = 1e-5
"""Of distributions: below this resultant length the mean direction is rounding, and errs by 90°."""


def in_object_frame(distributions: Table) -> Table:
    """Return distributions (S, B, B) of views, turned so that index 0 is the true pose.

    View k of B has the azimuth 360 k / B; entry u of the result is the probability of the pose
    360 u / B degrees ahead of the true one.
    """
    n_turns, n_bins, _ = distributions.shape
    return _started_at(distributions, np.tile(np.arange(n_bins), (n_turns, 1)))


def compared_step(n_bins: int) -> int:
    """Return how many bins of a full turn are one in comparisons: a divisor of all of them."""
    most = max(int(COMPARED_DEG * n_bins / 360.0), 1)
    return next(step for step in range(most, 0, -1) if n_bins % step == 0)


def first_views(n_turns: int, n_bins: int, most: int | None = None) -> NDArray[np.intp]:
    """Return which views of each turn are first ones, (n_turns, K), in bins.

    Those of a turn are evenly apart. Those of the next turn are one bin further, so that all turns
    together have them everywhere.

    Parameters
    ----------
    n_turns, n_bins : int
    most : int, optional
        Of all turns together, but at least one of each; without it every view is one.
    """
    of_turn = n_bins if most is None else max(most // n_turns, 1)
    apart = next(n for n in range(1, n_bins + 1) if n_bins % n == 0 and n_bins // n <= of_turn)
    return np.arange(n_turns)[:, None] % apart + np.arange(0, n_bins, apart)


def error_after_deg(so_far: Table, views: Table, first: NDArray[np.intp], step: int = 1) -> Table:
    """Return the error of the product with further views, (S, K, B / step) float32, degrees.

    With c of the views so far and c' of a further one, both from `in_object_frame`, the mean
    direction of the product is that of ``sum_u c(u) c'(u) exp(i u)``: one product of matrices for
    all pairs of views.

    Parameters
    ----------
    so_far : ndarray (S, K, B)
        Of the fused views, by the first one.
    views : ndarray (S, B, B)
        Of single views.
    first : ndarray (S, K)
        The first views, from `first_views`.
    step : int
        Further views are so many bins apart; a divisor of B.

    Returns
    -------
    ndarray
        ``[s, k, d]``: of the k-th first view with a further view at the rotation ``step d``, in
        bins.
    """
    n_turns, n_first, n_bins = so_far.shape
    apart, n_steps = n_bins // n_first, n_bins // step
    common = math.gcd(apart, step)
    # First views whole steps apart have their further views in common: each such set is a group.
    n_groups, n_in_group = step // common, n_first * common // step
    places = first[:, :n_groups, None] + step * np.arange(n_steps)
    further = views[np.arange(n_turns)[:, None, None], places % n_bins]
    # Small products are twice as fast of arrays that lie in their order.
    further = np.ascontiguousarray(further.transpose(0, 1, 3, 2))

    def of_pairs(rows: Table) -> Table:
        groups = rows.reshape(n_turns, n_in_group, n_groups, n_bins).transpose(0, 2, 1, 3)
        return np.asarray(np.matmul(groups, further))

    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    real = of_pairs(so_far * np.cos(angles).astype(np.float32))
    imaginary = of_pairs(so_far * np.sin(angles).astype(np.float32))
    error = np.abs(np.degrees(np.arctan2(imaginary, real))).astype(np.float32)
    error[np.hypot(real, imaginary) < FLAT * of_pairs(so_far)] = 90.0
    ahead = apart // common * np.arange(n_in_group) % n_steps
    by_rotation = _started_at(error, np.broadcast_to(ahead, error.shape[:-1]))
    return by_rotation.transpose(0, 2, 1, 3).reshape(n_turns, n_first, n_steps)


def near_first_views(errors_deg: Table, first: NDArray[np.intp]) -> Table:
    """Return the mean errors (S, K, m) of all first views near each of some.

    Near are those up to half way to the next of `first`. One that is half way counts half for each
    of the two.

    Parameters
    ----------
    errors_deg : ndarray (S, B, m)
        By the first view.
    first : ndarray (S, K)
        In bins, B / K apart.
    """
    n_turns, n_bins, _ = errors_deg.shape
    apart = n_bins // first.shape[1]
    near = np.arange(-(apart // 2), apart // 2 + 1)
    share = np.minimum(1.0, (apart + 1) / 2 - np.abs(near)).astype(np.float32) / np.float32(apart)
    places = (first[:, :, None] + near) % n_bins
    rows = errors_deg[np.arange(n_turns)[:, None, None], places]
    return np.asarray(np.einsum("skum,u->skm", rows, share))


def error_of_deg(so_far: Table) -> Table:
    """Return the error of the mean direction of distributions `in_object_frame`, degrees."""
    moment = _moment(so_far)
    error = np.abs(np.degrees(np.arctan2(moment[..., 1], moment[..., 0]))).astype(np.float32)
    return np.where(_resultant_length(so_far) < FLAT, np.float32(90.0), error)


def _moment(distributions: Table) -> Table:
    n_bins = distributions.shape[-1]
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    return distributions @ np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)


def _resultant_length(distributions: Table) -> Table:
    return np.asarray(np.linalg.norm(_moment(distributions), axis=-1))


@dataclass(frozen=True)
class Expected:
    """What one belief leads one to expect.

    Attributes
    ----------
    now_deg : float
        The expected error.
    after_deg : ndarray (B,)
        The same after a view at every rotation.
    parts : ndarray (N, M) float32
        Weighted errors after a view at each of M rotations, 360 / M degrees apart, summed over each
        part of the calibration objects.
    total : ndarray (M,)
        The same of all objects and of the pseudo-observations.
    weight : float
        Of all that is in `total`.
    """

    now_deg: float
    after_deg: NDArray[np.float64]
    parts: Table
    total: NDArray[np.float64]
    weight: float

    def optimism_deg(self, is_choice: NDArray[np.bool_]) -> float:
        """Return by how much the least expected error is too low, 0 or more.

        The least of uncertain numbers is lower than what they estimate. How much is found by
        cross-validation of the choice: each part of the objects errs more at the rotation that the
        other parts choose than at the one that all choose. The pseudo-observations take part in
        each choice. With one part it is 0.

        Parameters
        ----------
        is_choice : ndarray (M,)
            Which of the M rotations from the first view there are to choose from; one or more.
        """
        if len(self.parts) == 1:
            return 0.0
        total = np.where(is_choice, self.total, np.inf)
        of_all = total.argmin()
        of_others = (total - self.parts).argmin(axis=1).tolist()
        # A few numbers: quicker than more arrays.
        more = sum(
            own[other] - own[of_all] for own, other in zip(self.parts, of_others, strict=True)
        )
        return float(more / self.weight)


@dataclass(frozen=True)
class _Counts:
    """How much calibration counts.

    Attributes
    ----------
    of_view : ndarray (S,)
        A first view of each turn.
    of_parts : ndarray (N + 1, S) float32
        The same in each part of the objects, and in all of them.
    prior : ndarray (m + 2,)
        The sums of the pseudo-observations, as of `LookAlikes._errors`.
    """

    of_view: NDArray[np.float64]
    of_parts: Table
    prior: NDArray[np.float64]


@dataclass(frozen=True)
class LookAlikes:
    """Calibration turns after some rotations.

    Attributes
    ----------
    so_far : ndarray (S, K, B) float32
        Distributions of the fused views `in_object_frame`, by the first view; rows sum to 1.
    views : ndarray (S, B, B) float32
        Those of all single views.
    first : ndarray (S, K)
        The first views that a belief is compared with, in bins; see `first_views`.
    object_ids : sequence of str, or None
        Of the turns (S,); None where each is of another object. One object's turns are in one part
        of `Expected.parts`.
    near_deg : ndarray (S, K, M + 1), or None
        Errors after a view at each of M rotations, and now, that count instead of those of `first`.
    """

    so_far: Table
    views: Table
    first: NDArray[np.intp]
    object_ids: Sequence[str] | None = None
    near_deg: Table | None = None

    @staticmethod
    def of_views(
        distributions: Table, most: int | None = None, object_ids: Sequence[str] | None = None
    ) -> LookAlikes:
        """Return the turns after one view, of distributions (S, B, B) of views a bin apart.

        ``most`` of all first views together are compared, as in `first_views`. With each one, the
        errors of all first views near it count (`near_first_views`); after further views, whose
        errors have to be found while a robot waits, its own alone.
        """
        views = in_object_frame(np.asarray(distributions, dtype=np.float32))
        n_turns, n_bins, _ = views.shape
        everything = LookAlikes(views, views, first_views(n_turns, n_bins), object_ids)
        first = first_views(n_turns, n_bins, most)
        if first.shape == everything.first.shape:
            return everything
        near_deg = near_first_views(everything.errors_deg, first)
        turns = np.arange(n_turns)[:, None]
        return LookAlikes(views[turns, first], views, first, object_ids, near_deg)

    def after(self, rotation_bins: int) -> LookAlikes:
        """Return the turns after one more view, at a rotation from the first one."""
        n_turns, _, n_bins = self.so_far.shape
        places = (self.first + rotation_bins) % n_bins
        both = self.so_far * self.views[np.arange(n_turns)[:, None], places]
        return replace(self, so_far=both / both.sum(axis=2, keepdims=True), near_deg=None)

    @cached_property
    def _step(self) -> int:
        return compared_step(self.views.shape[-1])

    @property
    def error_now_deg(self) -> Table:
        """`error_of_deg` of the turns, (S, K)."""
        return error_of_deg(self.so_far)

    @cached_property
    def errors_deg(self) -> Table:
        """The errors after a view at each of M rotations, and now: (S, K, M + 1).

        Those that count for the first views; the rotations are whole steps apart.
        """
        if self.near_deg is not None:
            return self.near_deg
        after = error_after_deg(self.so_far, self.views, self.first, self._step)
        return np.concatenate([after, self.error_now_deg[:, :, None]], axis=2)

    def expected_error_deg(
        self,
        beliefs: NDArray[np.floating],
        power: float,
        pseudo_observations: float,
        share: NDArray[np.floating] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the expected error now (n,), and after a view at every rotation (n, B), degrees.

        Between rotations that are whole steps (`compared_step`) it is linear.

        Parameters
        ----------
        beliefs : ndarray (n, B)
            Of objects at hand that were turned alike, in the frames of their first views.
        power, pseudo_observations : float
            See `nbv.recommendation.criteria.expected_error.expected_error`.
        share : ndarray (S,), optional
            How much each turn counts; 1 without it.
        """
        counts = self._counts(pseudo_observations, share)
        weight = self._affinities(beliefs, power)
        sums = _weighted(weight, counts.of_view, self._errors) + counts.prior
        errors = sums[:, :-1] / sums[:, -1:]
        return errors[:, -1], _between_steps(errors[:, :-1], self._step)

    def expected(
        self,
        belief: NDArray[np.floating],
        power: float,
        pseudo_observations: float,
        share: NDArray[np.floating] | None = None,
    ) -> Expected:
        """Return what one belief (B,) leads one to expect; other parameters as above."""
        counts = self._counts(pseudo_observations, share)
        weight = self._affinities(belief[None], power)
        by_part = counts.of_parts @ _of_one(weight, self._errors)
        sums = by_part[-1] + counts.prior
        errors = sums / sums[-1]
        (after_deg,) = _between_steps(errors[None, :-2], self._step)
        now_deg, all_weight = float(errors[-2]), float(sums[-1])
        return Expected(now_deg, after_deg, by_part[:-1, :-2], sums[:-2], all_weight)

    @cached_property
    def _known_counts(self) -> dict[tuple[float, bytes | None], _Counts]:
        return {}

    def _counts(self, pseudo_observations: float, share: NDArray[np.floating] | None) -> _Counts:
        """Return what counts how much; kept, because it is the same for most frames."""
        of_turn = None if share is None else np.asarray(share, dtype=np.float64)
        key = pseudo_observations, None if of_turn is None else of_turn.tobytes()
        known = self._known_counts
        if key in known:
            return known[key]
        if len(known) >= _N_COUNTS:
            known.clear()
        n_turns, n_first = self.first.shape
        if of_turn is None:
            of_turn = np.ones(n_turns)
        prior = pseudo_observations / (of_turn.sum() * n_first)
        # A first view stands for the degrees that it is apart from the next one.
        of_view = of_turn * (360.0 / n_first)
        of_parts = (self._is_in_part * of_view).astype(np.float32)
        known[key] = _Counts(of_view, of_parts, prior * (of_turn @ self._errors_by_turn))
        return known[key]

    def _affinities(self, beliefs: NDArray[np.floating], power: float) -> Table:
        """Return the affinity of each belief (n, B) with each first view, to a power, (S, K, n)."""
        compared = _joined(np.asarray(beliefs, dtype=np.float32), self._step)
        weight: Table = self._roots @ np.sqrt(compared).T
        weight **= power
        return weight

    @cached_property
    def _is_in_part(self) -> NDArray[np.float64]:
        """Whether each turn is in each part of the objects, and in all of them, (N + 1, S)."""
        n_turns = len(self.views)
        named = np.arange(n_turns) if self.object_ids is None else np.asarray(self.object_ids)
        names, number = np.unique(named, return_inverse=True)
        n_parts = min(N_PARTS, len(names))
        is_in_part = number % n_parts == np.arange(n_parts)[:, None]
        return np.vstack([is_in_part, np.ones(n_turns)])

    @property
    def seen(self) -> Table:
        """The distributions in the frames of these views, (S, K, B)."""
        return _started_at(self.so_far, -self.first % self.so_far.shape[-1])

    @cached_property
    def _roots(self) -> Table:
        """The square roots of `seen`, for `nbv.recommendation.criteria.expected_error.affinity`."""
        return np.sqrt(_joined(self.seen, self._step))

    @cached_property
    def _errors(self) -> Table:
        """`errors_deg`, and 1: (S, K, m + 2). The weighted sum of the last is the total weight."""
        return np.concatenate([self.errors_deg, np.ones_like(self.errors_deg[:, :, :1])], axis=2)

    @cached_property
    def _errors_by_turn(self) -> NDArray[np.float64]:
        return np.asarray(self._errors.sum(axis=1, dtype=np.float64))


def _started_at(rows: Table, places: NDArray[np.intp]) -> Table:
    """Return rows (..., B) that go round, each started at its place (...), 0 to B - 1."""
    whole = np.concatenate([rows, rows], axis=-1)
    windows = np.lib.stride_tricks.sliding_window_view(whole, rows.shape[-1], axis=-1)
    # Whole rows are copied; single indices for all numbers take five times as long.
    return np.asarray(windows[(*np.ogrid[*(slice(n) for n in places.shape)], places)])


def _joined(rows: Table, step: int) -> Table:
    """Return distributions (..., B) over bins that are as large as `step` of before."""
    # Numpy is slow at sums over short axes.
    return np.asarray(sum(rows[..., place::step] for place in range(step)))


def _between_steps(rows: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    """Return values (n, B) at every bin, of those (n, B / step) at whole steps of a full turn."""
    return np.asarray(rows @ _interpolation(rows.shape[1], step))


@cache
def _interpolation(n_steps: int, step: int) -> NDArray[np.float64]:
    """Return the matrix (n_steps, n_steps * step) of linear interpolation around a full turn."""
    part = np.arange(step) / step
    own, previous = np.eye(n_steps), np.roll(np.eye(n_steps), -1, axis=1)
    # A value counts in its own step, and in the previous one, which ends at it.
    between = own[:, :, None] * (1 - part) + previous[:, :, None] * part
    return between.reshape(n_steps, -1)


def _weighted(
    weight: Table, of_view: NDArray[np.float64], errors_deg: Table
) -> NDArray[np.float64]:
    """Return the sums (n, m) of errors (S, K, m) by weights (S, K, n) and those of a turn (S,)."""
    if weight.shape[2] == 1:
        return np.asarray((of_view @ _of_one(weight, errors_deg))[None])
    of_turns = weight * of_view.astype(np.float32)[:, None, None]
    rows, table = (each.reshape(-1, each.shape[2]) for each in (of_turns, errors_deg))
    return np.asarray(rows.T @ table, dtype=np.float64)


def _of_one(weight: Table, errors_deg: Table) -> Table:
    """Return the sums (S, m) of errors (S, K, m) by the weights (S, K, 1) of one belief.

    Turn by turn: the threads of a matrix library wait for each other where other programs hold the
    cores, and take no part in small products. All at once took 16 ms then.
    """
    return np.asarray(np.matmul(weight.transpose(0, 2, 1), errors_deg)[:, 0])
