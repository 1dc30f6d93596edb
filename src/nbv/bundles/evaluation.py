"""Errors of every way to choose further views, on recordings with known azimuths."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import softmax

from nbv.bundles.bundle import Bundle, PaperTables
from nbv.bundles.network import Sweep
from nbv.bundles.ood import ood_score
from nbv.choice.next_view import AfterRotations, after_rotations, next_view
from nbv.choice.rotations import MIN_SEPARATION_DEG, as_limit_deg
from nbv.core.alike.compare import CalibrationViews
from nbv.core.circle.angles import (
    circular_distance_deg,
    signed_difference_deg,
    travel_deg,
    wrap_deg,
)
from nbv.core.circle.distributions import mean_direction_deg, rotated
from nbv.core.circle.logits import from_logits
from nbv.core.circle.offset import constant_offset_deg, frame_warning
from nbv.errors import UserError
from nbv.labels import counted

SINGLE, RANDOM, FIXED = "single", "random", "best fixed"
OPPOSITE, SPACED, RECOMMENDED = "opposite", "evenly spaced", "recommended"
UNTIL = "recommended, until enough"
"""No more views than are needed for an expected error."""
PAPER = "paper's table, averaged"
"""Views by the lookup table, with averaged estimates. All others fuse distributions."""

LARGE_ERROR_DEG = 45.0

_MOST_DRAWS = 100


@dataclass(frozen=True)
class Predictions:
    """A bundle's calibrated distributions (n, B) for one recording, whose azimuths (n,) are true.

    `sweep_weights` (S,) are those of the calibration sweeps for the recording's elevation.
    """

    object_id: str
    sequence: str
    azimuth_deg: NDArray[np.float64]
    distributions: NDArray[np.float64]
    sweep_weights: NDArray[np.float64]


def fixed_errors_deg(views: CalibrationViews, n_views: int) -> NDArray[np.float64]:
    """Return each calibration sweep's mean error (S, B) after n views at equal steps.

    `views` holds single views, all of which serve as first views. The columns are steps in bins. A
    step is infinitely bad where two views are closer than `MIN_SEPARATION_DEG`, which no choice
    allows; even spacing is always allowed.
    """
    n_sweeps, _, n_bins = views.fused.shape
    steps = np.arange(n_bins)
    apart = travel_deg(np.arange(1, n_views)[:, None] * steps * (360.0 / n_bins)).min(axis=0)
    is_allowed = (apart >= MIN_SEPARATION_DEG) | (steps == round(n_bins / n_views))
    errors = np.full((n_sweeps, n_bins), np.inf)
    for step in steps[is_allowed & (steps <= n_bins // 2)]:
        fused = views
        for view in range(1, n_views):
            fused = fused.after(int(view * step) % n_bins)
        # The opposite steps, from the last view, see the same views.
        errors[:, [step, -step]] = fused.error_now_deg.mean(axis=1)[:, None]
    return errors


def best_fixed_deg(errors_deg: NDArray[np.float64], sweep_weights: NDArray[np.float64]) -> float:
    """Return the step of least mean error on calibration sweeps, degrees.

    `errors_deg` (S, B) are those of `fixed_errors_deg`; the sweeps' weights (S,) are above 0.
    """
    return float((sweep_weights @ errors_deg).argmin() * (360.0 / errors_deg.shape[1]))


Chooser = Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.float64]]
"""Maps frames taken so far (n, t) and their rotations (n, t) to the next rotations (n,).

