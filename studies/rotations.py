"""Two views of an estimator in three dimensions, on images that exist (docs/rotations-protocol.md).

Every image of an instance is a first view, every other one of the same instance a possible second
view. The estimator's errors are those of other instances of the object.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.rotation_belief import average, belief, posterior
from nbv.core.rotation_criteria import CRITERIA, NextViews, costs_of, ranking, view_angle_deg
from nbv.core.rotation_errors import OrientationErrors, ScoreRatio
from nbv.core.rotations import ASYMMETRIC, Symmetry, along_ray, check_orientations
from nbv.errors import UserError
from nbv.files import check_columns, read_csv, read_json

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Instance:
    """The images of one object that stands still.

    Attributes
    ----------
    object_id, name : str
    truth, estimate : ndarray (n, 3, 3)
        Poses as a camera sees them that looks straight at the object.
    score : ndarray (n,)
    role : str
        ``calibration`` or ``test``; empty where an instance is both.
    """

    object_id: str
    name: str
    truth: Array
    estimate: Array
    score: Array
    role: str = ""


COLUMNS = ("scene_id", "instance", "R_true", "t_true_mm", "R_estimate", "score")


def read_symmetries(path: str | Path) -> dict[str, Symmetry]:
    """Read the symmetries of BOP's ``models_info.json``, by object."""
    return {name: Symmetry.from_bop(entry) for name, entry in read_json(path).items()}


def read_instances(path: str | Path, objects: Sequence[str]) -> list[Instance]:
    """Read the instances of some objects, all by default, from a table of pairs.

    The columns are ``object_id`` and `COLUMNS`: rotations row by row in BOP's convention. With a
    column ``role`` an instance is for calibration or tested, else both.

    Raises
    ------
    UserError
        If a column or an object is missing, or a matrix is no rotation.
    """
    table = read_csv(path)
    check_columns(path, table, COLUMNS)
    for name in objects:
        if name not in set(table["object_id"]):
            raise UserError(f"{path}: no object {name}")
    instances = []
    keys = ["object_id", "scene_id", "instance"]
    chosen = table[table["object_id"].isin(objects)] if objects else table
    for key, rows in chosen.groupby(keys, sort=False):
        ray = along_ray(_numbers(rows["t_true_mm"]))
        truth, estimate = (
            ray @ check_orientations(name, _numbers(rows[name]).reshape(-1, 3, 3))
            for name in ("R_true", "R_estimate")
        )
        score = rows["score"].to_numpy(dtype=np.float64)
        name = "_".join(map(str, key))
        role = str(rows["role"].iloc[0]) if "role" in rows else ""
        instances.append(Instance(rows["object_id"].iloc[0], name, truth, estimate, score, role))
    return instances


def _numbers(cells: pd.Series[str]) -> Array:
    return np.array([cell.split() for cell in cells], dtype=np.float64)


def pairs_table(
    object_id: str, truth: Array, estimate: Array, columns: Mapping[str, Any]
) -> pd.DataFrame:
    """Return a table for `read_instances` of poses (n, 3, 3) that cameras see straight ahead.

    `columns` are ``instance``, ``score`` and any others.
    """
    rotations = {"R_true": truth, "R_estimate": estimate}
    texts = {
        name: [" ".join(f"{x:.6f}" for x in pose.ravel()) for pose in poses]
        for name, poses in rotations.items()
    }
    about = {"object_id": object_id, "scene_id": 0, "t_true_mm": "0 0 1000"}
    return pd.DataFrame({**about, **texts, **columns})


def score_ratio(
    instances: Sequence[Instance], symmetries: Mapping[str, Symmetry], flip_deg: float
) -> ScoreRatio:
    """Fit what a score says about a flip on some instances."""
    error = [
        symmetries.get(o.object_id, ASYMMETRIC).distance_deg(o.estimate, o.truth) for o in instances
    ]
    scores = np.concatenate([one.score for one in instances])
    return ScoreRatio.fit(scores, np.concatenate(error) > flip_deg)


def others_of(one: Instance, instances: Sequence[Instance]) -> list[Instance]:
    """Return the other instances of an object that are for calibration."""
    return [
        o for o in instances if o.object_id == one.object_id and o is not one and o.role != "test"
    ]


def calibration(
    others: Sequence[Instance],
    scored: Sequence[Instance],
    symmetries: Mapping[str, Symmetry],
    settings: Mapping[str, Any],
) -> OrientationErrors:
    """Return the errors on some instances of an object, with what a score says on `scored`.

    Of these other objects count, or the instances themselves where there is no other object.
    """
    object_id = others[0].object_id
    elsewhere = [one for one in scored if one.object_id != object_id] or others
    model = {k: settings[k] for k in ("concentration", "pseudo_observations", "flip_deg")}
    return OrientationErrors(
        np.concatenate([one.estimate for one in others]),
        np.concatenate([one.truth for one in others]),
        symmetries.get(object_id, ASYMMETRIC),
        ratio=score_ratio(elsewhere, symmetries, model["flip_deg"]),
        **model,
    )


