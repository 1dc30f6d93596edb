"""What another view led to on calibration objects that looked alike, after any number of views.

Calibration objects are turned as the object at hand was: their distributions are multiplied after
the same rotations. Where the product is then like the belief at hand, the errors that each
further rotation really led to count. It is `expected_error` with the fusion ``product``, without
its restriction to one first view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.distributions import FLAT
from nbv.core.evidence import Float32Array as Table

COMPARED_DEG = 6.0
"""Beliefs are compared, and errors found, at most so many degrees apart, if bins are finer.

Half as much is read for a frame then as in bins of 3 degrees.
"""

MOST_COMPARED = 4000
"""First views at most that a belief is compared with: neighbours are alike.

The tables of all 15,000 views of 125 turns are much larger than the cache of a processor's core.
"""

N_PARTS = 5
"""Of the calibration objects, for `Expected.optimism_deg`."""

MOST_AVERAGED = 400
"""First views at most whose errors after more views are averaged for the pseudo-observations.

One of each turn, where there are more turns.
"""

NEGLIGIBLE = 1e-5
"""Of all that counts, pseudo-observations too: after more views, what counts less is left out."""


def in_object_frame(distributions: Table) -> Table:
    """Return distributions (S, B, B) of views, turned so that index 0 is the true pose.

    View k of B has the azimuth 360 k / B; entry u of the result is the probability of the pose
    360 u / B degrees ahead of the true one.
    """
    return _in_object_frame(_doubled(distributions))


def _in_object_frame(doubled: Table) -> Table:
    every = np.arange(doubled.shape[1])
    return np.ascontiguousarray(_windows(doubled)[:, every, every])


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


def error_after_deg(
    so_far: Table, further: Table, group: NDArray[np.intp], ahead: NDArray[np.intp]
) -> Table:
    """Return the errors of the products with further views, (n, M) float32, degrees.

    With c of the views so far and c' of a further one, both in the frame of the object, the mean
    direction of the product is that of ``sum_u c(u) c'(u) exp(i u)``: a product of matrices for
    all that have their further views in common.

    Parameters
    ----------
    so_far : ndarray (n, B)
        Of the fused views.
    further : ndarray (G, M, B)
        Of M further views all round, in G groups.
    group, ahead : ndarray (n,)
        The group of each one, and which of its further views is the first.

    Returns
    -------
    ndarray
        ``[i, d]``: with the further view ``d`` after the first.
    """
    n, n_bins = so_far.shape
    order = np.argsort(group, kind="stable")
    ordered = group[order]
    starts = np.flatnonzero(np.diff(ordered, prepend=-1))
    rows = (so_far[order, None] * _moment_factors(n_bins)).reshape(3 * n, n_bins)
    moments = np.empty((3 * n, further.shape[1]), dtype=np.float32)
    ends = np.append(starts, n)[1:]
    for start, end, place in np.stack([3 * starts, 3 * ends, ordered[starts]], axis=1).tolist():
        np.matmul(rows[start:end], further[place].T, out=moments[start:end])
    error = np.empty_like(moments[:n])
    error[order] = _angle_deg(*(moments[part::3] for part in range(3)))
    return _started_at(error, ahead)


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


def error_of_deg(distributions: Table, true: NDArray[np.intp]) -> Table:
    """Return the errors of the mean directions of distributions (..., B), degrees.

    Parameters
    ----------
    distributions : ndarray (..., B)
    true : ndarray (...)
        The true pose of each one, in bins.
    """
    factors = _moment_factors(distributions.shape[-1])
    real, imaginary, total = np.moveaxis(distributions @ factors.T, -1, 0)
    cosine, sine, _ = factors[:, true]
    return _angle_deg(real * cosine + imaginary * sine, imaginary * cosine - real * sine, total)


@cache
def _moment_factors(n_bins: int) -> Table:
    """Return what bins (B,) are weighted with for the parts of a moment, and for 1: (3, B)."""
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    return np.stack([np.cos(angles), np.sin(angles), np.ones(n_bins)]).astype(np.float32)


def _angle_deg(real: Table, imaginary: Table, total: Table) -> Table:
    """Return how far the directions of moments are from 0, degrees."""
    angle = np.abs(np.arctan2(imaginary, real)) * np.float32(180.0 / np.pi)
    is_flat = real**2 + imaginary**2 < (np.float32(FLAT) * total) ** 2
    return np.where(is_flat, np.float32(90.0), angle)


@dataclass(frozen=True)
class Expected:
    """What one belief leads one to expect.

    Attributes
    ----------
    now_deg : float
        The expected error.
    after_deg : ndarray (B,)
        The same after a view at every rotation.
    parts : ndarray (N, M)
        Weighted errors after a view at each of M rotations, 360 / M degrees apart, summed over each
        part of the calibration objects.
    total : ndarray (M,)
        The same of all objects and of the pseudo-observations.
    weight : float
        Of all that is in `total`.
    """

    now_deg: float
    after_deg: NDArray[np.float64]
    parts: NDArray[np.float64]
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
class LookAlikes:
    """Calibration turns after some rotations.

    Attributes
    ----------
    seen : ndarray (S, K, B) float32
        Distributions of the fused views, in the frames of the first views; rows sum to 1.
    doubled : ndarray (S, B, 2 B) float32
        Distributions of the single views of each turn, in their own frames, twice in a row. From
        place r on, B numbers are view k in the frame of view k - r.
    further : ndarray (S, step, M, B) float32
        The same `in_object_frame`: ``[s, p, m]`` is view ``m * step + p`` of turn s.
    first : ndarray (S, K)
        The first views that a belief is compared with, in bins; see `first_views`.
    is_in_part : ndarray (N + 1, S)
        Whether each turn is in each part of the objects, and in all of them.
    near_deg : ndarray (S, K, M + 1), or None
        Errors after a view at each of M rotations, and now. Where they are given, they take the
        place of the errors of the first views themselves.
    """

    seen: Table
    doubled: Table
    further: Table
    first: NDArray[np.intp]
    is_in_part: NDArray[np.float64]
    near_deg: Table | None = None

    @staticmethod
    def of_views(
        distributions: Table, most: int | None = None, object_ids: Sequence[str] | None = None
    ) -> LookAlikes:
        """Return the turns after one view, of distributions (S, B, B) of views a bin apart.

        ``most`` of all first views together are compared, as in `first_views`. With each one, the
        errors of all first views near it count (`near_first_views`); after further views, whose
        errors have to be found while a robot waits, its own alone. Turns are of the objects
        ``object_ids`` (S,); without them, each is of another one. One object's turns are in one
        part of `Expected.parts`.
        """
        doubled = _doubled(np.asarray(distributions, dtype=np.float32))
        n_turns, n_bins, _ = doubled.shape
        own = doubled[:, :, :n_bins]
        by_step = _in_object_frame(doubled).reshape(n_turns, -1, compared_step(n_bins), n_bins)
        further = np.ascontiguousarray(by_step.swapaxes(1, 2))
        is_in_part = _is_in_part(np.arange(n_turns) if object_ids is None else object_ids)
        every = first_views(n_turns, n_bins)
        everything = LookAlikes(own, doubled, further, every, is_in_part)
        first = first_views(n_turns, n_bins, most)
        errors_deg = everything.errors_deg
        if first.shape == every.shape:
            return replace(everything, near_deg=errors_deg)
        near_deg = near_first_views(errors_deg, first)
        seen = own[np.arange(n_turns)[:, None], first]
        return LookAlikes(seen, doubled, further, first, is_in_part, near_deg)

    def after(self, rotation_bins: int) -> LookAlikes:
        """Return the turns after one more view, at a rotation from the first one."""
        n_turns, _, n_bins = self.seen.shape
        ahead = rotation_bins % n_bins
        places = np.arange(n_turns)[:, None], (self.first + ahead) % n_bins, ahead
        both: Table = _windows(self.doubled)[places]
        both *= self.seen
        # A product with 1 takes less time than a sum over short rows.
        both /= (both @ np.ones(n_bins, dtype=np.float32))[:, :, None]
        return replace(self, seen=both, near_deg=None)

    @property
    def _step(self) -> int:
        return int(self.further.shape[1])

    @cached_property
    def error_now_deg(self) -> Table:
        """`error_of_deg` of what was seen, by the first view, (S, K); read-only."""
        errors = error_of_deg(self.seen, self.first)
        errors.flags.writeable = False
        return errors

    @property
    def errors_deg(self) -> Table:
        """The errors after a view at each of M rotations, and now: (S, K, M + 1).

        Those that count for the first views; the rotations are whole steps apart.
        """
        if self.near_deg is not None:
            return self.near_deg
        n_turns, n_first = self.first.shape
        every = np.arange(n_first)
        for turn in range(n_turns):
            # Turn by turn: all at once are more than a cache holds.
            self._find(np.full(n_first, turn), every)
        return self._found

    def _find(self, turn: NDArray[np.intp], place: NDArray[np.intp]) -> Table:
        """Find the errors of first views (n,) of turns (n,), and return `_found`."""
        is_new = np.isnan(self._found[turn, place, -1])
        if is_new.any():
            new = turn[is_new], place[is_new]
            first = self.first[new]
            whole, part = np.divmod(first, self._step)
            further = self.further.reshape(-1, *self.further.shape[2:])
            group = new[0] * self._step + part
            after = error_after_deg(_started_at(self.seen[new], first), further, group, whole)
            now = self.error_now_deg[new][:, None]
            self._found[new] = np.concatenate([after, now], axis=1)
        return self._found

    @cached_property
    def _found(self) -> Table:
        """`errors_deg` after more views, as far as they were found; all others are NaN."""
        n_steps = self.further.shape[2]
        return np.full((*self.first.shape, n_steps + 1), np.nan, dtype=np.float32)

    def expected(
        self,
        belief: NDArray[np.floating],
        power: float,
        pseudo_observations: float,
        share: NDArray[np.floating] | None = None,
    ) -> Expected:
        """Return what a belief leads one to expect.

        Between rotations that are whole steps (`compared_step`) it is linear.

        Parameters
        ----------
        belief : ndarray (B,)
            Of an object at hand that was turned alike, in the frame of its first view.
        power, pseudo_observations : float
            See `nbv.core.criteria`.
        share : ndarray (S,), optional
            How much each turn counts; 1 without it.
        """
        n_turns, n_first = self.first.shape
        of_turn = np.ones(n_turns) if share is None else np.asarray(share)
        # A first view stands for the degrees that it is apart from the next one.
        of_view = of_turn * (360.0 / n_first)
        # So that the mean of all counts where no view is like the belief.
        pseudo_observations = max(pseudo_observations, float(np.finfo(np.float32).tiny))
        affinity = self._affinities(belief)
        # Processors take much longer for a weight below the least normal number. It counts nothing.
        affinity[affinity < float(np.finfo(np.float32).tiny) ** (1.0 / max(power, 1.0))] = 0.0
        weight = affinity ** np.float32(power)
        weight *= of_view.astype(np.float32)[:, None]
        by_part = self.is_in_part @ self._weighted_errors(weight, pseudo_observations)
        sums = by_part[-1] + pseudo_observations / of_view.sum() * (of_view @ self._mean_errors)
        errors = sums / sums[-1]
        after_deg = errors[:-2] @ _interpolation(len(errors) - 2, self._step)
        now_deg, all_weight = float(errors[-2]), float(sums[-1])
        return Expected(now_deg, after_deg, by_part[:-1, :-2], sums[:-2], all_weight)

    def _affinities(self, belief: NDArray[np.floating]) -> Table:
        """Return the affinity of a belief (B,) with each first view, (S, K)."""
        compared = _joined(np.asarray(belief, dtype=np.float32), self._step)
        return np.asarray(self._roots @ np.sqrt(compared))

    def _weighted_errors(self, weight: Table, pseudo_observations: float) -> NDArray[np.floating]:
        """Return the sums of `errors_deg` by weights (S, K) and of these, by turn, (S, M + 2)."""
        # Turn by turn: the threads of a matrix library wait for each other where other programs
        # hold the cores, and take no part in small products.
        if self._near_errors is not None:
            return np.asarray(np.matmul(weight[:, None], self._near_errors)[:, 0])
        least = NEGLIGIBLE * (weight.sum() + pseudo_observations)
        is_counted = weight >= least
        # With those that are averaged, because it takes less time to find them together.
        found = self._find(*np.nonzero(is_counted | self._is_averaged))
        turn, place = np.nonzero(is_counted)
        errors = weight[turn, place, None] * _and_one(found[turn, place])
        sums = np.zeros((len(weight), errors.shape[1]))
        starts = np.flatnonzero(np.diff(turn, prepend=-1))
        sums[turn[starts]] = np.add.reduceat(errors, starts)
        return sums

    @cached_property
    def _near_errors(self) -> Table | None:
        return None if self.near_deg is None else _and_one(self.near_deg)

    @cached_property
    def _mean_errors(self) -> NDArray[np.float64]:
        """Of each turn, `errors_deg` on average over its first views, and 1: (S, M + 2).

        After more views of some of them: those of the next turn lie between.
        """
        if self._near_errors is not None:
            return np.asarray(self._near_errors.mean(axis=1, dtype=np.float64))
        averaged = np.nonzero(self._is_averaged)
        found = self._find(*averaged)
        of_turns = found[averaged].reshape(len(found), -1, found.shape[2])
        mean = np.asarray(_and_one(of_turns).mean(axis=1, dtype=np.float64))
        # The errors now are found for all: it takes little.
        mean[:, -2] = self.error_now_deg.mean(axis=1)
        return mean

    @cached_property
    def _is_averaged(self) -> NDArray[np.bool_]:
        """Whether a first view's errors after more views are averaged, (S, K)."""
        n_turns, n_first = self.first.shape
        place = first_views(n_turns, n_first, MOST_AVERAGED)
        is_averaged = np.zeros((n_turns, n_first), dtype=bool)
        np.put_along_axis(is_averaged, place, True, axis=1)
        return is_averaged

    @cached_property
    def _roots(self) -> Table:
        """The square roots of `seen`, for `nbv.core.criteria.affinity`."""
        return np.sqrt(_joined(self.seen, self._step))


