"""Up to four views of an estimator in three dimensions (docs/decisions-protocol.md).

Every image of an instance is a first view, and the other images of the same instance are the views
that can be reached. `nbv.OrientationTable.recommend`, calibrated on other instances, gives pose,
probability and decision after each view, and the next view in the order `recommended`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.choice.rotations import MIN_SEPARATION_DEG
from nbv.core.orientations.criteria import view_angle_deg
from nbv.core.seeds import rng_for
from nbv.data.depth_images import logged
from nbv.files import read_rows
from nbv.tables.bop import groups_of, read_orientation_table
from nbv.tables.next_camera import CameraRecommendation, PoseEstimate
from nbv.tables.orientation_table import OrientationTable

Array = NDArray[np.float64]

COLUMNS = ("object_id", "scene_id", "instance", "score")

MOST_VIEWS = 4

ORDERS = ("random", "opposite", "recommended", "halfway")
"""Orders of views: the next one at random, the farthest from all so far, the product's; and the
nearest of those whose expected error lies at most halfway from the least to the mean."""

ELSEWHERE = 50
"""Even candidates about the object, where an instance has no image left: for the pose alone."""


def pairs_table(
    object_id: str, truth: Array, estimate: Array, columns: Mapping[str, Any]
) -> pd.DataFrame:
    """Return a table for `evaluate` of poses (n, 3, 3) that cameras see straight ahead.

    `columns` are ``instance``, ``score`` and any others.
    """
    matrices = {"R_true": truth, "R_estimate": estimate}
    texts = {
        name: [" ".join(f"{x:.6f}" for x in pose.ravel()) for pose in poses]
        for name, poses in matrices.items()
    }
    return pd.DataFrame({"object_id": object_id, "scene_id": 0, **texts, **columns})


@dataclass(frozen=True)
class HeldOut:
    """An instance, which stands still, and the pairs of others.

    Attributes
    ----------
    name : str
    images : OrientationTable
        The instance's n images.
    known : OrientationTable
        Calibration: other pairs.
    """

    name: str
    images: OrientationTable
    known: OrientationTable

    @property
    def object_id(self) -> str:
        """The object or category."""
        return self.images.object_ids[0]

    @property
    def cameras(self) -> Array:
        """Poses (n, 4, 4) of the cameras, in the frame of the first one, straight at the object."""
        truth = self.images.truth
        ahead = np.array([0.0, 0.0, 1.0])
        cameras = np.tile(np.eye(4), (len(truth), 1, 1))
        cameras[:, :3, :3] = truth[0] @ np.swapaxes(truth, 1, 2)
        cameras[:, :3, 3] = ahead - cameras[:, :3, :3] @ ahead
        return cameras


def held_out(
    path: str | Path, models_info: str | Path | None, settings: Mapping[str, Any]
) -> Iterator[HeldOut]:
    """Yield the instances of a table of pairs that are evaluated; see `evaluate`.

    Raises
    ------
    UserError
        If a column or an object is missing, or a matrix is no rotation.
    """
    rows = read_rows(Path(path), COLUMNS)
    judged = settings["objects"]
    chosen = [*judged, *settings["score_objects"]] if judged and settings["score_objects"] else ()
    table = read_orientation_table(path, None, models_info, chosen, rows=rows)
    keys = list(zip(table.object_id, table.group, strict=True))
    role: dict[tuple[str, str], str] = {}
    if "role" in rows:
        by_instance = zip(rows["object_id"], groups_of(rows), rows["role"], strict=True)
        role = {(object_id, group): value for object_id, group, value in by_instance}
    is_tested = np.array([role.get(key) == "test" for key in keys])
    calibration = table.where(~is_tested)
    for object_id, group in dict.fromkeys(keys):
        if (judged and object_id not in judged) or role.get((object_id, group)) == "calibration":
            continue
        is_instance = (table.object_id == object_id) & (table.group == group)
        known = calibration if role else table.where(~is_instance)
        if object_id in known.object_ids:
            name = "_".join([object_id, *group.split("/")])
            yield HeldOut(name, table.where(is_instance), known)


def walks(case: HeldOut, rng: np.random.Generator) -> Iterator[dict[str, Any]]:
    """Yield a row for each first view, order and number of views of an instance.

    Parameters
    ----------
    case : HeldOut
    rng : Generator
        For the order at random.
    """
    images, cameras = case.images, case.cameras
    n = len(cameras)
    moves = np.swapaxes(cameras[:, :3, :3], 1, 2)
    apart = np.stack([view_angle_deg(moves @ move.T) for move in moves])
    score = np.full(n, np.nan) if images.score is None else np.asarray(images.score)
    ahead_mm = np.array([0.0, 0.0, 1000.0])
    estimates = [
        PoseEstimate(r, ahead_mm, None if np.isnan(s) else float(s), camera)
        for r, s, camera in zip(images.estimate, score, cameras, strict=True)
    ]
    ratio = case.known.errors(case.object_id).ratio

    def free(taken: Sequence[int]) -> NDArray[np.intp]:
        return np.flatnonzero(apart[np.array(taken)].min(axis=0) >= MIN_SEPARATION_DEG)

    @cache
    def answer(taken: tuple[int, ...]) -> CameraRecommendation:
        left = free(taken)
        candidates = list(cameras[left]) if len(left) else ELSEWHERE
        views = [estimates[i] for i in taken]
        return case.known.recommend(views, candidates, object_id=case.object_id)

    def next_of(order: str, taken: tuple[int, ...]) -> int:
        left = free(taken)
        moves = answer(taken).moves
        if order == "recommended":
            return int(left[moves[0].index])
        if order == "halfway":
            cost = np.array([move.expected_error_deg for move in moves])
            # Equal costs may have a mean below each of them.
            limit = max(cost.min(), (cost.min() + cost.mean()) / 2)
            near = [move for move in moves if move.expected_error_deg <= limit]
            return int(left[min(near, key=lambda move: move.travel_deg).index])
        if order == "opposite":
            return int(left[apart[np.array(taken)][:, left].min(axis=0).argmax()])
        return int(rng.choice(left))

    errors = case.known.errors(case.object_id)
    for first in range(n):
        for order in ORDERS:
            taken: tuple[int, ...] = (first,)
            while True:
                after = answer(taken)
                # In the last camera.
                error = errors.symmetry.distance_deg(after.rotation, images.truth[taken[-1]])
                yield {
                    "object_id": case.object_id,
                    "instance": case.name,
                    "first": first,
                    "order": order,
                    "n_views": len(taken),
                    "error_deg": float(error),
                    "expected_deg": after.expected_error_deg,
                    "probability": after.probability(after.STOP_WITHIN_DEG),
                    "flip_ratio": 1.0 if ratio is None else float(ratio([score[taken[-1]]])[0]),
                    "verdict": after.decision.verdict,
                    "depends_on_view": after.depends_on_view,
                }
                if len(taken) == MOST_VIEWS or not len(free(taken)):
                    break
                taken = (*taken, next_of(order, taken))


def evaluate(
    path: str | Path, models_info: str | Path | None, settings: Mapping[str, Any], seed: int
) -> pd.DataFrame:
    """Return the rows of `walks` of every instance.

    The table of pairs has `COLUMNS` and those of `nbv.tables.bop.read_orientation_table`. With a
    column ``role`` an instance is for calibration or tested, else both. ``settings`` has
    ``objects``, which are evaluated, and ``score_objects``, which calibrate too.
    """
    cases = list(held_out(path, models_info, settings))
    return pd.DataFrame(
        [
            row
            for case in logged(cases, len(cases), "instances")
            for row in walks(case, rng_for(seed, "rotations", case.name))
        ]
    )