All rotations are from first views."""


def replay(predictions: Predictions, choose: Chooser, n_views: int) -> NDArray[np.float64]:
    """Return the signed pose error after each number of views, from every first frame.

    In degrees, (n, n_views), in [-180, 180). Each next view is the unused frame nearest to the
    chosen rotation.
    """
    azimuth_deg, distributions = predictions.azimuth_deg, predictions.distributions
    n = len(azimuth_deg)
    taken = np.arange(n)[:, None]
    rotations_deg = (azimuth_deg - azimuth_deg[:, None]) % 360.0
    logs = np.log(distributions)
    errors = []
    for view in range(n_views):
        errors.append(signed_difference_deg(mean_direction_deg(softmax(logs, axis=1)), azimuth_deg))
        if view + 1 == n_views:
            break
        chosen = choose(taken, np.take_along_axis(rotations_deg, taken, axis=1))
        following = _nearest_unused(rotations_deg, taken, chosen)
        rotation = rotations_deg[np.arange(n), following]
        logs = logs + np.log(rotated(distributions[following], rotation))
        taken = np.column_stack([taken, following])
    return np.stack(errors, axis=1)


def replay_recommended(
    calibrated: AfterRotations,
    predictions: Predictions,
    affinity: Mapping[str, float],
    n_views: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the errors where `next_view` chooses the views, and what it expected of them.

    Signed errors (n, n_views) as of `replay`, and expected errors (n, n_views - 1), of all numbers
    of views but the last.
    """
    azimuth_deg, distributions = predictions.azimuth_deg, predictions.distributions
    n, n_bins = len(azimuth_deg), distributions.shape[-1]
    expected = np.empty((n, n_views - 1))

    def choose(taken: NDArray[np.intp], rotations_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        chosen = np.empty(n)
        bins = np.rint(rotations_deg * (n_bins / 360.0)) % n_bins
        # Sorted, so that neighbouring sequences share their cached calibration views.
        for row in np.lexsort(bins.T[::-1]):
            answer = next_view(
                distributions[taken[row]],
                rotations_deg[row].tolist(),
                calibrated,
                affinity,
                predictions.sweep_weights,
            )
            expected[row, taken.shape[1] - 1] = answer.expected_error_deg
            # Where no view is admissible, any will do.
            chosen[row] = rotations_deg[row, -1] + (
                answer.move.rotation_deg if answer.move else 180.0
            )
        return chosen

    return replay(predictions, choose, n_views), expected


def at_random(rng: np.random.Generator) -> Chooser:
    """Return a uniformly random choice, `MIN_SEPARATION_DEG` or more from every view so far.

    If `_MOST_DRAWS` draws find no such rotation among many views, the last draw counts.
    """

    def choose(taken: NDArray[np.intp], rotations_deg: NDArray[np.float64]) -> NDArray[np.float64]:
        def draw(n: int) -> NDArray[np.float64]:
            return rng.uniform(MIN_SEPARATION_DEG, 360.0 - MIN_SEPARATION_DEG, n)

        chosen = draw(len(taken))
        for _ in range(_MOST_DRAWS):
            apart = circular_distance_deg(chosen[:, None], rotations_deg).min(axis=1)
            is_near = apart < MIN_SEPARATION_DEG
            if not is_near.any():
                break
            chosen[is_near] = draw(int(is_near.sum()))
        return chosen

    return choose


def baselines(n_views: int, fixed_deg: float, rng: np.random.Generator) -> dict[str, Chooser]:
    """Return the choices of `n_views` views with which the recommended ones are compared.

    `fixed_deg` is the best fixed step.
    """

    def at_steps(step_deg: float) -> Chooser:
        return lambda taken, rotations_deg: np.full(len(taken), taken.shape[1] * step_deg)

    return {
        RANDOM: at_random(rng),
        FIXED: at_steps(fixed_deg),
        OPPOSITE if n_views == 2 else SPACED: at_steps(360.0 / n_views),
    }


def paper_errors(
    predictions: Predictions, tables: PaperTables, elevation_deg: float, n_views: int
) -> NDArray[np.float64]:
    """Return the signed error (n,) of the paper's method from every first frame, degrees.

    The paper takes two views. For more, the table recommends the next rotation from each newest
    estimate, and all estimates are averaged as directions. `elevation_deg` is NaN where it is
    unknown.
    """
    azimuth_deg = predictions.azimuth_deg
    estimates = mean_direction_deg(predictions.distributions)
    first = np.arange(len(estimates))
    rotations_deg = (azimuth_deg - azimuth_deg[:, None]) % 360.0
    advised = tables.recommend(estimates, elevation_deg)
    taken = first[:, None]
    while taken.shape[1] < n_views:
        newest = taken[:, -1]
        chosen = rotations_deg[first, newest] + advised[newest]
        taken = np.column_stack([taken, _nearest_unused(rotations_deg, taken, chosen)])
    poses = np.radians(estimates[taken] - np.take_along_axis(rotations_deg, taken, axis=1))
    pose = np.degrees(np.arctan2(np.sin(poses).sum(axis=1), np.cos(poses).sum(axis=1)))
    return np.asarray(signed_difference_deg(pose, azimuth_deg))


def predict(bundle: Bundle, sweep: Sweep) -> Predictions:
    """Return a bundle's distributions for a sweep, at the bundle's temperature."""
    return Predictions(
        sweep.object_id,
        sweep.sequence,
        sweep.azimuth_deg,
        from_logits(sweep.logits, bundle.temperature),
        bundle.weights_at(sweep.elevation_deg),
    )


def evaluate(
    bundle: Bundle,
    sweeps: Sequence[Sweep],
    n_views: Sequence[int] = (2, 3, 4, 5),
    n_random: int = 10,
    seed: int = 0,
    until_deg: float | None = None,
    report: Callable[[int], None] = lambda n_done: None,
) -> pd.DataFrame:
    """Return the errors of every way to choose views, for each recording.

    With `until_deg`, also those where one stops as soon as the expected error is not above it, or
    after the largest number of views. `report` is called after each recording with the number of
    finished ones. Raise UserError where a number of views is below 2, or above the number of a
    recording's frames, or `until_deg` is below 0.

    Returns
    -------
    DataFrame
        ``object_id, sequence, choice, n_views, mae_deg, median_deg, above_45_percent, offset_deg,
        mae_without_offset_deg, expected_deg, mean_views``. The offset is the circular median of
        all single-view errors of the recording, because a constant error may be the turntable's
        zero. The mean expected error is NaN where the views are not recommended ones; the mean
        number of views is `n_views` unless one stops before.
    """
    numbers = list(dict.fromkeys(n_views))
    if until_deg is not None:
        as_limit_deg("until_deg", until_deg)
    if min(numbers) < 2:
        raise UserError(f"{min(numbers)} views: a choice of views needs 2 or more")
    for sweep in sweeps:
        if len(sweep.azimuth_deg) < max(numbers):
            raise UserError(
                f"object {sweep.object_id!r}, sequence {sweep.sequence!r} has "
                f"{counted(len(sweep.azimuth_deg), 'frame')}, too few for {max(numbers)} views"
            )
    rows, calibrated = [], after_rotations(bundle.distributions, bundle.object_ids)
    single_views = CalibrationViews.of_sweeps(bundle.distributions)
    fixed_errors = {number: fixed_errors_deg(single_views, number) for number in numbers}
    for n_done, sweep in enumerate(sweeps, start=1):
        predictions = predict(bundle, sweep)
        # The first views are the same for every number of views.
        errors, expected = replay_recommended(
            calibrated, predictions, bundle.affinity, max(numbers) + 1
        )
        single = errors[:, 0]
        offset = constant_offset_deg(single)
        rows.append(_row(predictions, SINGLE, 1, single, offset, expected[:, 0]))
        if until_deg is not None:
            is_last = expected <= until_deg
            is_last[:, -1] = True
            stop = np.arange(len(single)), is_last.argmax(axis=1)
            row = _row(predictions, UNTIL, max(numbers), errors[stop], offset, expected[stop])
            rows.append(row | {"mean_views": float(stop[1].mean() + 1)})
        for number in numbers:
            by_table = paper_errors(predictions, bundle.paper, sweep.elevation_deg, number)
            rows.append(_row(predictions, PAPER, number, by_table, offset))
            fixed = best_fixed_deg(fixed_errors[number], predictions.sweep_weights)
            rng = np.random.default_rng(seed)
            for name, choose in baselines(number, fixed, rng).items():
                repeats = n_random if name == RANDOM else 1
                last = [replay(predictions, choose, number)[:, -1] for _ in range(repeats)]
                rows.append(_row(predictions, name, number, np.concatenate(last), offset))
            place = np.s_[:, number - 1]
            row = _row(predictions, RECOMMENDED, number, errors[place], offset, expected[place])
            rows.append(row)
        report(n_done)
    return pd.DataFrame(rows)


def bundle_errors_deg(bundle: Bundle, most: int = 30) -> dict[str, float]:
    """Return the mean errors of up to `most` calibration sweeps, whose objects are not trained on.

    The keys are ``one_view``, ``two_views`` (recommended) and ``opposite``. Frames are 15° apart.
    The sweeps of an object do not recommend its own second view, unless there is only one object.
    """
    names, step = np.asarray(bundle.object_ids), max(1, bundle.n_bins // 24)
    azimuth_deg = wrap_deg(np.arange(0, bundle.n_bins, step) * (360.0 / bundle.n_bins))
    calibrated = after_rotations(bundle.distributions, bundle.object_ids)
    rng, errors = np.random.default_rng(0), []
    opposite = baselines(2, 0.0, rng)[OPPOSITE]
    for i in rng.permutation(len(names))[:most]:
        others = names != names[i]
        weights = bundle.weights_at(None) * (others if others.any() else 1.0)
        rows = bundle.distributions[i, ::step].astype(np.float64)
        views = Predictions(bundle.object_ids[i], "", azimuth_deg, rows, weights)
        best, _ = replay_recommended(calibrated, views, bundle.affinity, 2)
        errors.append(np.abs([*best.T, replay(views, opposite, 2)[:, 1]]).mean(axis=1))
    return dict(zip(("one_view", "two_views", "opposite"), np.mean(errors, axis=0), strict=True))


def count_ood(bundle: Bundle, sweeps: Sequence[Sweep]) -> pd.DataFrame:
    """Return how many single frames look out of distribution, and how many of them are wrong.

    Returns
    -------
    DataFrame
        ``object_id, sequence, n_frames, n_ood, n_wrong, n_wrong_ood, wrong, warning`` for each
        recording. An estimate is wrong if its error is above 45 degrees; ``wrong`` lists the
        ``file`` and ``error_deg`` of these frames, worst first. The warning says why estimates do
        not follow azimuths, or is empty.
    """
    rows = []
    for sweep in sweeps:
        predictions = predict(bundle, sweep)
        estimates = mean_direction_deg(predictions.distributions)
        error_deg = circular_distance_deg(estimates, sweep.azimuth_deg)
        is_wrong = error_deg > LARGE_ERROR_DEG
        worst = sorted(zip(error_deg[is_wrong].tolist(), np.flatnonzero(is_wrong), strict=True))
        is_ood = ood_score(bundle.ood, sweep.codes, sweep.logits) > 1.0
        rows.append(
            {
                "object_id": sweep.object_id,
                "sequence": sweep.sequence,
                "n_frames": len(is_wrong),
                "n_ood": int(is_ood.sum()),
                "n_wrong": int(is_wrong.sum()),
                "n_wrong_ood": int((is_wrong & is_ood).sum()),
                "wrong": [
                    {"file": sweep.files[i] if sweep.files else None, "error_deg": error}
                    for error, i in reversed(worst)
                ],
                "warning": frame_warning(sweep.azimuth_deg, estimates, bundle.mirror_plane_deg),
            }
        )
    return pd.DataFrame(rows)


def _nearest_unused(
    rotations_deg: NDArray[np.float64], taken: NDArray[np.intp], chosen_deg: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Return the frames (n,) nearest to the chosen rotations that are not among those taken."""
    apart = circular_distance_deg(rotations_deg, chosen_deg[:, None])
    np.put_along_axis(apart, taken, np.inf, axis=1)
    return np.asarray(apart.argmin(axis=1))


def _row(
    predictions: Predictions,
    choice: str,
    n_views: int,
    error_deg: NDArray[np.float64],
    offset: float,
    expected_deg: NDArray[np.float64] | float = np.nan,
) -> dict[str, object]:
    size = np.abs(error_deg)
    return {
        "object_id": predictions.object_id,
        "sequence": predictions.sequence,
        "choice": choice,
        "n_views": n_views,
        "mae_deg": float(size.mean()),
        "median_deg": float(np.median(size)),
        "above_45_percent": float(100 * (size > LARGE_ERROR_DEG).mean()),
        "offset_deg": offset,
        "mae_without_offset_deg": float(circular_distance_deg(error_deg, offset).mean()),
        "expected_deg": float(np.mean(expected_deg)),
        "mean_views": float(n_views),
    }
