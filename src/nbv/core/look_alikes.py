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
from numpy.typing import NDArray

from nbv.core.angles import nearest_bin
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

WITHIN_DEG = (5.0, 15.0, 30.0)
"""Errors of which it is expected how likely the pose's is not larger."""

AGREEMENT_NATS = 1.0
"""Bandwidth of the kernel on log Bayes factors, below 0, by which sequences of views are alike."""

SURE = 2.0
"""Standard errors by which a rotation has to be better than another one to be chosen for it."""

MOST_AVERAGED = 400
"""First views at most whose errors after more views are averaged for the pseudo-observations.

One of each turn, where there are more turns.
"""

FEWEST_OBJECTS = 10
"""From so many on, `LookAlikes.observed` says more than what is expected."""

N_GROUPS = 24
"""Groups of first views by what is expected of them, in `LookAlikes.observed`."""

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


def near_first_views(values: Table, first: NDArray[np.intp]) -> Table:
    """Return the mean values (S, K, m) of all first views near each of some.

    Near are those up to half way to the next of `first`. One that is half way counts half for each
    of the two.

    Parameters
    ----------
    values : ndarray (S, B, m)
        By the first view.
    first : ndarray (S, K)
        In bins, B / K apart.
    """
    n_turns, n_bins, _ = values.shape
    apart = n_bins // first.shape[1]
    near = np.arange(-(apart // 2), apart // 2 + 1)
    share = np.minimum(1.0, (apart + 1) / 2 - np.abs(near)).astype(np.float32) / np.float32(apart)
    places = (first[:, :, None] + near) % n_bins
    rows = values[np.arange(n_turns)[:, None, None], places]
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
    within_now : ndarray (3,)
        How likely the error is at most each of `WITHIN_DEG`.
    within_after : ndarray (3, B)
        The same after a view at every rotation.
    by_object : ndarray (O, M + 1)
        Of each calibration object, weighted errors after a view at each of M rotations, 360 / M
        degrees apart, and the weight.
    total : ndarray (M,)
        The same errors of all objects and of the pseudo-observations.
    weight : float
        Of all that is in `total`.
    """

    now_deg: float
    after_deg: NDArray[np.float64]
    within_now: NDArray[np.float64]
    within_after: NDArray[np.float64]
    by_object: NDArray[np.float64]
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
        n_parts = min(N_PARTS, len(self.by_object))
        if n_parts == 1:
            return 0.0
        errors = self.by_object[:, :-1]
        parts = np.stack([errors[part::n_parts].sum(axis=0) for part in range(n_parts)])
        total = np.where(is_choice, self.total, np.inf)
        of_all = total.argmin()
        of_others = (total - parts).argmin(axis=1).tolist()
        # A few numbers: quicker than more arrays.
        more = sum(own[other] - own[of_all] for own, other in zip(parts, of_others, strict=True))
        return float(more / self.weight)

    def is_surely_better(self, rotation_deg: float, other_deg: float) -> bool:
        """Return whether a rotation is better than another by `SURE` standard errors.

        Both are from the first view, and the nearest of the M rotations count. The standard error
        is that of a ratio of sums over the calibration objects.
        """
        both_deg = np.array([rotation_deg, other_deg])
        rotation, other = nearest_bin(both_deg, len(self.total)).tolist()
        own = self.by_object[:, rotation] - self.by_object[:, other]
        share = self.by_object[:, -1]
        mean = own.sum() / max(share.sum(), np.finfo(float).tiny)
        error = np.sqrt(np.square(own - mean * share).sum())
        return bool(self.total[rotation] - self.total[other] + SURE * error < 0.0)


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
    is_of_object : ndarray (O, S)
        Whether each turn is of each object.
    agreement : ndarray (S, K)
        The log Bayes factors of the fused views; see
        `nbv.core.distributions.log_bayes_factor`.
    near : ndarray (S, K, 4 M + 5), or None
        `_outcomes` of the errors after a view at each of M rotations, and now. Where they are
        given, they take the place of those of the first views themselves.
    """

    seen: Table
    doubled: Table
    further: Table
    first: NDArray[np.intp]
    is_of_object: NDArray[np.float64]
    agreement: Table
    near: Table | None = None

    @staticmethod
    def of_views(
        distributions: Table, most: int | None = None, object_ids: Sequence[str] | None = None
    ) -> LookAlikes:
        """Return the turns after one view, of distributions (S, B, B) of views a bin apart.

        ``most`` of all first views together are compared, as in `first_views`. With each one, the
        errors of all first views near it count (`near_first_views`); after further views, whose
        errors have to be found while a robot waits, its own alone. Turns are of the objects
        ``object_ids`` (S,); without them, each is of another one.
        """
        doubled = _doubled(np.asarray(distributions, dtype=np.float32))
        n_turns, n_bins, _ = doubled.shape
        own = doubled[:, :, :n_bins]
        by_step = _in_object_frame(doubled).reshape(n_turns, -1, compared_step(n_bins), n_bins)
        further = np.ascontiguousarray(by_step.swapaxes(1, 2))
        names = np.arange(n_turns) if object_ids is None else np.asarray(object_ids)
        is_of_object = (names == np.unique(names)[:, None]).astype(np.float64)
        every = first_views(n_turns, n_bins)
        agreement = np.zeros(every.shape, dtype=np.float32)
        everything = LookAlikes(own, doubled, further, every, is_of_object, agreement)
        first = first_views(n_turns, n_bins, most)
        outcomes = _outcomes(everything.errors_deg)
        if first.shape == every.shape:
            return replace(everything, near=outcomes)
        near = near_first_views(outcomes, first)
        seen = own[np.arange(n_turns)[:, None], first]
        agreement = agreement[:, : first.shape[1]]
        return LookAlikes(seen, doubled, further, first, is_of_object, agreement, near)

    def after(self, rotation_bins: int) -> LookAlikes:
        """Return the turns after one more view, at a rotation from the first one."""
        n_turns, _, n_bins = self.seen.shape
        ahead = rotation_bins % n_bins
        places = np.arange(n_turns)[:, None], (self.first + ahead) % n_bins, ahead
        both: Table = _windows(self.doubled)[places]
        both *= self.seen
        # A product with 1 takes less time than a sum over short rows.
        total = both @ np.ones(n_bins, dtype=np.float32)
        both /= total[:, :, None]
        agreement = self.agreement + np.log(n_bins * total)
        return replace(self, seen=both, agreement=agreement, near=None)

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
        if self.near is not None:
            return self.near[..., : self.further.shape[2] + 1]
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
        agreement: float = 0.0,
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
        agreement : float
            The log Bayes factor of the views at hand. Where it is below 0, views contradict each
            other, and sequences that did so as much count.
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
        if self.near is None:
            apart = np.minimum(self.agreement, 0.0) - np.float32(min(agreement, 0.0))
            weight *= np.exp(-0.5 * (apart / np.float32(AGREEMENT_NATS)) ** 2)
        by_object = self.is_of_object @ self._weighted(weight, pseudo_observations)
        of_all = pseudo_observations / of_view.sum() * (of_view @ self._mean_outcomes)
        sums = by_object.sum(axis=0) + of_all
        n_steps = self.further.shape[2]
        means = (sums[:-1] / sums[-1]).reshape(-1, n_steps + 1)
        after = means[:, :-1] @ _interpolation(n_steps, self._step)
        return Expected(
            now_deg=float(means[0, -1]),
            after_deg=after[0],
            within_now=means[1:, -1],
            within_after=after[1:],
            by_object=by_object[:, [*range(n_steps), -1]],
            total=sums[:n_steps],
            weight=float(sums[-1]),
        )

    def observed(
        self,
        expected_deg: float,
        power: float,
        pseudo_observations: float,
        share: NDArray[np.floating] | None = None,
    ) -> NDArray[np.float64]:
        """Return the error and the chances of `WITHIN_DEG` where an error is expected, (4,).

        For turns after one view. A mean over look-alikes is shrunk towards the mean of all: where
        the error is small, too much is expected, and too little where it is large. So what each
        object's first views lead one to expect, by the other objects, is compared with what
        happened: by isotonic regression over `N_GROUPS` groups of first views, linear between their
        means.

        Parameters
        ----------
        expected_deg : float
            ``now_deg`` of an `Expected`.
        power, pseudo_observations, share
            With which it was found.
        """
        of_turn = np.ones(len(self.first)) if share is None else np.asarray(share, np.float64)
        key = power, pseudo_observations, of_turn.tobytes()
        if key not in self._reliability:
            # One alone: a moving camera has another elevation, and share, in each frame.
            self._reliability.clear()
            self._reliability[key] = self._curves(power, pseudo_observations, of_turn)
        expected, *observed = self._reliability[key]
        return np.array([np.interp(expected_deg, expected, curve) for curve in observed])

    @cached_property
    def _reliability(self) -> dict[tuple[float, float, bytes], NDArray[np.float64]]:
        """The `_curves` that were found last."""
        return {}

    def _curves(
        self, power: float, pseudo_observations: float, of_turn: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what is expected of groups of first views, and what happened, (5, n)."""
        from scipy.optimize import isotonic_regression

        n_first = self.first.shape[1]
        errors, happened = self.errors_deg[..., -1], _outcomes(self.error_now_deg.reshape(-1, 1))
        of_view = np.repeat(of_turn * (360.0 / n_first), n_first)
        both = np.stack([of_view * errors.reshape(-1), of_view], axis=1)
        near = self._weights_between(power) @ both.astype(np.float32)
        of_object = self.is_of_object @ both.reshape(len(of_turn), n_first, 2).sum(axis=1)
        others = (of_object.sum(axis=0) - of_object)[self._of_object]
        alpha = max(pseudo_observations, float(np.finfo(np.float32).tiny))
        expected = near[:, 0] + alpha * others[:, 0] / others[:, 1]
        expected /= near[:, 1] + alpha
        order = expected.argsort(kind="stable")
        # Groups of equal weight, by the middle of each view's own.
        middle = of_view[order].cumsum() - of_view[order] / 2
        group = np.minimum(N_GROUPS * middle / of_view.sum(), N_GROUPS - 1).astype(np.intp)
        starts = np.flatnonzero(np.diff(group, prepend=-1))
        rows = np.column_stack([expected, happened[:, :-1], np.ones(len(expected))])
        sums = np.add.reduceat(of_view[order, None] * rows[order], starts, axis=0)
        means = (sums[:, :-1] / sums[:, -1:]).T
        # With a larger error, small ones are rarer.
        observed = (
            isotonic_regression(curve, weights=sums[:, -1], increasing=place == 0).x
            for place, curve in enumerate(means[1:])
        )
        return np.stack([means[0], *observed])

    @cached_property
    def _of_object(self) -> NDArray[np.intp]:
        """The object of each first view, (S K,)."""
        return np.repeat(self.is_of_object.argmax(axis=0), self.first.shape[1])

    @cached_property
    def _between(self) -> dict[float, Table]:
        """Of all first views the weights for each other, 0 within an object, by power."""
        return {}

    def _weights_between(self, power: float) -> Table:
        if power not in self._between:
            roots = self._roots.reshape(len(self._of_object), -1)
            weights = np.empty((len(roots), len(roots)), dtype=np.float32)
            for part in np.array_split(np.arange(len(roots)), N_GROUPS):
                weights[part] = (roots[part] @ roots.T) ** np.float32(power)
                weights[part] *= self._of_object[part, None] != self._of_object
            self._between[power] = weights
        return self._between[power]

    def _affinities(self, belief: NDArray[np.floating]) -> Table:
        """Return the affinity of a belief (B,) with each first view, (S, K)."""
        compared = _joined(np.asarray(belief, dtype=np.float32), self._step)
        return np.asarray(self._roots @ np.sqrt(compared))

    def _weighted(self, weight: Table, pseudo_observations: float) -> NDArray[np.floating]:
        """Return the sums of `_outcomes` by weights (S, K), by turn, (S, 4 M + 5)."""
        # Turn by turn: the threads of a matrix library wait for each other where other programs
        # hold the cores, and take no part in small products.
        if self.near is not None:
            return np.asarray(np.matmul(weight[:, None], self.near)[:, 0])
        least = NEGLIGIBLE * (weight.sum() + pseudo_observations)
        is_counted = weight >= least
        # With those that are averaged, because it takes less time to find them together.
        found = self._find(*np.nonzero(is_counted | self._is_averaged))
        turn, place = np.nonzero(is_counted)
        outcomes = weight[turn, place, None] * _outcomes(found[turn, place])
        sums = np.zeros((len(weight), outcomes.shape[1]))
        starts = np.flatnonzero(np.diff(turn, prepend=-1))
        sums[turn[starts]] = np.add.reduceat(outcomes, starts)
        return sums

    @cached_property
    def _mean_outcomes(self) -> NDArray[np.float64]:
        """Of each turn, `_outcomes` on average over its first views, (S, 4 M + 5).

        After more views of some of them: those of the next turn lie between.
        """
        if self.near is not None:
            return np.asarray(self.near.mean(axis=1, dtype=np.float64))
        averaged = np.nonzero(self._is_averaged)
        found = self._find(*averaged)
        of_turns = found[averaged].reshape(len(found), -1, found.shape[2])
        mean = np.asarray(_outcomes(of_turns).mean(axis=1, dtype=np.float64))
        # The errors now are found for all: it takes little.
        now = _outcomes(self.error_now_deg[..., None]).mean(axis=1)
        mean[:, found.shape[2] - 1 :: found.shape[2]] = now[:, :-1]
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


def _outcomes(errors_deg: Table) -> Table:
    """Return errors (..., m), whether each is within each of `WITHIN_DEG`, and 1: (..., 4 m + 1).

    The weighted sum of the last column is the total weight.
    """
    within = (errors_deg <= np.float32(limit) for limit in WITHIN_DEG)
    one = np.ones_like(errors_deg[..., :1])
    return np.concatenate([errors_deg, *within, one], axis=-1, dtype=np.float32)


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
