"""Two views of an estimator in three dimensions, on images that exist (docs/rotations-protocol.md).

Every image of an instance is a first view, every other one of the same instance a possible second
view. The estimator's errors are those of other instances of the object.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.choice.rotations import MIN_SEPARATION_DEG
from nbv.core.orientations.belief import average, belief, posterior
from nbv.core.orientations.criteria import CRITERIA, NextViews, costs_of, ranking, view_angle_deg
from nbv.core.orientations.errors import OrientationErrors
from nbv.files import read_rows
from nbv.tables.bop import groups_of, read_orientation_table
from nbv.tables.next_camera import PoseEstimate
from nbv.tables.orientation_table import OrientationTable

Array = NDArray[np.float64]

COLUMNS = ("object_id", "scene_id", "instance", "score")


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
        The instance's.
    known : OrientationTable
        Calibration: all other pairs.
    others : OrientationTable
        Those of the object.
    errors : OrientationErrors
        Errors on `others`; scores count by those of other objects, if there are any.
    """

    name: str
    images: OrientationTable
    known: OrientationTable
    others: OrientationTable
    errors: OrientationErrors

    @property
    def scores(self) -> Array:
        """The estimator's scores (n,) on the images."""
        return np.asarray(self.images.score, dtype=np.float64)


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
    objects, scored = settings["objects"], settings["score_objects"]
    chosen = [*objects, *scored] if objects and scored else ()
    table = read_orientation_table(path, None, models_info, chosen, rows=rows)
    keys = list(zip(table.object_id, table.group, strict=True))
    role: dict[tuple[str, str], str] = {}
    if "role" in rows:
        by_instance = zip(rows["object_id"], groups_of(rows), rows["role"], strict=True)
        role = {(object_id, group): value for object_id, group, value in by_instance}
    is_tested = np.array([role.get(key) == "test" for key in keys])
    model = {k: settings[k] for k in ("concentration", "pseudo_observations", "flip_deg")}
    for object_id, group in dict.fromkeys(keys):
        if (objects and object_id not in objects) or role.get((object_id, group)) == "calibration":
            continue
        is_object = table.object_id == object_id
        is_instance = is_object & (table.group == group)
        is_known = ~is_instance & ~is_tested
        known, others = table.where(is_known), table.where(is_known & is_object)
        if not len(others.truth):
            continue
        elsewhere = ~is_object & (np.isin(table.object_id, scored) if scored else True)
        scoring = table.where(elsewhere) if elsewhere.any() else others
        yield HeldOut(
            "_".join([object_id, *group.split("/")]),
            table.where(is_instance),
            known,
            others,
            replace(others.errors(), ratio=scoring.score_ratio(model["flip_deg"]), **model),
        )


FUSIONS = ("average", "posterior", "score")
"""Eq. 7, the posterior, and the posterior with the estimator's scores."""

N_BEST = 5
"""The mean over the best-ranked images is reported too: a robot may not reach the first."""


@dataclass(frozen=True)
class TwoViews:
    """Every pair of views of an instance with n images.

    Attributes
    ----------
    error_deg : dict of str to ndarray (n, n)
        Error of each fusion, [first, second view]; the diagonal is that of one view.
    cost : dict of str to ndarray (n, n)
        Cost of each criterion.
    angle_deg : ndarray (n, n)
        The angle between the views.
    recommended : ndarray (n,) int
        The second view that `nbv recommend` takes, or the first one where none is admissible.
    depends_on_view : bool
        Whether calibration shows that flips depend on the view.
    """

    error_deg: Mapping[str, Array]
    cost: Mapping[str, Array]
    angle_deg: Array
    recommended: NDArray[np.intp]
    depends_on_view: bool


def two_views(case: HeldOut) -> TwoViews:
    """Evaluate every pair of views of an instance."""
    images, errors = case.images, case.errors
    n = len(images.truth)
    fused = {name: np.empty((n, n, 3, 3)) for name in FUSIONS}
    cost = {name: np.empty((n, n)) for name in CRITERIA}
    angle = np.empty((n, n))
    for i in range(n):
        moves = images.truth @ images.truth[i].T
        angle[i] = view_angle_deg(moves)
        first = belief(errors, images.estimate[[i]], np.eye(3)[None])
        ahead = NextViews(first, moves)
        for name in CRITERIA:
            cost[name][i] = costs_of(name, ahead)
        for j in range(n):
            views = [i] if i == j else [i, j]
            given = errors, images.estimate[views], moves[views]
            fused["average"][i, j] = average(*given)
            fused["posterior"][i, j] = posterior(*given)
            fused["score"][i, j] = posterior(*given, case.scores[views])
    distance = errors.symmetry.distance_deg
    error = {name: distance(poses, images.truth[:, None]) for name, poses in fused.items()}
    recommended = np.array([recommended_view(case, i) for i in range(n)])
    return TwoViews(error, cost, angle, recommended, errors.depends_on_view(case.others.group))