FUSIONS = ("average", "posterior", "score")
"""Eq. 7, the posterior, and the posterior with the estimator's scores."""

FIVE = 5
"""So many of the best-ranked images are reported too: a robot may not reach the first."""


@dataclass(frozen=True)
class TwoViews:
    """Every pair of views of an instance with n images.

    Attributes
    ----------
    error_deg : dict of str to ndarray (n, n)
        Of each fusion, [first, second view]; the diagonal is of one view.
    cost : dict of str to ndarray (n, n)
        Of each criterion.
    angle_deg : ndarray (n, n)
        The angle between the views.
    depends_on_view : bool
        Whether calibration shows that flips depend on the view.
    """

    error_deg: Mapping[str, Array]
    cost: Mapping[str, Array]
    angle_deg: Array
    depends_on_view: bool


def two_views(one: Instance, errors: OrientationErrors, depends_on_view: bool) -> TwoViews:
    """Evaluate every pair of views of an instance."""
    n = len(one.truth)
    fused = {name: np.empty((n, n, 3, 3)) for name in FUSIONS}
    cost = {name: np.empty((n, n)) for name in CRITERIA}
    angle = np.empty((n, n))
    for i in range(n):
        moves = one.truth @ one.truth[i].T
        angle[i] = view_angle_deg(moves)
        first = belief(errors, one.estimate[[i]], np.eye(3)[None])
        ahead = NextViews(first, moves)
        for name in CRITERIA:
            cost[name][i] = costs_of(name, ahead)
        for j in range(n):
            views = [i] if i == j else [i, j]
            given = errors, one.estimate[views], moves[views]
            fused["average"][i, j] = average(*given)
            fused["posterior"][i, j] = posterior(*given)
            fused["score"][i, j] = posterior(*given, one.score[views])
    distance = errors.symmetry.distance_deg
    error = {name: distance(poses, one.truth[:, None]) for name, poses in fused.items()}
    return TwoViews(error, cost, angle, depends_on_view)


def chosen_views(found: TwoViews, fusion: str) -> dict[str, NDArray[np.intp]]:
    """Return the second views (n, k) that each method takes after each first one.

    Where a method takes several, their mean counts.
    """
    n = len(found.angle_deg)
    first = np.arange(n)[:, None]
    others = np.array([np.delete(np.arange(n), i) for i in range(n)])
    error, angle = found.error_deg[fusion][first, others], found.angle_deg[first, others]
    farthest = others[first, angle.argmax(axis=1)[:, None]]
    chosen = {"single": first, "random": others, "opposite": farthest}
    for name, cost in found.cost.items():
        order = ranking(cost[first, others], angle)
        ranked = np.take_along_axis(others, order, axis=1)
        chosen[name] = ranked[:, :1]
        chosen[f"{name}_five"] = ranked[:, :FIVE]
    chosen["farthest_if_independent"] = chosen["bayes_error"] if found.depends_on_view else farthest
    chosen["hindsight"] = others[first, error.argmin(axis=1)[:, None]]
    chosen["oracle"] = np.concatenate(
        [_oracle(error, angle, others, found.angle_deg, half) for half in (0, 1)], axis=1
    )
    return chosen


def _oracle(
    error: Array, angle: Array, others: NDArray[np.intp], between: Array, half: int
) -> NDArray[np.intp]:
    """Return views (n, 1) of one half that are nearest to the best ones of the other half."""
    first = np.arange(len(others))[:, None]
    own = np.arange(others.shape[1]) % 2 == half
    best = np.where(own, np.inf, error).argmin(axis=1)[:, None]
    away = np.where(own, between[others[first, best], others], np.inf)
    return np.asarray(others[first, away.argmin(axis=1)[:, None]])


def evaluate(
    path: str | Path, symmetries: Mapping[str, Symmetry], settings: Mapping[str, Any]
) -> pd.DataFrame:
    """Return the figures of every instance, fusion and method.

    ``settings`` has ``objects``, which are evaluated, and ``score_objects``, which say what a score
    is worth; and those of `OrientationErrors`.
    """
    instances = read_instances(path, settings["objects"])
    scored = read_instances(path, settings["score_objects"])
    rows = []
    for one in instances:
        others = others_of(one, instances)
        if not others or one.role == "calibration":
            continue
        errors = calibration(others, scored, symmetries, settings)
        groups = np.repeat([o.name for o in others], [len(o.truth) for o in others])
        found = two_views(one, errors, errors.depends_on_view(groups))
        for fusion, error_deg in found.error_deg.items():
            for method, views in chosen_views(found, fusion).items():
                error = np.take_along_axis(error_deg, views, axis=1)
                rows.append(
                    {
                        "object_id": one.object_id,
                        "instance": one.name,
                        "n_images": len(one.truth),
                        "depends_on_view": found.depends_on_view,
                        "fusion": fusion,
                        "method": method,
                        "mean_deg": error.mean(),
                        "median_deg": np.median(error),
                        "above_30": (error > 30).mean(),
                        "within_15": (error < 15).mean(),
                    }
                )
    return pd.DataFrame(rows)
