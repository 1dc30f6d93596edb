"""From the distributions of one object's views to its pose and the next view."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import (
    circular_distance_deg,
    nearest_bin,
    wrap_deg,
)
from nbv.core.distributions import (
    direction_and_spread_deg,
    log_bayes_factor,
    product_of_views,
    rotated,
)
from nbv.core.look_alikes import MOST_COMPARED, Expected, LookAlikes
from nbv.errors import FrameError, UserError
from nbv.labels import counted
from nbv.robot.rotations import (
    MIN_SEPARATION_DEG,
    are_neighbours,
    as_allowed,
    as_travel,
    at_rotations,
    best_rotations,
    bins_deg,
)

LEAST_BAYES_FACTOR = 0.05
"""Below it views contradict each other. Of right ones, one in 20 at the most is below."""

N_KEPT = 6
"""So many sequences of rotations are remembered; the look-alikes of `mug` take 4 MB for each."""

_LARGEST_LOG = 700.0
"""Below that of the largest number; very many views agree so well."""

AfterRotations = Callable[[tuple[int, ...]], LookAlikes]
"""Calibration turns after rotations from the first view, in bins."""


@dataclass(frozen=True)
class Move:
    """A rotation of the camera about the object, and what is expected of it.

    Attributes
    ----------
    rotation_deg : float
        From where the camera is now, counter-clockwise seen from above, in (-180, 180].
    travel_deg : float
        How far that is, in [0, 180].
    expected_error_deg : float
        Of the pose, once the view from there is added.

    Examples
    --------
    >>> import nbv
    >>> nbv.Move(rotation_deg=-90.0, travel_deg=90.0, expected_error_deg=3.0).travel_deg
    90.0
    """

    rotation_deg: float
    travel_deg: float
    expected_error_deg: float


@dataclass(frozen=True)
class Recommendation:
    """What frames say of an object's pose, and where to look next.

    Attributes
    ----------
    azimuth_deg : float
        Of the camera about the object at the last frame, in [0, 360).
    spread_deg : float
        Circular standard deviation of the belief.
    expected_error_deg : float
        Error of `azimuth_deg`: what objects that looked alike erred in calibration; more where the
        last view was recommended, because the same errors chose it.
    move : Move, or None
        The best next view; None where the views so far are all round, so that each further one
        would be nearer than 15° to one of them.
    alternatives : tuple of Move
        Other views, each the best of its neighbourhood, best first.
    belief : ndarray (B,)
        p(azimuth of the camera at the last frame); index b is 360 b / B degrees.
    error_after_deg : ndarray (B,)
        Expected error after a further view, by its rotation 360 d / B degrees from the last frame;
        inf where the camera may not go. Of allowed rotations, the nearest of these are finite.
    ood_score : float
        How far the least familiar frame is from everything calibrated; above 1 farther than 95 %
        of calibration images. NaN where no frame was seen.
    bayes_factor : float
        How many times as probable the frames are of one pose, at their rotations, as of poses that
        have nothing in common; 1 for one frame.
    warnings : tuple of str
        What may be wrong with the frames, a sentence each.
    n_views : int
        How many views the belief is the product of.
    crops : tuple of ndarray (side, side) uint8
        What the network saw of each frame; none where no frame was seen.
    object_position_m : tuple of float, or None
        About where the object's origin is in the last frame's optical frame (x right, y down, z
        forward), metres. None where the intrinsics have no principal point, or no frame was seen.

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
    expected_error_deg: float
    move: Move | None
    alternatives: tuple[Move, ...]
    belief: NDArray[np.float64]
    error_after_deg: NDArray[np.float64]
    ood_score: float
    bayes_factor: float
    warnings: tuple[str, ...]
    n_views: int
    crops: tuple[NDArray[np.uint8], ...] = ()
    object_position_m: tuple[float, float, float] | None = None

    @property
    def moves(self) -> tuple[Move, ...]:
        """`move` and `alternatives`, best first; empty where there is no further view.

        Examples
        --------
        >>> import nbv
        >>> answer = nbv.Recommender.load("mug").recommend(nbv.example_frame().depth_m)
        >>> answer.moves[0] == answer.move, len(answer.moves) == 1 + len(answer.alternatives)
        (True, True)
        """
        return () if self.move is None else (self.move, *self.alternatives)

    @property
    def is_ood(self) -> bool:
        """Whether a frame is like nothing that was calibrated.

        Examples
        --------
        >>> import nbv
        >>> nbv.Recommender.load("mug").recommend(nbv.example_frame().depth_m).is_ood
        False
        """
        return self.ood_score > 1.0


