"""Two views of an estimator in three dimensions, on images that exist (docs/rotations-protocol.md).

Every image of an instance is a first view, every other one of the same instance a possible second
view. The estimator's errors are those of other instances of the object.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.rotation_errors import RotationErrors, ScoreRatio
from nbv.core.rotation_views import (
    CRITERIA,
    average,
    belief,
    best_move,
    costs_of,
    posterior,
    turn_deg,
)
from nbv.core.rotations import Symmetry, along_ray, check_rotations, viewing_direction

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
    """

    object_id: str
    name: str
    truth: Array
    estimate: Array
    score: Array


def read_instances(path: Path, objects: Sequence[str]) -> list[Instance]:
    """Read the instances of some objects from a table of pairs."""
    table = pd.read_csv(path, dtype={"object_id": str})
    instances = []
    keys = ["object_id", "scene_id", "instance"]
    for key, rows in table[table["object_id"].isin(objects)].groupby(keys):
        ray = along_ray(_numbers(rows["t_true_mm"]))
        poses = [
            ray @ check_rotations(name, _numbers(rows[name]).reshape(-1, 3, 3))
            for name in ("R_true", "R_estimate")
        ]
        score = rows["score"].to_numpy(dtype=np.float64)
        instances.append(Instance(key[0], "_".join(map(str, key)), *poses, score))
    return instances


def _numbers(cells: pd.Series[str]) -> Array:
    return np.array([cell.split() for cell in cells], dtype=np.float64)


def score_ratio(
    instances: Sequence[Instance], symmetries: Mapping[str, Symmetry], without: str, flip_deg: float
) -> ScoreRatio:
    """Fit what a score says about a flip on all objects but one."""
    others = [one for one in instances if one.object_id != without]
    error = [symmetries[o.object_id].distance_deg(o.estimate, o.truth) for o in others]
    scores = np.concatenate([one.score for one in others])
    return ScoreRatio.fit(scores, np.concatenate(error) > flip_deg)


def errors_of(
    instances: Sequence[Instance],
    symmetry: Symmetry,
    ratio: ScoreRatio,
    settings: Mapping[str, Any],
) -> RotationErrors:
    """Return the estimator's errors on some instances of an object."""
    return RotationErrors(
        np.concatenate([one.estimate for one in instances]),
        np.concatenate([one.truth for one in instances]),
        symmetry,
        ratio=ratio,
        **settings,
    )


FUSIONS = ("average", "posterior", "score")
CHOICES = ("random", "opposite", *CRITERIA)


def two_view_errors(
    one: Instance, errors: RotationErrors
) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Return errors and costs of every second view of an instance after every first one.

    Returns
    -------
    dict of str to ndarray (n, n)
        For each fusion the error, [first, second] view, degrees. The diagonal is of one view.
    dict of str to ndarray (n, n)
        For each criterion the cost.
    ndarray (n, n)
        By how much the camera turns, degrees.
    """
    n, own = len(one.truth), errors.symmetry
    error = {name: np.empty((n, n)) for name in FUSIONS}
    cost = {name: np.empty((n, n)) for name in CRITERIA}
    turns = np.empty((n, n))
    for i in range(n):
        moves = one.truth @ one.truth[i].T
        turns[i] = turn_deg(moves)
        first = belief(errors, one.estimate[i : i + 1], np.eye(3)[None])
        for name in CRITERIA:
            cost[name][i] = costs_of(name, first, moves)
        for j in range(n):
            views = [i] if i == j else [i, j]
            given = errors, one.estimate[views], moves[views]
            fused = {
                "average": average(*given),
                "posterior": posterior(*given),
                "score": posterior(*given, one.score[views]),
            }
            for name, pose in fused.items():
                error[name][i, j] = own.distance_deg(pose, one.truth[i])
    return error, cost, turns
