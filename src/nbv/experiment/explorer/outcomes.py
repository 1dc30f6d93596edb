"""What every method made of every first view of a unit, for the page.

The numbers are those of the evaluation files, in hundredths of a degree. What a method's two
estimates let one expect is left out of the page and worked out there; the difference to the
fused pose of the file is kept, and the page adds it, so that it shows the file's pose.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from nbv.errors import UserError
from nbv.experiment.explorer.images import Hundredths, as_text, byte_planes, half_turn, hundredths
from nbv.experiment.results import Unit
from nbv.experiment.statistics.metrics import HALF_TURN_DEG


@dataclass(frozen=True)
class Outcomes:
    """One unit's outcomes, objects in the order of the folds that test them.

    Attributes
    ----------
    object_ids : tuple of str
    folds : tuple of int
        The fold that tests each object.
    n_views : int
        First views of each object, evenly spaced.
    estimate : ndarray (n_objects, n_views) int64
        From the first view alone, hundredths of a degree.
    turn : dict of str to ndarray (n_objects, n_views) int64
        By method: the rotation to the second view, in steps of 360° / n_views. Methods that take
        no second view have none.
    pose : dict of str to ndarray (n_objects, n_views) int64
        By method: the fused pose, hundredths of a degree.
    means : dict of str to list
        By method: the mean error of each object, degrees to two decimals.
    overall : dict of str to dict
        By method, over all first views: the mean error, what errors above 90° add to it (both in
        degrees), and their share in percent.
    """

    object_ids: tuple[str, ...]
    folds: tuple[int, ...]
    n_views: int
    estimate: Hundredths
    turn: dict[str, Hundredths]
    pose: dict[str, Hundredths]
    means: dict[str, list[float]]
    overall: dict[str, dict[str, float]]


def outcomes_of(unit: Unit, frame: pd.DataFrame) -> Outcomes:
    """Return the outcomes of a frame of `nbv.experiment.results.load_evaluations`.

    Raises
    ------
    UserError
        Where methods disagree about the estimates: of a first view, or of the view that a rotation
        leads to.
    """
    by_method = {str(name): part for name, part in frame.groupby("method", observed=True)}
    first = next(iter(by_method.values())).drop_duplicates("object_id")
    object_ids, folds = tuple(first["object_id"]), tuple(first["fold"].astype(int))
    shape = (len(object_ids), -1)
    estimate_deg = _table(next(iter(by_method.values())), "initial_estimate_deg", shape)
    n_views = estimate_deg.shape[1]
    turn, pose = {}, {}
    means: dict[str, list[float]] = {}
    for method, part in by_method.items():
        own = part.set_index("object_id").loc[list(object_ids)]
        _need_same(unit, method, _table(own, "initial_estimate_deg", shape), estimate_deg)
        pose[method] = hundredths(_table(own, "pose_estimate_deg", shape))
        if own["delta_deg"].notna().all():
            delta_deg = _table(own, "delta_deg", shape)
            turn[method] = np.rint(delta_deg * n_views / 360.0).astype(np.int64)
            seen = np.take_along_axis(
                estimate_deg, (np.arange(n_views) + turn[method]) % n_views, axis=1
            )
            _need_same(unit, method, _table(own, "next_estimate_deg", shape), seen)
        means[method] = _rounded(_table(own, "error_deg", shape).mean(axis=1))
    return Outcomes(
        object_ids,
        folds,
        n_views,
        hundredths(estimate_deg),
        turn,
        pose,
        means,
        {method: _overall(part["error_deg"]) for method, part in by_method.items()},
    )


def expected_pose(estimate: Hundredths, turn: Hundredths | None) -> Hundredths:
    """Return the pose halfway between the first estimate and the second one, turned back (Eq. 7).

    In whole hundredths of a degree, (n_objects, n_views), exactly as the page does it; the first
    estimate where no second view is taken.
    """
    if turn is None:
        return estimate
    n_views = estimate.shape[1]
    second = np.take_along_axis(estimate, (np.arange(n_views) + turn) % n_views, axis=1)
    back = half_turn(second - turn * (36000 // n_views) - estimate)
    return np.asarray((estimate + back // 2) % 36000)


def outcomes_text(outcomes: Outcomes) -> str:
    """Return the outcomes as text: estimates, then for each method rotations and poses.

    An estimate is kept as its difference to the true azimuth, less that of the view before. A
    pose is kept as its difference to `expected_pose`.
    """
    n_views = outcomes.n_views
    off = half_turn(outcomes.estimate - np.arange(n_views) * (36000 // n_views))
    parts = [byte_planes(half_turn(np.diff(off, axis=1, prepend=0)))]
    for method, pose in outcomes.pose.items():
        turn = outcomes.turn.get(method)
        if turn is not None:
            parts.append(byte_planes(turn))
        parts.append(byte_planes(half_turn(pose - expected_pose(outcomes.estimate, turn))))
    return as_text(*parts)


def unit_facts(outcomes: Outcomes) -> dict[str, Any]:
    """Return what the page has to know of a unit's outcomes before it decodes them."""
    return {
        "objects": outcomes.object_ids,
        "folds": outcomes.folds,
        "views": outcomes.n_views,
        "turns": list(outcomes.turn),
        "means": outcomes.means,
        "overall": outcomes.overall,
    }


def _table(frame: pd.DataFrame, column: str, shape: tuple[int, int]) -> np.ndarray:
    return frame[column].to_numpy(dtype=np.float64).reshape(shape)


def _need_same(unit: Unit, method: str, found: np.ndarray, expected: np.ndarray) -> None:
    if not np.array_equal(found, expected):
        raise UserError(
            f"evaluation of {unit[0]} at {unit[1]}°: {method} has other estimates than the other "
            "methods; delete the evaluations and run the same command again"
        )


def _overall(error_deg: pd.Series) -> dict[str, float]:
    above = error_deg > HALF_TURN_DEG
    mean, of_above, share = _rounded(
        [error_deg.mean(), error_deg.where(above, 0.0).mean(), 100.0 * above.mean()]
    )
    return {"mean": mean, "above": of_above, "share": share}


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), 2) for value in values]


def methods_of(frames: Mapping[Unit, pd.DataFrame]) -> tuple[str, ...]:
    """Return the methods of all units, in their order."""
    return tuple(dict.fromkeys(str(m) for one in frames.values() for m in one["method"].unique()))
