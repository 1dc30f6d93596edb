"""How far each way of choosing further views gets on recordings with known azimuths."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import circular_distance_deg, signed_difference_deg, travel_deg
from nbv.core.distributions import mean_direction_deg, rotated
from nbv.core.logits import from_logits
from nbv.core.look_alikes import LookAlikes, error_after_deg, in_object_frame
from nbv.core.offset import constant_offset_deg, frame_warning
from nbv.errors import UserError
from nbv.labels import counted
from nbv.robot.bundle import Bundle, PaperTables
from nbv.robot.next_view import AfterRotations, after_rotations
from nbv.robot.ood import unfamiliarity
from nbv.robot.recommender import turn_share
from nbv.robot.rotations import MIN_SEPARATION_DEG
from nbv.robot.sweeps import Turn

SINGLE, RANDOM, FIXED = "single", "random", "best fixed"
OPPOSITE, SPACED, RECOMMENDED = "opposite", "evenly spaced", "recommended"
PAPER = "paper's table, averaged"
"""Views by the lookup table, estimates averaged. All others fuse distributions."""

LARGE_ERROR_DEG = 45.0

_MOST_DRAWS = 100


@dataclass(frozen=True)
class Seen:
    """What a bundle makes of one recording.

    Attributes
    ----------
    object_id, sequence : str
    azimuth_deg : ndarray (n,)
        The truth.
    distributions : ndarray (n, B)
    share : ndarray (S,)
        How much each calibration turn counts for it.
    """

    object_id: str
    sequence: str
    azimuth_deg: NDArray[np.float64]
    distributions: NDArray[np.float64]
    share: NDArray[np.float64]


def fixed_errors_deg(alike: LookAlikes, n_views: int) -> NDArray[np.float64]:
    """Return the mean error of each calibration turn with n views at equal steps, (S, B).

    `alike` is of one view, and every view is a first one. By the step, in bins; infinite where two
    of the views are nearer than `MIN_SEPARATION_DEG`, as none are that are chosen. Evenly spaced
    views may always be taken.
    """
    n_turns, _, n_bins = alike.seen.shape
    steps = np.arange(n_bins)
    apart = travel_deg(np.arange(1, n_views)[:, None] * steps * (360.0 / n_bins)).min(axis=0)
    may = (apart >= MIN_SEPARATION_DEG) | (steps == round(n_bins / n_views))
    errors = np.full((n_turns, n_bins), np.inf)
    if n_views == 2:
        group, ahead = np.zeros(n_bins, dtype=int), np.arange(n_bins)
        for turn, views in enumerate(in_object_frame(alike.seen)):
            after = error_after_deg(views, views[None], group, ahead)
            errors[turn, may] = after.mean(axis=0)[may]
        return errors
    for step in steps[may]:
        turned_alike = alike
        for view in range(1, n_views):
            turned_alike = turned_alike.after(int(view * step) % n_bins)
        errors[:, step] = turned_alike.error_now_deg.mean(axis=1)
    return errors


def best_fixed_deg(errors_deg: NDArray[np.float64], share: NDArray[np.float64]) -> float:
    """Return the step, in degrees, that is best on all calibration views.

    Parameters
    ----------
    errors_deg : ndarray (S, B)
        From `fixed_errors_deg`.
    share : ndarray (S,)
        How much each calibration turn counts; above 0.
    """
    return float((share @ errors_deg).argmin() * (360.0 / errors_deg.shape[1]))


Chooser = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""The next rotations from the first views (n,), of beliefs (n, B) and rotations so far (n, t)."""


def replay(seen: Seen, choose: Chooser, n_views: int) -> NDArray[np.float64]:
    """Return the signed error of the pose after each number of views, from every first frame.

    Each next view is the frame nearest to the chosen rotation that was not taken yet.

    Returns
    -------
    ndarray (n, n_views)
        Degrees in [-180, 180).
    """
    n = len(seen.azimuth_deg)
    taken = np.arange(n)[:, None]
    turns = (seen.azimuth_deg - seen.azimuth_deg[:, None]) % 360.0
    logs = np.log(seen.distributions)
    errors = []
    for view in range(n_views):
        beliefs = np.exp(logs - logs.max(axis=1, keepdims=True))
        beliefs /= beliefs.sum(axis=1, keepdims=True)
        errors.append(signed_difference_deg(mean_direction_deg(beliefs), seen.azimuth_deg))
        if view + 1 == n_views:
            break
        chosen = choose(beliefs, np.take_along_axis(turns, taken, axis=1))
        apart = circular_distance_deg(turns, chosen[:, None])
        np.put_along_axis(apart, taken, np.inf, axis=1)
        following = apart.argmin(axis=1)
        rotation = turns[np.arange(n), following]
        logs = logs + np.log(rotated(seen.distributions[following], rotation))
        taken = np.column_stack([taken, following])
    return np.stack(errors, axis=1)


