"""Walks over the calibration images of an instance: what further views of an object bring.

An image of an instance is a first view, and the other images of the same instance are the views
that can be reached. `nbv.OrientationTable.recommend`, calibrated on other instances, gives pose,
probability and decision after each view.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.choice.rotations import MIN_SEPARATION_DEG
from nbv.core.orientations.criteria import view_angle_deg
from nbv.core.orientations.group import Array, inverse
from nbv.tables.next_camera import MOST_VIEWS, CameraMove, CameraRecommendation, PoseEstimate
from nbv.tables.orientation_table import OrientationTable

Order = Callable[[Sequence[CameraMove], Array, np.random.Generator], int]
"""Takes ranked moves, the angle (n,) of each candidate to the nearest view, and a generator for
chance; returns the index of the next view among the candidates."""

ORDERS: dict[str, Order] = {
    "random": lambda moves, apart, rng: int(rng.choice(len(apart))),
    "opposite": lambda moves, apart, rng: int(apart.argmax()),
    "recommended": lambda moves, apart, rng: moves[0].index,
}
"""The next view at random, the farthest from all so far, and the product's."""

ENDED = "verdict != 'one more view'"
"""Query of the rows of walks at which the decision ends them."""

_ELSEWHERE = 50
"""Even candidates about the object, where an instance has no image left: for the pose alone."""


def walks(
    known: OrientationTable,
    images: OrientationTable,
    rng: np.random.Generator,
    orders: Mapping[str, Order] = ORDERS,
    firsts: Iterable[int] | None = None,
    most_views: int = MOST_VIEWS,
) -> Iterator[dict[str, Any]]:
    """Yield a row for each first view, order and number of views of an instance.

    Parameters
    ----------
    known : OrientationTable
        Calibration: pairs of other instances.
    images : OrientationTable
        The images of the instance, which stands still.
    rng : Generator
        For orders by chance.
    orders : mapping
    firsts : iterable of int, optional
        The first views; all images by default.
    most_views : int
    """
    object_id, truth, score = images.object_ids[0], images.truth, images.score
    if score is not None and not np.isfinite(score).all():
        score = None
    cameras = np.tile(np.eye(4), (len(truth), 1, 1))
    cameras[:, :3, :3] = truth[0] @ inverse(truth)
    ahead = np.array([0.0, 0.0, 1.0])
    cameras[:, :3, 3] = ahead - cameras[:, :3, :3] @ ahead
    apart = np.stack([view_angle_deg(truth @ pose.T) for pose in truth])
    estimates = [
        PoseEstimate(rotation, 1000 * ahead, None if score is None else score[i], camera)
        for i, (rotation, camera) in enumerate(zip(images.estimate, cameras, strict=True))
    ]
    errors = known.errors(object_id)

    def free(taken: Sequence[int]) -> NDArray[np.intp]:
        return np.flatnonzero(apart[np.array(taken)].min(axis=0) >= MIN_SEPARATION_DEG)

    @cache
    def answer(taken: tuple[int, ...]) -> CameraRecommendation:
        left = free(taken)
        candidates = list(cameras[left]) if len(left) else _ELSEWHERE
        return known.recommend([estimates[i] for i in taken], candidates, object_id=object_id)

    for first in range(len(truth)) if firsts is None else firsts:
        for name, order in orders.items():
            taken: tuple[int, ...] = (first,)
            while True:
                after = answer(taken)
                last = taken[-1]
                error = errors.symmetry.distance_deg(after.rotation, truth[last])
                ratio = 1.0
                if score is not None and errors.ratio is not None:
                    ratio = float(errors.ratio([score[last]])[0])
                yield {
                    "first": first,
                    "order": name,
                    "n_views": len(taken),
                    "error_deg": float(error),
                    "expected_deg": after.expected_error_deg,
                    "probability": after.probability(after.STOP_WITHIN_DEG),
                    "flip_ratio": ratio,
                    "verdict": after.decision.verdict,
                    "depends_on_view": after.depends_on_view,
                }
                left = free(taken)
                if len(taken) == most_views or not len(left):
                    break
                to_nearest = apart[np.array(taken)][:, left].min(axis=0)
                taken = (*taken, int(left[order(after.moves, to_nearest, rng)]))


def stopped(walks: pd.DataFrame, rule: str) -> pd.DataFrame:
    """Return the row of each walk at which it stops: the first that is enough, else the last."""
    walk = ["instance", "first", "order"]
    if "training" in walks:
        walk.append("training")
    # Rows are in the order of views.
    last = walks.groupby(walk, sort=False).tail(1)
    return pd.concat([walks.query(rule), last]).groupby(walk, sort=False).head(1)
