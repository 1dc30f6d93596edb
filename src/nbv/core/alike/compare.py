"""Views of calibration sweeps, fused after the same rotations as those of the object at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import circular_distance_deg, travel_deg
from nbv.core.circle.distributions import (
    in_object_frame,
    mean_direction_deg,
    product_directions_deg,
)
from nbv.core.circle.evidence import Float32Array as Table

COMPARED_DEG = 6.0
"""Width of the bins in which beliefs are compared and rotations tabulated, at most."""

MOST_COMPARED = 4000
"""First views that a belief is compared with, at most: neighbouring views are similar."""

MOST_AVERAGED = 400
"""First views, at most, whose errors after more views the pseudo-observations stand for."""

WITHIN_DEG = (5.0, 15.0, 30.0)
"""Limits of the error whose probabilities are estimated."""

AGREEMENT_NATS = 1.0
"""Bandwidth of the kernel on negative log Bayes factors."""

_FLAT_ERROR_DEG = 90.0
"""Error of a flat distribution: the mean error of a guess."""


def compared_step(n_bins: int) -> int:
    """Return the comparison stride in bins: the largest divisor of n_bins within COMPARED_DEG."""
    most = max(int(COMPARED_DEG * n_bins / 360.0), 1)
    return next(step for step in range(most, 0, -1) if n_bins % step == 0)


def first_bins(n_sweeps: int, n_bins: int, most: int | None = None) -> NDArray[np.intp]:
    """Return the bins (n_sweeps, K) of the views that serve as first views, evenly spaced.

    Each sweep starts one bin after the previous one, so that together they cover all bins. `most`
    limits all sweeps together, but each has at least one; without it every view serves.
    """
    of_sweep = n_bins if most is None else max(most // n_sweeps, 1)
    apart = next(n for n in range(1, n_bins + 1) if n_bins % n == 0 and n_bins // n <= of_sweep)
    return np.arange(n_sweeps)[:, None] % apart + np.arange(0, n_bins, apart)


@dataclass(frozen=True, eq=False)
class CalibrationViews:
    """Fused views of calibration sweeps after some rotations.

    Attributes
    ----------
    fused : ndarray (S, K, B) float32
        Product of the views so far, in the frames of the first views; rows sum to 1.
    further : ndarray (S, B, B) float32
        Distributions of the sweeps' single views, where bin 0 is the true pose.
    first : ndarray (S, K)
        Bins of the first views; see `first_bins`.
    is_of_object : ndarray (O, S)
        Whether each sweep shows each object.
    agreement : ndarray (S, K)
        Log Bayes factors of the fused views; see `nbv.core.circle.distributions.log_bayes_factor`.
    near : ndarray (S, K, 4 M + 5) float32, or None
        After one view: means of `outcomes` over the first views nearest to each of K.
    cache : dict
        Results of `nbv.core.alike.reliability`.
    """

    fused: Table
    further: Table
    first: NDArray[np.intp]
    is_of_object: NDArray[np.float64]
    agreement: Table
    near: Table | None = None
    cache: dict[str, Any] = field(default_factory=dict, repr=False)

    @staticmethod
    def of_sweeps(
        distributions: Table, most: int | None = None, object_ids: Sequence[str] | None = None
    ) -> CalibrationViews:
        """Return the single views of sweeps (S, B, B) of views a bin apart.

        At most ``most`` first views are compared; see `first_bins`. Sweeps show the objects
        ``object_ids`` (S,); without them, each shows another object.
        """
        sweeps = np.array(distributions, dtype=np.float32)
        n_sweeps, n_bins, _ = sweeps.shape
        names = np.arange(n_sweeps) if object_ids is None else np.asarray(object_ids)
        is_of_object = (names == np.unique(names)[:, None]).astype(np.float64)
        every, first = (first_bins(n_sweeps, n_bins, limit) for limit in (None, most))
        agreement = np.zeros(every.shape, dtype=np.float32)
        further = in_object_frame(sweeps)
        views = CalibrationViews(sweeps, further, every, is_of_object, agreement)
        return replace(
            views,
            fused=np.take_along_axis(sweeps, first[:, :, None], axis=1),
            first=first,
            agreement=agreement[:, : first.shape[1]],
            near=_means_near(views.outcomes, first),
        )

    def after(self, rotation_bins: int) -> CalibrationViews:
        """Return the views fused with one more view, at a rotation from the first one."""
        n_sweeps, n_bins, _ = self.further.shape
        view = (self.first + rotation_bins) % n_bins
        rows = self.further[np.arange(n_sweeps)[:, None], view]
        both = _rolled(rows, -self.first) * self.fused
        total = both.sum(axis=2)
        both /= total[:, :, None]
        return replace(
            self,
            fused=both,
            agreement=self.agreement + np.log(n_bins * total),
            near=None,
            cache={},
        )

    @property
    def step(self) -> int:
        """Bins from one of the M rotations to the next."""
        return compared_step(self.further.shape[1])

    @cached_property
    def error_now_deg(self) -> NDArray[np.float64]:
        """Errors of the fused views, (S, K)."""
        truth_deg = self.first * (360.0 / self.fused.shape[2])
        rows = self.fused.reshape(-1, self.fused.shape[2])
        pose_deg = mean_direction_deg(rows, truth_deg.ravel() + _FLAT_ERROR_DEG)
        return circular_distance_deg(pose_deg.reshape(truth_deg.shape), truth_deg)

    @cached_property
    def outcomes(self) -> Table:
        """What one more view leads to, by the first view, (S, K, 4 M + 5) float32.

        Errors after a view at each of M rotations and now, degrees; whether each of them is within
        each of `WITHIN_DEG`; and 1, whose weighted sum is the total weight.
        """
        if self.near is not None:
            return self.near
        n_sweeps, n_bins, _ = self.further.shape
        errors = np.empty((*self.first.shape, n_bins // self.step + 1), dtype=np.float32)
        errors[:, :, -1] = self.error_now_deg
        in_object = _rolled(self.fused, self.first)
        # Few sweeps at once, which fit the processor's cache.
        at_once = 2**18 // self.further[0].size + 1
        for start in range(0, n_sweeps, at_once):
            part = np.s_[start : start + at_once]
            poses_deg = product_directions_deg(in_object[part], self.further[part], _FLAT_ERROR_DEG)
            after_deg = _rolled(poses_deg, self.first[part])[:, :, :: self.step]
            errors[part, :, :-1] = travel_deg(after_deg)
        within = (errors <= np.float32(limit) for limit in WITHIN_DEG)
        return np.concatenate(
            [errors, *within, np.ones_like(errors[..., :1])], axis=-1, dtype=np.float32
        )

    @cached_property
    def mean_outcomes(self) -> NDArray[np.float64]:
        """Mean outcomes of each sweep over its first views, (S, 4 M + 5).

        After more views, those with one more view are means over `MOST_AVERAGED` first views.
        """
        mean = self.outcomes.mean(axis=1, dtype=np.float64)
        if self.near is None:
            n_sweeps, n_first = self.first.shape
            some = first_bins(n_sweeps, n_first, MOST_AVERAGED)[:, :, None]
            of_some = np.take_along_axis(self.outcomes, some, axis=1).mean(axis=1, dtype=np.float64)
            now = self.roots.shape[2]
            of_some[:, now :: now + 1] = mean[:, now :: now + 1]
            return np.asarray(of_some)
        return np.asarray(mean)

    @cached_property
    def roots(self) -> Table:
        """Square roots of the fused views in the bins of comparisons, (S, K, M)."""
        return np.sqrt(self.joined(self.fused))

    def joined(self, rows: Table) -> Table:
        """Return distributions (..., B) in the wider bins of comparisons, (..., M)."""
        parts = [rows[..., place :: self.step] for place in range(self.step)]
        return np.asarray(np.sum(parts, axis=0))


def _rolled(rows: NDArray[Any], places: NDArray[np.intp]) -> NDArray[Any]:
    """Return rows (S, K, B) that start at places (S, K)."""
    n_sweeps, n_first, n_bins = rows.shape
    twice = np.concatenate([rows, rows], axis=2)
    # Whole rows are copied, several times as fast as single numbers.
    windows = np.lib.stride_tricks.sliding_window_view(twice, n_bins, axis=2)
    return np.asarray(windows[np.arange(n_sweeps)[:, None], np.arange(n_first), places % n_bins])


def _means_near(values: Table, first: NDArray[np.intp]) -> Table:
    """Return the means (S, K, m) of values (S, B, m) over the views nearest to first views (S, K).

    A view half way between two first views counts half for each.
    """
    n_sweeps, n_bins, _ = values.shape
    apart = n_bins // first.shape[1]
    near = np.arange(-(apart // 2), apart // 2 + 1)
    share = np.minimum(1.0, (apart + 1) / 2 - np.abs(near)).astype(np.float32) / np.float32(apart)
    views = (first[:, :, None] + near) % n_bins
    return np.asarray(
        np.einsum("skum,u->skm", values[np.arange(n_sweeps)[:, None, None], views], share)
    )