def recommended(calibrated: AfterRotations, seen: Seen, affinity: Mapping[str, float]) -> Chooser:
    """Return the choice of least expected error, given the look-alikes after the same rotations."""
    n_bins = seen.distributions.shape[-1]
    here = np.arange(n_bins) * (360.0 / n_bins)

    def choose(beliefs: NDArray[np.float64], rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        bins = np.rint(rotations * (n_bins / 360.0)).astype(int) % n_bins
        different, of_row = np.unique(bins, axis=0, return_inverse=True)
        error = np.empty(beliefs.shape)
        # In their order, what the rotations of two neighbours have in common is found once.
        for place, so_far in enumerate(different.tolist()):
            alike = calibrated(tuple(so_far[1:]))
            for row in np.flatnonzero(of_row.ravel() == place):
                expected = alike.expected(beliefs[row], **affinity, share=seen.share)
                error[row] = expected.after_deg
        near = circular_distance_deg(here[:, None], rotations[:, None, :]).min(axis=2)
        return np.asarray(here[np.where(near < MIN_SEPARATION_DEG, np.inf, error).argmin(axis=1)])

    return choose


def at_random(rng: np.random.Generator) -> Chooser:
    """Return a uniformly random choice, `MIN_SEPARATION_DEG` or more from every view so far.

    Where views are so many that `_MOST_DRAWS` draws find no such place, the last one counts.
    """

    def choose(beliefs: NDArray[np.float64], taken: NDArray[np.float64]) -> NDArray[np.float64]:
        def draw(n: int) -> NDArray[np.float64]:
            return rng.uniform(MIN_SEPARATION_DEG, 360.0 - MIN_SEPARATION_DEG, n)

        chosen = draw(len(beliefs))
        for _ in range(_MOST_DRAWS):
            apart = circular_distance_deg(chosen[:, None], taken).min(axis=1)
            is_near = apart < MIN_SEPARATION_DEG
            if not is_near.any():
                break
            chosen[is_near] = draw(int(is_near.sum()))
        return chosen

    return choose


def baselines(n_views: int, fixed_deg: float, rng: np.random.Generator) -> dict[str, Chooser]:
    """Return the ways to choose `n_views` views with which the recommended ones are compared.

    The best fixed step is `fixed_deg`.
    """

    def at_steps(step_deg: float) -> Chooser:
        return lambda beliefs, taken: np.full(len(beliefs), taken.shape[1] * step_deg)

    return {
        RANDOM: at_random(rng),
        FIXED: at_steps(fixed_deg),
        OPPOSITE if n_views == 2 else SPACED: at_steps(360.0 / n_views),
    }


def paper_errors(
    seen: Seen, tables: PaperTables, elevation_deg: float, n_views: int
) -> NDArray[np.float64]:
    """Return the signed error (n,) of the paper's method from every first frame, degrees.

    The paper takes two views. Of more, the table says of every newest estimate where to go from
    there, and all estimates are averaged as directions.

    Parameters
    ----------
    seen : Seen
    tables : PaperTables
    elevation_deg : float
        NaN where it is not known.
    n_views : int
    """
    estimates = mean_direction_deg(seen.distributions)
    first = np.arange(len(estimates))
    turns = (seen.azimuth_deg - seen.azimuth_deg[:, None]) % 360.0
    advised = tables.recommend(estimates, elevation_deg)
    taken = first[:, None]
    while taken.shape[1] < n_views:
        newest = taken[:, -1]
        chosen = turns[first, newest] + advised[newest]
        apart = circular_distance_deg(turns, chosen[:, None])
        np.put_along_axis(apart, taken, np.inf, axis=1)
        taken = np.column_stack([taken, apart.argmin(axis=1)])
    back = np.radians(estimates[taken] - np.take_along_axis(turns, taken, axis=1))
    pose = np.degrees(np.arctan2(np.sin(back).sum(axis=1), np.cos(back).sum(axis=1)))
    return np.asarray(signed_difference_deg(pose, seen.azimuth_deg))


def seen_by(bundle: Bundle, turn: Turn) -> Seen:
    """Return what a bundle makes of a turn: distributions at its temperature."""
    return Seen(
        turn.object_id,
        turn.sequence,
        turn.azimuth_deg,
        from_logits(turn.logits, bundle.temperature),
        turn_share(bundle, turn.elevation_deg),
    )


def evaluate(
    bundle: Bundle,
    turns: Sequence[Turn],
    n_views: Sequence[int] = (2, 3, 4, 5),
    n_random: int = 10,
    seed: int = 0,
    tell: Callable[[int], None] = lambda n_done: None,
) -> pd.DataFrame:
    """Return the errors of every way to choose views, for each recording.

    `tell` is called after each recording, with how many are done.

    Returns
    -------
    DataFrame
        ``object_id, sequence, choice, n_views, mae_deg, median_deg, above_45_percent, offset_deg,
        mae_without_offset_deg``. The offset is the circular median of all single-view errors of
        the recording: what is constant may be the turntable's zero.

    Raises
    ------
    UserError
        Where a number of views is below 2, or above that of a recording's frames.
    """
    numbers = list(dict.fromkeys(n_views))
    if min(numbers) < 2:
        raise UserError(f"{min(numbers)} views: a choice of views needs 2 or more")
    for turn in turns:
        if len(turn.azimuth_deg) < max(numbers):
            raise UserError(
                f"object {turn.object_id!r}, sequence {turn.sequence!r} has "
                f"{counted(len(turn.azimuth_deg), 'frame')}, too few for {max(numbers)} views"
            )
    rows, calibrated = [], after_rotations(bundle.distributions, bundle.object_ids)
    every_view = LookAlikes.of_views(bundle.distributions)
    of_steps = {number: fixed_errors_deg(every_view, number) for number in numbers}
    for n_done, turn in enumerate(turns, start=1):
        seen = seen_by(bundle, turn)
        # However many views there are, the first ones are the same.
        errors = replay(seen, recommended(calibrated, seen, bundle.affinity), max(numbers))
        single = errors[:, 0]
        offset = constant_offset_deg(single)
        rows.append(_row(seen, SINGLE, 1, single, offset))
        for number in numbers:
            of_paper = paper_errors(seen, bundle.paper, turn.elevation_deg, number)
            rows.append(_row(seen, PAPER, number, of_paper, offset))
            fixed = best_fixed_deg(of_steps[number], seen.share)
            rng = np.random.default_rng(seed)
            for name, choose in baselines(number, fixed, rng).items():
                repeats = n_random if name == RANDOM else 1
                last = [replay(seen, choose, number)[:, -1] for _ in range(repeats)]
                rows.append(_row(seen, name, number, np.concatenate(last), offset))
            rows.append(_row(seen, RECOMMENDED, number, errors[:, number - 1], offset))
        tell(n_done)
    return pd.DataFrame(rows)


def familiarity_of(bundle: Bundle, turns: Sequence[Turn]) -> pd.DataFrame:
    """Return how often a bundle calls a single frame unfamiliar, and whether that frame was wrong.

    Returns
    -------
    DataFrame
        ``object_id, sequence, n_frames, n_unfamiliar, n_wrong, n_wrong_unfamiliar, warning`` for
        each recording; wrong is an error above 45 degrees, and the warning says why estimates do
        not follow azimuths, or is empty.
    """
    known, rows = bundle.familiarity, []
    for turn in turns:
        seen = seen_by(bundle, turn)
        estimates = mean_direction_deg(seen.distributions)
        is_wrong = circular_distance_deg(estimates, turn.azimuth_deg) > LARGE_ERROR_DEG
        is_strange = unfamiliarity(known, turn.codes, turn.logits) > 1.0
        rows.append(
            {
                "object_id": turn.object_id,
                "sequence": turn.sequence,
                "n_frames": len(is_wrong),
                "n_unfamiliar": int(is_strange.sum()),
                "n_wrong": int(is_wrong.sum()),
                "n_wrong_unfamiliar": int((is_wrong & is_strange).sum()),
                "warning": frame_warning(turn.azimuth_deg, estimates),
            }
        )
    return pd.DataFrame(rows)


def _row(
    seen: Seen, choice: str, n_views: int, error_deg: NDArray[np.float64], offset: float
) -> dict[str, object]:
    size = np.abs(error_deg)
    return {
        "object_id": seen.object_id,
        "sequence": seen.sequence,
        "choice": choice,
        "n_views": n_views,
        "mae_deg": float(size.mean()),
        "median_deg": float(np.median(size)),
        "above_45_percent": float(100 * (size > LARGE_ERROR_DEG).mean()),
        "offset_deg": offset,
        "mae_without_offset_deg": float(circular_distance_deg(error_deg, offset).mean()),
    }