def recommended_view(case: HeldOut, first: int) -> int:
    """Return the second view that `nbv recommend` takes after a first one, calibrated on others."""
    images = case.images
    moves = images.truth @ images.truth[first].T
    admissible = np.flatnonzero(view_angle_deg(moves) >= MIN_SEPARATION_DEG)
    if not len(admissible):
        return first
    # Poses are those of cameras that look straight at the object.
    ahead = np.array([0.0, 0.0, 1.0])
    cameras = np.tile(np.eye(4), (len(admissible), 1, 1))
    cameras[:, :3, :3] = np.swapaxes(moves[admissible], 1, 2)
    cameras[:, :3, 3] = ahead - cameras[:, :3, :3] @ ahead
    estimate = PoseEstimate(images.estimate[first], 1000 * ahead, case.scores[first])
    answer = case.known.recommend([estimate], list(cameras), object_id=images.object_ids[0])
    return int(admissible[answer.moves[0].index])


def chosen_views(views: TwoViews, fusion: str) -> dict[str, NDArray[np.intp]]:
    """Return the second views (n, k) that each method takes after each first one.

    Where a method takes several, their mean counts.
    """
    n = len(views.angle_deg)
    first = np.arange(n)[:, None]
    others = np.array([np.delete(np.arange(n), i) for i in range(n)])
    error, angle = views.error_deg[fusion][first, others], views.angle_deg[first, others]
    farthest = others[first, angle.argmax(axis=1)[:, None]]
    chosen = {"single": first, "random": others, "opposite": farthest}
    for name, cost in views.cost.items():
        order = ranking(cost[first, others], angle)
        ranked = np.take_along_axis(others, order, axis=1)
        chosen[name] = ranked[:, :1]
        chosen[f"{name}_five"] = ranked[:, :N_BEST]
    chosen["farthest_if_independent"] = chosen["bayes_error"] if views.depends_on_view else farthest
    chosen["nbv_next"] = views.recommended[:, None]
    chosen["hindsight"] = others[first, error.argmin(axis=1)[:, None]]
    chosen["oracle"] = np.concatenate(
        [_oracle(error, angle, others, views.angle_deg, half) for half in (0, 1)], axis=1
    )
    return chosen


def _oracle(
    error: Array, angle: Array, others: NDArray[np.intp], between: Array, half: int
) -> NDArray[np.intp]:
    """Return views (n, 1) of one half that are nearest to the best ones of the other half."""
    first = np.arange(len(others))[:, None]
    is_judged = np.arange(others.shape[1]) % 2 == half
    best = np.where(is_judged, np.inf, error).argmin(axis=1)[:, None]
    away = np.where(is_judged, between[others[first, best], others], np.inf)
    return np.asarray(others[first, away.argmin(axis=1)[:, None]])


def evaluate(
    path: str | Path, models_info: str | Path | None, settings: Mapping[str, Any]
) -> pd.DataFrame:
    """Return the figures of every instance, fusion and method.

    The table of pairs has `COLUMNS` and those of `nbv.tables.bop.read_orientation_table`. With a
    column ``role`` an instance is for calibration or tested, else both. ``settings`` has
    ``objects``, which are evaluated, and ``score_objects``, which say what a score is worth; and
    those of `OrientationErrors`.
    """
    rows = []
    for case in held_out(path, models_info, settings):
        views = two_views(case)
        for fusion, error_deg in views.error_deg.items():
            for method, chosen in chosen_views(views, fusion).items():
                error = np.take_along_axis(error_deg, chosen, axis=1)
                rows.append(
                    {
                        "object_id": case.images.object_ids[0],
                        "instance": case.name,
                        "n_images": len(error_deg),
                        "depends_on_view": views.depends_on_view,
                        "fusion": fusion,
                        "method": method,
                        "mean_deg": error.mean(),
                        "median_deg": np.median(error),
                        "above_30": (error > 30).mean(),
                        "within_15": (error < 15).mean(),
                    }
                )
    return pd.DataFrame(rows)
