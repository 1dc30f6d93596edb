"""Expected errors of the next view: a kernel regression on calibration views.

Calibration sweeps are fused after the same rotations as the views at hand. Each first view is
weighted by the affinity of its product with the belief. It is
`nbv.core.circle.criteria.expected_error` with the fusion ``product`` after any number of views.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.core.alike.compare import AGREEMENT_NATS, CalibrationViews
from nbv.core.choose import ANY_VIEW_SHARE, is_surely_less, with_pseudo_observations
from nbv.core.circle.angles import nearest_bin

N_PARTS = 5
"""Parts of the calibration objects for `Expected.optimism_deg`."""

SURE = 2.0
"""Standard errors by which a rotation has to be better than another one to be preferred."""

LIKELY = 1.0
"""Standard errors by which a view has to be better than none: few objects look like a rare belief,
and a view too few costs more degrees than a view too many."""

NEGLIGIBLE = 1e-5
"""Share of the total weight below which a first view does not count after more views."""


@dataclass(frozen=True)
class Expected:
    """Expected errors now and after each rotation, for one belief.

    Attributes
    ----------
    now_deg : float
        The expected error.
    after_deg : ndarray (B,)
        Expected error after a view at each rotation.
    within_now : ndarray (3,)
        Probabilities that the error is at most each of `nbv.core.alike.compare.WITHIN_DEG`.
    within_after : ndarray (3, B)
        The same after a view at each rotation.
    by_object : ndarray (O, M + 2)
        For each calibration object, weighted sums of errors after a view at each of M rotations,
        360 / M degrees apart, of errors now, and the weight.
    total : ndarray (M + 2,)
        Sum over all objects and the pseudo-observations.
    """

    now_deg: float
    after_deg: NDArray[np.float64]
    within_now: NDArray[np.float64]
    within_after: NDArray[np.float64]
    by_object: NDArray[np.float64]
    total: NDArray[np.floating]

    @property
    def n_rotations(self) -> int:
        """Number M of rotations."""
        return len(self.total) - 2

    def optimism_deg(self, is_choice: NDArray[np.bool_]) -> float:
        """Return by how much the least expected error is too low, 0 or more.

        The minimum of uncertain numbers is optimistic. The optimism is estimated by
        cross-validation: each part of the objects errs more at the rotation that the other parts
        choose than at the rotation that all parts choose. The pseudo-observations take part in each
        choice. With one part it is 0.

        `is_choice` (M,) says which rotations from the first view are admissible, one or more.
        """
        n_parts = min(N_PARTS, len(self.by_object))
        if n_parts == 1:
            return 0.0
        errors = self.by_object[:, :-2]
        parts = np.stack([errors[part::n_parts].sum(axis=0) for part in range(n_parts)])
        total = np.where(is_choice, self.total[:-2], np.inf)
        chosen_by_others = (total - parts).argmin(axis=1)
        more = parts[np.arange(n_parts), chosen_by_others] - parts[:, total.argmin()]
        return float(more.sum() / self.total[-1])

    def is_surely_better(self, rotation_deg: float, other_deg: float) -> bool:
        """Return whether a rotation is better than another by `SURE` standard errors over objects.

        Both are from the first view, and the nearest of the M rotations count.
        """
        both_deg = np.array([rotation_deg, other_deg])
        rotation, other = nearest_bin(both_deg, self.n_rotations).tolist()
        return self._is_less(rotation, other, SURE)

    def helps(self, rotation_deg: float) -> bool:
        """Return whether a view is better than none by 1 % and `LIKELY` standard errors."""
        rotation = int(nearest_bin(rotation_deg, self.n_rotations))
        is_worth = self.total[rotation] < ANY_VIEW_SHARE * self.total[-2]
        return bool(is_worth) and self._is_less(rotation, -2, LIKELY)

    def _is_less(self, rotation: int, other: int, factor: float) -> bool:
        gaps = self.by_object[:, rotation] - self.by_object[:, other]
        prior = self.total[rotation] - self.total[other] - gaps.sum()
        return is_surely_less(gaps, factor, self.by_object[:, -1], prior)


def expected_errors(
    views: CalibrationViews,
    belief: NDArray[np.floating],
    power: float,
    pseudo_observations: float,
    share: NDArray[np.floating] | None = None,
    agreement: float = 0.0,
) -> Expected:
    """Return the expected errors for a belief, linear between the M rotations.

    Parameters
    ----------
    views : CalibrationViews
        After the rotations of the views at hand.
    belief : ndarray (B,)
        In the frame of the first view.
    power, pseudo_observations : float
        See `nbv.core.circle.criteria`.
    share : ndarray (S,), optional
        Weights of the sweeps; 1 without it.
    agreement : float
        The log Bayes factor of the views at hand. Where it is below 0, the views contradict each
        other, and sequences that contradict each other as much have the largest weight.
    """
    n_sweeps, n_first = views.first.shape
    # A first view represents the degrees between it and the next.
    of_view = (np.ones(n_sweeps) if share is None else np.asarray(share)) * (360.0 / n_first)
    compared = views.joined(np.asarray(belief, dtype=np.float32))
    weight = (views.roots @ np.sqrt(compared)) ** np.float32(power)
    weight *= of_view.astype(np.float32)[:, None]
    if views.near is None:
        apart = np.minimum(views.agreement, 0.0) - np.float32(min(agreement, 0.0))
        weight *= np.exp(-0.5 * (apart / np.float32(AGREEMENT_NATS)) ** 2)
        weight[weight < NEGLIGIBLE * (weight.sum() + pseudo_observations)] = 0.0
    by_object = views.is_of_object @ (weight[:, None] @ views.outcomes)[:, 0]
    mean = of_view @ views.mean_outcomes / of_view.sum()
    sums = with_pseudo_observations(by_object.sum(axis=0), mean, pseudo_observations)
    n_rotations = views.roots.shape[2]
    means = (sums[:-1] / sums[-1]).reshape(-1, n_rotations + 1)
    rotations = np.arange(n_rotations * views.step) / views.step
    after = np.stack(
        [np.interp(rotations, np.arange(n_rotations + 1), [*m[:-1], m[0]]) for m in means]
    )
    kept = [*range(n_rotations + 1), -1]
    return Expected(
        now_deg=float(means[0, -1]),
        after_deg=after[0],
        within_now=means[1:, -1],
        within_after=after[1:],
        by_object=by_object[:, kept],
        total=sums[kept],
    )