def _is_in_part(object_ids: ArrayLike) -> NDArray[np.float64]:
    """Return whether each turn (S,) is in each part of the objects, and in all, (N + 1, S)."""
    names, number = np.unique(np.asarray(object_ids), return_inverse=True)
    n_parts = min(N_PARTS, len(names))
    is_in_part = number % n_parts == np.arange(n_parts)[:, None]
    return np.vstack([is_in_part, np.ones(len(number))])


def _and_one(errors_deg: Table) -> Table:
    """Return errors (..., m), and 1: the weighted sum of the last column is the total weight."""
    return np.concatenate([errors_deg, np.ones_like(errors_deg[..., :1])], axis=-1)


def _started_at(rows: Table, places: NDArray[np.intp]) -> Table:
    """Return rows (..., B) that go round, each started at its place (...), 0 to B - 1."""
    windows = _windows(_doubled(rows))
    # Whole rows are copied; single indices for all numbers take five times as long.
    index = (*np.ogrid[tuple(slice(n) for n in places.shape)], places)
    return np.asarray(windows[index])


def _doubled(rows: Table) -> Table:
    """Return rows (..., B) that go round, twice in a row, (..., 2 B)."""
    return np.concatenate([rows, rows], axis=-1)


def _windows(doubled: Table) -> Table:
    """Return rows (..., 2 B), each started at every place, (..., B + 1, B): a read-only view."""
    n_bins = doubled.shape[-1] // 2
    return np.lib.stride_tricks.sliding_window_view(doubled, n_bins, axis=-1)


def _joined(rows: Table, step: int) -> Table:
    """Return distributions (..., B) over bins that are as large as `step` of before."""
    # Numpy is slow at sums over short axes.
    others = (rows[..., place::step] for place in range(1, step))
    return np.asarray(sum(others, start=rows[..., ::step]))


@cache
def _interpolation(n_steps: int, step: int) -> NDArray[np.float64]:
    """Return the matrix (n_steps, n_steps * step) of linear interpolation around a full turn."""
    part = np.arange(step) / step
    own, previous = np.eye(n_steps), np.roll(np.eye(n_steps), -1, axis=1)
    # A value counts in its own step, and in the previous one, which ends at it.
    between = own[:, :, None] * (1 - part) + previous[:, :, None] * part
    return between.reshape(n_steps, -1)