def after_rotations(
    distributions: NDArray[np.float32], object_ids: Sequence[str], n_kept: int = N_KEPT
) -> AfterRotations:
    """Return what gives the calibration turns after some rotations, of distributions (S, B, B).

    Turn s shows the object ``object_ids[s]``. Turns after rotations, and the errors that were found
    for them, are kept for `n_kept` sequences of rotations.
    """

    @lru_cache(maxsize=n_kept)
    def after(bins: tuple[int, ...]) -> LookAlikes:
        if not bins:
            return LookAlikes.of_views(distributions, MOST_COMPARED, object_ids)
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
    ood_score: float = math.nan,
    warnings: tuple[str, ...] = (),
    crops: tuple[NDArray[np.uint8], ...] = (),
    object_position_m: tuple[float, float, float] | None = None,
) -> Recommendation:
    """Return the pose that views show, and the next view.

    Views are fused by product. The next one has the least error that calibration objects, rotated
    alike, made after it (`nbv.core.look_alikes`). Expected errors after it are raised by
    what the choice makes them too low. So is the expected error now, where the last view was
    recommended.

    Parameters
    ----------
    distributions : ndarray (n, B)
        p(azimuth | image) of each view, above 0.
    rotations_deg : sequence of float
        From the first view to each one; the first is 0.
    calibrated : AfterRotations
        See `after_rotations`.
    affinity : mapping
        ``power`` and ``pseudo_observations``.
    share : ndarray (S,), optional
        How much each calibration turn counts.
    allowed_deg, max_travel_deg, followed
        See `nbv.Recommender.recommend`.
    ood_score, warnings, crops, object_position_m
        What the frames of the views show; see `Recommendation`.

    Raises
    ------
    UserError
        Where there is a further view, but none that is allowed, or the longest travel is none.
    """
    max_travel_deg = as_travel(max_travel_deg)
    belief = product_of_views(distributions, rotations_deg)
    n_bins = len(belief)
    width = 360.0 / n_bins
    bins = [round(turn / width) % n_bins for turn in rotations_deg[1:]]
    expected = calibrated(tuple(bins)).expected(belief, **affinity, share=share)
    last = rotations_deg[-1]
    taken = tuple(rotation - last for rotation in rotations_deg)
    n_steps = len(expected.total)
    if allowed_deg is None:
        may = _allowed_bins(n_bins, n_steps, taken, max_travel_deg)
    else:
        may = _allowed(as_allowed(allowed_deg), width, n_steps, taken, max_travel_deg)
    rotation_deg = may.rotation_deg
    if not rotation_deg.size and _allowed_bins(n_bins, n_steps, taken, 180.0).rotation_deg.size:
        raise UserError(
            "no admissible rotation; relax `allowed_deg` or `max_travel_deg`: a view is "
            f"{MIN_SEPARATION_DEG:g}° or more from every view so far"
        )
    now_deg = expected.now_deg
    if followed and len(distributions) > 1:
        before = calibrated(tuple(bins[:-1])).expected(
            product_of_views(distributions[:-1], rotations_deg[:-1]), **affinity, share=share
        )
        # The errors that chose the last view also make up its expected error.
        now_deg += _optimism_deg(before, rotations_deg[:-1], n_bins)
    error = expected.after_deg
    if rotation_deg.size:
        error = error + expected.optimism_deg(may.is_choice)
    # From the frame of the first view to that of the last one.
    error = np.roll(error, -round(last / width)) if last else error
    if allowed_deg is None:
        cost, error_after_deg = error[may.is_allowed], np.where(may.is_allowed, error, np.inf)
    else:
        cost, places = at_rotations(error, rotation_deg), nearest_bin(rotation_deg, n_bins)
        error_after_deg = np.full(n_bins, np.inf)
        error_after_deg[places] = error[places]
    moves = [
        Move(rotation, abs(rotation), error_deg)
        for rotation, error_deg in best_rotations(may.rotations, cost, may.near)
    ]
    direction_deg, spread_deg = direction_and_spread_deg(belief)
    bayes_factor = math.exp(min(log_bayes_factor(distributions, rotations_deg), _LARGEST_LOG))
    return Recommendation(
        azimuth_deg=float(wrap_deg(direction_deg + last)),
        spread_deg=spread_deg,
        expected_error_deg=now_deg,
        move=moves[0] if moves else None,
        alternatives=tuple(moves[1:]),
        belief=rotated(belief, -last),
        error_after_deg=error_after_deg,
        ood_score=ood_score,
        bayes_factor=bayes_factor,
        warnings=(*warnings, *_contradictions(bayes_factor)),
        n_views=len(distributions),
        crops=crops,
        object_position_m=object_position_m,
    )


