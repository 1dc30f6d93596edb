"""Which object and viewpoint are the example, chosen by rule so that nobody picked them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from nbv.core.angles import circular_distance_deg
from nbv.experiment.report.settings import ReportSettings
from nbv.labels import method_label

_BASELINE = "single"
_SMOOTHING_DEG = 15.0


@dataclass(frozen=True)
class Example:
    """One test object, the fold that tested it, and why it was taken."""

    object_id: str
    fold: int
    reason: str


def choose_example(frame: pd.DataFrame, settings: ReportSettings) -> Example:
    """Return the test object with the median single-view error in the example fold.

    The lower median where their number is even; the first by name where errors tie. The middle
    object is neither the easiest nor the hardest, and no choice by the result of the method
    that the example is to show.

    Parameters
    ----------
    frame : pandas.DataFrame
        One unit, from `results.load_evaluations`.
    settings : ReportSettings
        Gives the fold.
    """
    folds = sorted(frame["fold"].unique())
    fold = int(settings.example_fold if settings.example_fold in folds else folds[0])
    in_fold = frame[frame["fold"] == fold]
    method = _baseline(in_fold)
    errors = in_fold[in_fold["method"] == method].groupby("object_id")["error_deg"].mean()
    ordered = errors.sort_index().sort_values(kind="stable")
    chosen = str(ordered.index[(len(ordered) - 1) // 2])
    reason = (
        f"the one with the median {method_label(method)} error of that fold's {len(ordered)} test "
        "objects"
    )
    return Example(chosen, fold, reason)


def example_row(
    frame: pd.DataFrame, example: Example, method: str, azimuth_deg: float
) -> pd.Series | None:
    """Return the evaluation of one method on the example, or None where it was not made."""
    rows = frame[
        (frame["method"] == method)
        & (frame["object_id"] == example.object_id)
        & (frame["fold"] == example.fold)
        & (frame["initial_deg"] == azimuth_deg)
    ]
    return None if rows.empty else rows.iloc[0]


def hardest_azimuth_deg(frame: pd.DataFrame) -> int:
    """Return the initial azimuth around which the single-view error is largest.

    The mean over objects, then over 31 degrees, so that one odd view does not decide; where the
    category hides what tells its pose, that is the middle of the hidden range.
    """
    single = frame[frame["method"] == _baseline(frame)]
    by_azimuth = single.groupby("initial_deg")["error_deg"].mean()
    azimuths = by_azimuth.index.to_numpy(dtype=np.float64)
    near = circular_distance_deg(azimuths[:, None], azimuths[None, :]) <= _SMOOTHING_DEG
    smooth = (near @ by_azimuth.to_numpy(dtype=np.float64)) / near.sum(axis=1)
    return int(azimuths[int(np.argmax(smooth))])


def _baseline(frame: pd.DataFrame) -> str:
    present = list(frame["method"].astype(str).unique())
    return _BASELINE if _BASELINE in present else present[0]
