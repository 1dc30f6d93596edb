"""Choosing a second view, looking again and fusing: one row of results for every test image."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.angles import circular_distance_deg
from nbv.calibration.estimates import Estimates
from nbv.errors import UserError
from nbv.recommendation.fusion import FUSIONS, Rotations, second_look
from nbv.recommendation.lookup import LookupTable
from nbv.recommendation.method_selection import Entry
from nbv.recommendation.policies import (
    BASELINES,
    ORACLE,
    SINGLE,
    check_names,
    needs_lookup,
    rotate,
)

COLUMNS = (
    "object_id",
    "initial_deg",
    "initial_estimate_deg",
    "delta_deg",
    "next_estimate_deg",
    "pose_estimate_deg",
    "error_deg",
)


def check_method(name: str, method: Mapping[str, Any]) -> None:
    """Check what a configuration says about one of the paper's columns.

    Raises
    ------
    UserError
        Where its rotation or fusion is unknown, or is none that `evaluate_method` can do.
    """
    key = f"methods.{name}"
    check_names(key, method)
    if method["rotation"] == ORACLE or method["fusion"] != "average":
        raise UserError(f"{key}: oracles and fusion other than average belong under contenders")


def evaluate_method(
    method: Mapping[str, Any],
    test: Estimates,
    rng: np.random.Generator | None = None,
    lookup: LookupTable | None = None,
) -> pd.DataFrame:
    """Evaluate one method on every view of every test object.

    Parameters
    ----------
    method : mapping
        ``rotation``: ``none`` (one view alone), a name in `BASELINES`, or a criterion; ``fusion``:
        a name in `nbv.recommendation.fusion.FUSIONS`.
    test : Estimates
        360 / n_views must be a whole number of degrees.
    rng : numpy.random.Generator, optional
        Where the rotation is drawn.
    lookup : LookupTable, optional
        Where the rotation is a criterion.

    Returns
    -------
    DataFrame
        Columns `COLUMNS`; ``delta_deg`` and ``next_estimate_deg`` are absent for ``none``.
    """
    first = test.estimate_deg
    rotation = method["rotation"]
    if rotation == SINGLE:
        return results_frame(test, None, None, first)
    if needs_lookup(rotation):
        if lookup is None:
            raise ValueError(f"rotation {rotation!r} needs a lookup table")
        delta = lookup.recommend(first)
    else:
        if rng is None:
            raise ValueError(f"rotation {rotation!r} needs a generator")
        delta = BASELINES[rotation](first, rng)
    second = second_look(first, delta)
    return results_frame(test, delta, second, FUSIONS[method["fusion"]](first, second, delta, None))


def evaluate_entry(entry: Entry, test: Estimates, rng: np.random.Generator) -> pd.DataFrame:
    """Evaluate a contender on every view of every test object.

    Returns
    -------
    DataFrame
        As of `nbv.experiments.two_views.evaluate_method`.
    """
    first = test.estimate_deg
    if entry.lookup is not None:
        delta = entry.lookup.recommend(first)
    else:
        delta = rotate(entry.rotation, entry.fusion, first, entry.evidence, rng)
    second = second_look(first, delta)
    fused = FUSIONS[entry.fusion](first, second, delta, entry.evidence)
    return results_frame(test, delta, second, fused)


def results_frame(
    test: Estimates,
    delta_deg: Rotations | None,
    next_estimate_deg: ArrayLike | None,
    pose_estimate_deg: NDArray[np.float64],
) -> pd.DataFrame:
    """Return the rows of `evaluation/.../<method>.csv`."""
    n_objects, n_views = test.estimate_deg.shape
    # Rounded before the error is taken, so that the columns of a row agree with each other.
    pose = np.round(pose_estimate_deg, 4) % 360.0
    return pd.DataFrame(
        {
            "object_id": np.repeat(np.asarray(test.object_ids, dtype=object), n_views),
            "initial_deg": np.tile(test.azimuth_deg.astype(int), n_objects),
            "initial_estimate_deg": test.estimate_deg.ravel(),
            "delta_deg": pd.array([pd.NA] * (n_objects * n_views), dtype="Int64")
            if delta_deg is None
            else delta_deg.ravel(),
            "next_estimate_deg": np.nan
            if next_estimate_deg is None
            else np.ravel(next_estimate_deg),
            "pose_estimate_deg": pose.ravel(),
            "error_deg": circular_distance_deg(pose, test.azimuth_deg).ravel(),
        }
    )
