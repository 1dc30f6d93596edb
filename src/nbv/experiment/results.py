"""Errors of methods with two views, one row for each test image."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.circle.angles import circular_distance_deg
from nbv.core.circle.estimates import Estimates, Posteriors
from nbv.core.circle.evidence import Evidence
from nbv.core.circle.lookup import CostTable
from nbv.core.circle.policies import HeldOutViews, two_views
from nbv.errors import UserError
from nbv.experiment.estimates import check_azimuths, sweep_objects
from nbv.experiment.splits import read_splits
from nbv.files import check_columns, damaged, existing, read_csv, readable

COLUMNS = (
    "object_id",
    "initial_deg",
    "initial_estimate_deg",
    "delta_deg",
    "next_estimate_deg",
    "pose_estimate_deg",
    "error_deg",
)


def evaluate_method(
    method: Mapping[str, Any],
    test: Estimates,
    rng: np.random.Generator | None = None,
    lookup: CostTable | None = None,
    evidence: Evidence | None = None,
    posteriors: Posteriors | None = None,
) -> pd.DataFrame:
    """Evaluate one method, a ``policy`` and a ``fusion``, on every view of every test object.

    Views of `test` are a whole number of degrees apart. The optional inputs are those of
    `nbv.core.circle.policies.HeldOutViews`. Columns are `COLUMNS`; ``delta_deg`` and
    ``next_estimate_deg`` are absent for the policy ``none``.
    """
    distributions = None if posteriors is None else posteriors.distributions
    views = HeldOutViews(test.estimate_deg, evidence, rng, lookup, distributions)
    made = two_views(method["policy"], method["fusion"], views)
    n_objects, n_views = test.estimate_deg.shape
    # Rounded before the error is taken, so that the columns of a row agree with each other.
    pose = np.round(made.pose_deg, 4) % 360.0
    return pd.DataFrame(
        {
            "object_id": np.repeat(np.asarray(test.object_ids, dtype=object), n_views),
            "initial_deg": np.tile(test.azimuth_deg.astype(int), n_objects),
            "initial_estimate_deg": test.estimate_deg.ravel(),
            "delta_deg": pd.array([pd.NA] * (n_objects * n_views), dtype="Int64")
            if made.delta_deg is None
            else made.delta_deg.ravel(),
            "next_estimate_deg": np.nan if made.second_deg is None else made.second_deg.ravel(),
            "pose_estimate_deg": pose.ravel(),
            "error_deg": circular_distance_deg(pose, test.azimuth_deg).ravel(),
        }
    )


Unit = tuple[str, int]
"""A category and an elevation in degrees."""

EvaluationFile = tuple[str, int, int, str]
"""The key of a file of errors: category, elevation in degrees, fold (from 1) and method."""

ESTIMATED_ROLES = ("calibration", "test")
"""The roles of objects that have estimates."""


def load_evaluations(files: Mapping[EvaluationFile, Path]) -> dict[Unit, pd.DataFrame]:
    """Read the errors of methods by unit.

    Raise UserError where a file is missing or damaged, where the methods of a fold were evaluated
    on different objects, or where two folds test the same object.

    Returns
    -------
    dict of (category, elevation_deg) to pandas.DataFrame
        Units in the order of their first file. Columns are ``method, fold`` and
        `COLUMNS`, with one row for each method, test object and initial viewpoint.
        Methods come in the order of their first file, which is the order of the categories of
        ``method`` as well.
    """
    parts: dict[Unit, dict[str, list[pd.DataFrame]]] = {}
    for (category, elevation_deg, fold, method), path in files.items():
        frame = read_evaluation(path).assign(method=method, fold=fold)
        parts.setdefault((category, elevation_deg), {}).setdefault(method, []).append(frame)
    return {unit: _join(unit, by_method) for unit, by_method in parts.items()}


def _join(name: Unit, by_method: Mapping[str, list[pd.DataFrame]]) -> pd.DataFrame:
    frames = [frame for parts in by_method.values() for frame in parts]
    unit = pd.concat(frames, ignore_index=True)
    tested = unit[["method", "fold", "object_id"]].drop_duplicates()
    n_methods = tested.groupby(["fold", "object_id"])["method"].nunique()
    n_folds = tested.groupby("object_id")["fold"].nunique()
    where = f"{name[0]} at {name[1]}°"
    if (n_methods != len(by_method)).any():
        fold, object_id = n_methods.index[n_methods != len(by_method)][0]
        raise UserError(
            f"evaluation of {where}, fold {fold}: object {object_id!r} is not evaluated by every "
            "method; delete the fold's files and run the same command again"
        )
    if (n_folds > 1).any():
        raise UserError(
            f"evaluation of {where}: object {n_folds.index[n_folds > 1][0]!r} is tested in "
            "more than one fold; delete the evaluations and run the same command again"
        )
    unit["method"] = pd.Categorical(unit["method"], categories=list(by_method), ordered=True)
    return unit[["method", "fold", *COLUMNS]]


def load_object_ids(splits: Path) -> tuple[str, ...]:
    """Return the objects of a category from its splits."""
    read = read_splits(existing(splits))
    return tuple(read.loc[read["fold"] == read["fold"].min(), "object_id"])


def read_evaluation(path: Path) -> pd.DataFrame:
    """Read the errors of one method in one fold; same errors as `load_evaluations`."""
    frame = read_csv(path)
    check_columns(path, frame, COLUMNS)
    sweep_objects(path, frame, "initial_deg")
    check_azimuths(path, frame, ("initial_estimate_deg", "pose_estimate_deg"))
    followed = frame.dropna(subset="delta_deg")
    if len(followed) not in (0, len(frame)):
        raise damaged(path, "delta_deg is missing in some rows")
    check_azimuths(path, followed, ("delta_deg", "next_estimate_deg"))
    with readable(path):
        error_deg = frame["error_deg"].to_numpy(dtype=np.float64)
    # Written so that NaN is refused as well.
    if not ((error_deg >= 0.0) & (error_deg <= 180.0)).all():
        raise damaged(path, "an error_deg is not in [0, 180]")
    return frame
