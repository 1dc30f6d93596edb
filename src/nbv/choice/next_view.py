"""Pose and next view from the distributions of one object's views."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.choice.answers import Answer, RankedMove
from nbv.choice.rotations import (
    GUESS,
    MIN_SEPARATION_DEG,
    as_allowed,
    as_limit_deg,
    at_rotations,
    best_rotations,
    bins_deg,
    farthest_of,
    flat_warnings,
    with_first,
)
from nbv.core.alike.compare import MOST_COMPARED, WITHIN_DEG, CalibrationViews
from nbv.core.alike.expected import Expected, expected_errors
from nbv.core.alike.reliability import FEWEST_OBJECTS, observed_error
from nbv.core.circle.angles import circular_distance_deg, is_angle, nearest_bin, wrap_deg
from nbv.core.circle.distributions import (
    direction_and_spread_deg,
    log_bayes_factor,
    product_of_views,
    rotated,
)
from nbv.errors import FrameError, UserError
from nbv.labels import counted

LEAST_BAYES_FACTOR = 0.05
"""Below it views contradict each other: with exact distributions at most 1 in 20 right sets."""

N_KEPT = 6
"""Number of cached sequences of rotations; those of `mug` take 6 MB each."""

_LARGEST_LOG = 700.0
"""Below the log of the largest float, which many agreeing views would exceed."""

AfterRotations = Callable[[tuple[int, ...]], CalibrationViews]
"""Maps rotations from the first view, in bins, to the calibration sweeps after them."""


@dataclass(frozen=True, kw_only=True)
class Move(RankedMove):
    """A rotation of the camera around the object, and the expected error after it.

    Attributes
    ----------
    rotation_deg : float
        From the camera's current position, counter-clockwise seen from above, in (-180, 180].
    travel_deg, expected_error_deg, probability_within, target_camera_pose
        See `nbv.choice.answers.RankedMove`.

    Examples
    --------
    >>> import nbv
    >>> nbv.Move(rotation_deg=-90.0, travel_deg=90.0, expected_error_deg=3.0).travel_deg
    90.0
    """

    rotation_deg: float

    @property
    def name(self) -> str:
        """The move in a list."""
        return f"{self.rotation_deg:+g}°"

    @property
    def instruction(self) -> str:
        """What to do, in a few words."""
        return f"rotate by {self.name}"


@dataclass(frozen=True, kw_only=True)
class Recommendation(Answer[Move]):
    """The estimated pose of an object, and the recommended next view.

    Attributes
    ----------
    azimuth_deg : float
        Azimuth of the camera around the object at the last frame, in [0, 360).
    spread_deg : float
        Circular standard deviation of the belief.
    expected_error_deg : float
        Expected error of `azimuth_deg`: the mean calibration error of objects that looked similar,
        after one view recalibrated: the mean error of calibration views that promised as much.
        It is raised if the last view was recommended, because the same errors chose that view.
    moves : tuple of Move
        First the next view: that of least expected error if it is better than the view farthest
        from all so far by more than its uncertainty, else the farthest. Then other local optima,
        best first. Empty if every candidate is within 15° of an existing view.
    move, alternatives
        The first of `moves`, or None, and the others.
    belief : ndarray (B,)
        p(azimuth of the camera at the last frame); index b is 360 b / B degrees.
    error_after_deg : ndarray (B,)
        Expected error after one more view at the rotation 360 d / B degrees from the last frame;
        inf where the rotation is not admissible. With `allowed_deg`, only the bins nearest to
        allowed rotations are finite.
    ood_score : float
        Out-of-distribution score of the worst frame; 95 % of calibration images have at most 1.
        NaN without frames.
    bayes_factor : float
        Likelihood of one pose for all frames at their rotations, relative to unrelated poses; 1
        for one frame.
    warnings : tuple of str
        Likely mistakes in the frames, and whether no view is better than another; a sentence each.
    n_views : int
        Number of views whose product is the belief.
    probability_within : dict of str to float
        How likely the error of `azimuth_deg` is at most 5, 15 and 30 degrees.
    crops : tuple of ndarray (side, side) uint8
        The network's input for each frame; empty without frames.
    object_position_m : tuple of float, or None
        Approximate position of the object's origin in the last frame's optical frame (x right, y
        down, z forward), metres. None without frames or without a principal point.

    Examples
    --------
    >>> import nbv
    >>> frame = nbv.example_frame(azimuth_deg=250.0)
    >>> answer = nbv.Recommender.load("mug").recommend(frame.depth_m, intrinsics=frame.intrinsics)
    >>> abs(answer.azimuth_deg - 250.0) < 20, answer.moves[0].expected_error_deg < 20
    (True, True)
    """

    azimuth_deg: float
    spread_deg: float
    belief: NDArray[np.float64]
    error_after_deg: NDArray[np.float64]
    bayes_factor: float
    n_views: int
    ood_score: float = math.nan
    crops: tuple[NDArray[np.uint8], ...] = ()
    object_position_m: tuple[float, float, float] | None = None

    STOP_PROBABILITY = 0.95
    STOP_WITHIN_DEG = 15.0

    @property
    def is_ood(self) -> bool:
        """Whether a frame is out of distribution."""
        return self.ood_score > 1.0

    def pose_lines(self, seen: str) -> list[str]:
        """Return the pose of the object, which is called `seen`, in a few lines of text."""
        views = counted(self.n_views, "view")
        return [
            f"azimuth {self.azimuth_deg:.1f}° (camera around {seen}; {views})",
            f"{self.value(self)}, spread {self.spread_deg:.1f}°",
        ]


def after_rotations(
    distributions: NDArray[np.float32], object_ids: Sequence[str], n_kept: int = N_KEPT
) -> AfterRotations:
    """Return a function from rotations to the calibration sweeps (S, B, B) after them.

    Sweep s shows the object ``object_ids[s]``. The function caches sweeps and their errors for
    `n_kept` sequences of rotations.
    """

    @lru_cache(maxsize=n_kept)
    def after(bins: tuple[int, ...]) -> CalibrationViews:
        if not bins:
            return CalibrationViews.of_sweeps(distributions, MOST_COMPARED, object_ids)
        return after(bins[:-1]).after(bins[-1])

    return after


def next_view(
    distributions: NDArray[np.float64],
    rotations_deg: Sequence[float],
    calibrated: AfterRotations,
    affinity: Mapping[str, float],
    share: NDArray[np.floating] | None = None,
    *,
    allowed_deg: ArrayLike | None = None,
    max_travel_deg: float = 180.0,
    followed: bool = True,
) -> Recommendation:
    """Return the estimated pose and the next view.

    Views are fused by product. The next one has the least expected error, which is the mean error
    of calibration objects after the same rotations (`nbv.core.alike`), unless it is not surely
    better than the view farthest from all so far. Choosing the least value makes it too low by the
    optimism of the choice, which is added. If a recommendation chose the last view, the same holds
    for the current expected error. Raise UserError where limits exclude every further view, or the
    maximum travel is invalid.

    `distributions` (n, B) are p(azimuth | image) of each view, above 0, and `rotations_deg` are
    from the first view; `affinity` has ``power`` and ``pseudo_observations``, and `share` (S,) are
    the weights of the calibration sweeps. The limits are those of `nbv.Recommender.recommend`.
    """
    max_travel_deg = as_limit_deg("max_travel_deg", max_travel_deg)
    belief = product_of_views(distributions, rotations_deg)
    n_bins = len(belief)
    width = 360.0 / n_bins
    bins = [round(rotation / width) % n_bins for rotation in rotations_deg[1:]]
    log_factor = log_bayes_factor(distributions, rotations_deg)
    sweeps = calibrated(tuple(bins))
    expected = expected_errors(sweeps, belief, **affinity, share=share, agreement=log_factor)
    last = rotations_deg[-1]
    taken = tuple(rotation - last for rotation in rotations_deg)
    n_steps = expected.n_rotations
    rotation_deg = bins_deg(n_bins) if allowed_deg is None else as_allowed(allowed_deg)
    is_allowed, is_choice = _admissible(rotation_deg, n_steps, taken, max_travel_deg)
    rotation_deg = rotation_deg[is_allowed]
    if not rotation_deg.size and _admissible(bins_deg(n_bins), n_steps, taken)[0].any():
        raise UserError(
            "no admissible rotation; relax `allowed_deg` or `max_travel_deg`: a view is "
            f"{MIN_SEPARATION_DEG:g}° or more from every view so far"
        )
    now_deg, within_now = expected.now_deg, expected.within_now
    if not bins and len(sweeps.is_of_object) >= FEWEST_OBJECTS:
        now_deg, *within_now = observed_error(sweeps, now_deg, **affinity, share=share).tolist()
    if followed and len(distributions) > 1:
        before = expected_errors(
            calibrated(tuple(bins[:-1])),
            product_of_views(distributions[:-1], rotations_deg[:-1]),
            **affinity,
            share=share,
            agreement=log_bayes_factor(distributions[:-1], rotations_deg[:-1]),
        )
        # The errors that chose the last view are also those of its expected error.
        now_deg += _optimism_deg(before, rotations_deg[:-1], n_bins)
    error = expected.after_deg
    if rotation_deg.size:
        error = error + expected.optimism_deg(is_choice)
    # Rotations from the first view become rotations from the last one.
    back = -round(last / width)
    error, within = np.roll(error, back), np.roll(expected.within_after, back, axis=-1)
    if allowed_deg is None:
        cost, error_after_deg = error[is_allowed], np.where(is_allowed, error, np.inf)
    else:
        cost, nearest = at_rotations(error, rotation_deg), nearest_bin(rotation_deg, n_bins)
        error_after_deg = np.full(n_bins, np.inf)
        error_after_deg[nearest] = error[nearest]
    ranked = best_rotations(rotation_deg, cost, width)
    if ranked:
        farthest = farthest_of(rotation_deg, taken)
        if not expected.is_surely_better(ranked[0][0] + last, rotation_deg[farthest] + last):
            ranked = with_first(ranked, (float(rotation_deg[farthest]), float(cost[farthest])))
    taken_deg = np.array([rotation for rotation, _ in ranked])
    chances = np.transpose([at_rotations(each, taken_deg) for each in within])
    moves = [
        Move(
            rotation_deg=rotation,
            travel_deg=abs(rotation),
            expected_error_deg=error_deg,
            probability_within=as_chances(p),
        )
        for (rotation, error_deg), p in zip(ranked, chances, strict=True)
    ]
    warnings = flat_warnings(moves[0].expected_error_deg, cost) if moves else ()
    helps = bool(moves) and GUESS not in warnings and expected.helps(moves[0].rotation_deg + last)
    direction_deg, spread_deg = direction_and_spread_deg(belief)
    bayes_factor = math.exp(min(log_factor, _LARGEST_LOG))
    return Recommendation(
        azimuth_deg=float(wrap_deg(direction_deg + last)),
        spread_deg=spread_deg,
        expected_error_deg=now_deg,
        moves=tuple(moves),
        belief=rotated(belief, -last),
        error_after_deg=error_after_deg,
        bayes_factor=bayes_factor,
        warnings=(*warnings, *_contradictions(bayes_factor, distributions, rotations_deg)),
        n_views=len(distributions),
        probability_within=as_chances(within_now),
        helps=helps,
    )


def as_chances(probabilities: Iterable[float]) -> dict[str, float]:
    """Return probabilities by the errors of `WITHIN_DEG` that they are for."""
    return {f"{limit:g}": float(p) for limit, p in zip(WITHIN_DEG, probabilities, strict=True)}


def _optimism_deg(before: Expected, rotations_deg: Sequence[float], n_bins: int) -> float:
    """Return the optimism of choosing a view after `rotations_deg`, degrees."""
    taken = tuple(rotation - rotations_deg[-1] for rotation in rotations_deg)
    _, is_choice = _admissible(bins_deg(n_bins), before.n_rotations, taken)
    return before.optimism_deg(is_choice) if is_choice.any() else 0.0


def _contradictions(
    bayes_factor: float, distributions: NDArray[np.float64], rotations_deg: Sequence[float]
) -> tuple[str, ...]:
    """Return a sentence where views contradict each other, with the likeliest reason."""
    if bayes_factor >= LEAST_BAYES_FACTOR:
        return ()
    problem = f"the views contradict each other (Bayes factor {bayes_factor:.1g})"
    reversed_deg = [-rotation for rotation in rotations_deg]
    if log_bayes_factor(distributions, reversed_deg) > 0.0:
        return (
            f"{problem}, and agree if rotated the other way: check that frames are not mirrored, "
            "and the sign of the rotations (counter-clockwise seen from above)",
        )
    return (
        f"{problem}: one is likely wrong, and one more view helps; check too that the rotations "
        "are right and that all frames show one object",
    )


def as_rotation_list(
    rotations_deg: float | Sequence[float], n: int, noun: str = "frame"
) -> list[float]:
    """Return the rotations of n views from the first one.

    Raise FrameError ``rotations`` where there are not n numbers, or the first is not 0.
    """
    try:
        given = np.asarray(rotations_deg, dtype=np.float64)
    except (TypeError, ValueError):
        raise FrameError("rotations", f"{rotations_deg!r} are not numbers; give degrees") from None
    rotations: list[float] = given.reshape(-1).tolist()
    if given.ndim > 1 or len(rotations) != n:
        raise FrameError(
            "rotations",
            f"{counted(n, noun)} and {counted(len(rotations), 'rotation')}; give one for each "
            f"{noun}, counted from the first {noun}: 0, …",
        )
    if not is_angle(rotations).all():
        raise FrameError("rotations", "one is not finite, or beyond 1e6; give degrees")
    if rotations[0] != 0:
        raise FrameError(
            "rotations", f"the first is {rotations[0]:g}; give 0, from which all count"
        )
    return rotations


def _admissible(
    rotation_deg: NDArray[np.float64],
    n_steps: int,
    taken: tuple[float, ...],
    max_travel_deg: float = 180.0,
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which rotations (n,) are within the travel and not too close to views `taken` so far.

    Also whether each of `n_steps` evenly spaced rotations from the first view, which is the first
    of `taken`, is nearest to one of them.
    """
    apart = circular_distance_deg(rotation_deg[:, None], taken).min(axis=1)
    is_allowed = (apart >= MIN_SEPARATION_DEG) & (np.abs(rotation_deg) <= max_travel_deg)
    is_choice = np.zeros(n_steps, dtype=bool)
    is_choice[nearest_bin(rotation_deg[is_allowed] - taken[0], n_steps)] = True
    return is_allowed, is_choice
