"""Mean errors by object, and paired comparisons of the methods' MAE."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.core.circle.angles import travel_deg
from nbv.errors import UserError
from nbv.experiment.statistics.metrics import Interval, above_90, accuracy_area
from nbv.experiment.statistics.paired import PairedErrors, Resampler, estimate
from nbv.files import existing, read_csv

FoldFile = tuple[str, int, int]
"""The key of a file: category, elevation in degrees and fold (from 1)."""

MEAN_COLUMNS = ("error_deg", "pauc_percent", "above_90_percent", "travel_deg")
OBJECT_COLUMNS = ("method", "object_id", "n_images", *MEAN_COLUMNS)


def object_means(frames: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return each object's mean error, pAUC, share of errors above 90° and travel by method.

    Parameters
    ----------
    frames : mapping of str to DataFrame
        Rows of ``evaluation/.../<method>.csv`` by method.

    Returns
    -------
    DataFrame
        Columns `OBJECT_COLUMNS`; ``travel_deg`` is 0 where no second view was taken.
    """
    parts = []
    for method, frame in frames.items():
        travel = travel_deg(frame["delta_deg"].fillna(0).to_numpy(dtype=np.float64))
        rows = frame.assign(
            pauc_percent=accuracy_area(frame["error_deg"]),
            above_90_percent=above_90(frame["error_deg"]),
            travel_deg=travel,
        ).groupby("object_id")
        means = rows[list(MEAN_COLUMNS)].mean()
        means.insert(0, "n_images", rows.size())
        parts.append(means.reset_index().assign(method=method))
    return pd.concat(parts, ignore_index=True)[list(OBJECT_COLUMNS)]


def load_folds(files: Mapping[FoldFile, Path]) -> pd.DataFrame:
    """Read a CSV file for each unit and fold into one frame, such as files of `object_means`.

    Returns
    -------
    DataFrame
        ``category, elevation_deg, fold`` and the columns of the files.
    """
    parts = []
    for key, path in files.items():
        rows = read_csv(existing(path))
        for i, name in enumerate(("category", "elevation_deg", "fold")):
            rows.insert(i, name, key[i])
        parts.append(rows)
    return pd.concat(parts, ignore_index=True)


def paired_objects(means: pd.DataFrame, category: str) -> PairedErrors:
    """Line up the methods of one category and elevation object by object.

    Each object counts as one image with its mean error: with equally many viewpoints per object,
    the mean over objects is the mean over images.
    """
    indexed = means.set_index(["object_id", "fold", "method"])["error_deg"]
    wide = indexed.unstack("method")  # noqa: PD010 - nothing to aggregate
    wide = wide.sort_index(level="object_id").dropna(axis=1)
    n_objects = len(wide)
    return PairedErrors(
        {str(method): wide[method].to_numpy(dtype=np.float64) for method in wide.columns},
        np.arange(n_objects, dtype=np.int64),
        wide.index.get_level_values("fold").to_numpy(dtype=np.int64),
        np.zeros(n_objects),
        (category,) * n_objects,
    )


def mae_interval(sample: PairedErrors, method: str, resampler: Resampler) -> Interval:
    """Return a method's MAE in degrees with its 95 % interval over objects."""
    return estimate("mae", sample, method, resampler).interval()


def mae_difference(sample: PairedErrors, method: str, other: str, resampler: Resampler) -> Interval:
    """Return the paired difference of two methods' MAE in degrees, with its 95 % interval."""
    mine = estimate("mae", sample, method, resampler)
    return mine.minus(estimate("mae", sample, other, resampler))


def indistinct_from_best(
    sample: PairedErrors, methods: Sequence[str], resampler: Resampler
) -> list[str]:
    """Return the method of least MAE, then those whose 95 % interval to it includes 0."""
    estimates = {method: estimate("mae", sample, method, resampler) for method in methods}
    for method, mae in estimates.items():
        if not math.isfinite(mae.value):
            raise UserError(f"{method}: the MAE is {mae.value}: its errors are damaged")
    best = min(methods, key=lambda method: estimates[method].value)
    return [best] + [
        method
        for method in methods
        if method != best and estimates[method].minus(estimates[best]).low <= 0.0
    ]