def _optimism_deg(before: Expected, rotations_deg: Sequence[float], n_bins: int) -> float:
    """Return by how much the choice of a view after `rotations_deg` makes its error too low."""
    taken = tuple(rotation - rotations_deg[-1] for rotation in rotations_deg)
    is_choice = _allowed_bins(n_bins, len(before.total), taken, 180.0).is_choice
    return before.optimism_deg(is_choice) if is_choice.any() else 0.0


def _contradictions(bayes_factor: float) -> tuple[str, ...]:
    if bayes_factor >= LEAST_BAYES_FACTOR:
        return ()
    return (
        f"the views contradict each other (Bayes factor {bayes_factor:.1g}): check the "
        "rotations and their sign (counter-clockwise seen from above), and that all "
        "are of one object",
    )


def as_rotation_list(
    rotations_deg: float | Sequence[float], n: int, noun: str = "frame"
) -> list[float]:
    """Return the rotations of n views from the first one.

    Raises
    ------
    FrameError
        ``rotations``: where there are not n numbers, or the first is not 0.
    """
    try:
        given = np.asarray(rotations_deg, dtype=np.float64)
    except (TypeError, ValueError):
        raise FrameError("rotations", f"{rotations_deg!r} are no numbers of degrees") from None
    rotations: list[float] = given.reshape(-1).tolist()
    if given.ndim > 1 or len(rotations) != n:
        raise FrameError(
            "rotations",
            f"{counted(n, noun)} and {counted(len(rotations), 'rotation')}; give one for each "
            f"{noun}, from the first {noun}'s place: 0, …",
        )
    if not all(math.isfinite(rotation) for rotation in rotations):
        raise FrameError("rotations", "one is no finite number of degrees")
    if rotations[0] != 0:
        raise FrameError("rotations", f"the first is {rotations[0]:g}; all count from it: 0")
    return rotations


@dataclass(frozen=True)
class _Allowed:
    """Rotations from the last view that the camera may take.

    Attributes
    ----------
    is_allowed : ndarray (n,)
        Of those that were asked for, which may be taken.
    rotation_deg : ndarray (m,)
        These.
    rotations, near : list (m,)
        The same for `best_rotations`.
    is_choice : ndarray (n_steps,)
        Of rotations from the first view that are evenly apart, which are nearest to one of these.
    """

    is_allowed: NDArray[np.bool_]
    rotation_deg: NDArray[np.float64]
    rotations: list[float]
    near: list[bool]
    is_choice: NDArray[np.bool_]


def _allowed(
    rotation_deg: NDArray[np.float64],
    width: float,
    n_steps: int,
    taken: tuple[float, ...],
    max_travel_deg: float,
) -> _Allowed:
    """Return which rotations (n,) are near enough, and not too near to a view that was `taken`.

    The first of `taken` is the first view.
    """
    apart = circular_distance_deg(rotation_deg[:, None], taken).min(axis=1)
    is_allowed = (apart >= MIN_SEPARATION_DEG) & (np.abs(rotation_deg) <= max_travel_deg)
    left = rotation_deg[is_allowed]
    is_choice = np.zeros(n_steps, dtype=bool)
    is_choice[nearest_bin(left - taken[0], n_steps)] = True
    return _Allowed(is_allowed, left, left.tolist(), are_neighbours(left, width), is_choice)


@lru_cache(maxsize=N_KEPT)
def _allowed_bins(
    n_bins: int, n_steps: int, taken: tuple[float, ...], max_travel_deg: float
) -> _Allowed:
    found = _allowed(bins_deg(n_bins), 360.0 / n_bins, n_steps, taken, max_travel_deg)
    for array in (found.is_allowed, found.rotation_deg, found.is_choice):
        array.flags.writeable = False
    return found
