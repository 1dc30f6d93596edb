"""The choices that tables, claims and figures share: units, examples, labels and cells."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.circle.angles import circular_distance_deg
from nbv.errors import UserError, nearest
from nbv.experiment.paper import published
from nbv.experiment.results import Unit
from nbv.experiment.statistics import paired
from nbv.experiment.statistics.paired import PairedErrors, Resampler
from nbv.labels import category_label, method_label

_BASELINE = "single"
_SMOOTHING_DEG = 15.0

SUBJECT = "proposed"
"""The method that tables compare with the others, and whose lookup tables figures show."""

EXAMPLE_INITIAL_DEG = (0, 30, 210, 330)
"""Initial azimuths of Table 6."""

_REFERENCE_ELEVATION_DEG = 0  # of Tables 1, 3 and 5 to 7
_EXAMPLE_FOLD = 2  # of Table 6 and Figs. 2, 3 and 7

TRANSFER = "transfer"
"""The table "trained on × tested on", which is made on request only."""


@dataclass(frozen=True)
class ReportSettings:
    """Choices of presentation, on which no result depends.

    Attributes
    ----------
    methods : tuple of str
        Columns of the tables, in order, without those that were not evaluated.
    focus_category : str or None
        The category of Tables 2 and 4 to 7; None chooses ``mug``, or else the first category.
    reference : str
        Tables close with the paired difference of `SUBJECT` to it.
    n_resamples, seed : int
        Settings of the object bootstrap.
    """

    methods: tuple[str, ...] = published.METHODS
    focus_category: str | None = None
    reference: str = "opposite"
    n_resamples: int = 2000
    seed: int = 0


def focus_category(units: Iterable[Unit], wanted: str | None) -> str:
    """Return the category that the detailed tables and figures are about; see `ReportSettings`.

    Raises
    ------
    UserError
        If there are no results, or none of the chosen category.
    """
    categories = list(dict.fromkeys(category for category, _ in units))
    if not categories:
        raise UserError("no evaluated category and elevation; run the workflow first")
    if wanted is None:
        mug = published.FOCUS_CATEGORY
        return mug if mug in categories else categories[0]
    if wanted not in categories:
        raise UserError(
            f"focus_category {wanted!r} was not evaluated; {nearest(wanted, categories)}"
        )
    return wanted


def reference_units(units: Iterable[Unit]) -> list[Unit]:
    """Return one unit per category, in the order given.

    Each category is at the reference elevation, or at its lowest one if that was not run.
    """
    by_category: dict[str, list[Unit]] = {}
    for unit in units:
        by_category.setdefault(unit[0], []).append(unit)
    return [(name, common_elevation_deg(every)) for name, every in by_category.items()]


def common_elevation_deg(units: Iterable[Unit]) -> int:
    """Return the reference elevation, or the lowest one of the units if none has it."""
    elevations = {elevation for _, elevation in units}
    wanted = _REFERENCE_ELEVATION_DEG
    return wanted if wanted in elevations else min(elevations)


def unit_label(unit: Unit, common_deg: int) -> str:
    """Return a unit's category, with its elevation where it differs from the heading's."""
    category, elevation = unit
    label = category_label(category)
    return label if elevation == common_deg else f"{label} ({elevation}°)"


def focus_unit(units: Iterable[Unit], wanted: str | None) -> Unit:
    """Return the focus category at the reference elevation, or at its lowest one."""
    present = list(units)
    category = focus_category(present, wanted)
    of_category = [unit for unit in present if unit[0] == category]
    return category, common_elevation_deg(of_category)


@dataclass(frozen=True)
class Example:
    """A test object, its fold, and the reason for choosing it."""

    object_id: str
    fold: int
    reason: str


def example_fold(frame: pd.DataFrame) -> int:
    """Return the fold of the examples, or the first of a unit that was not run in it."""
    folds = sorted(frame["fold"].unique())
    return _EXAMPLE_FOLD if _EXAMPLE_FOLD in folds else int(folds[0])


def choose_example(frame: pd.DataFrame) -> Example:
    """Return the test object with the median single-view error in the example fold.

    The lower median for an even number; the first by name where errors tie. The middle object is
    neither the easiest nor the hardest, and the choice does not depend on the result of the method
    that the example shows. The frame is of one unit, from `results.load_evaluations`.
    """
    fold = example_fold(frame)
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
    """Return the evaluation of one method on the example, or None if there is none."""
    rows = frame[
        (frame["method"] == method)
        & (frame["object_id"] == example.object_id)
        & (frame["fold"] == example.fold)
        & (frame["initial_deg"] == azimuth_deg)
    ]
    return None if rows.empty else rows.iloc[0]


def hardest_azimuth_deg(frame: pd.DataFrame) -> int:
    """Return the initial azimuth around which the single-view error is largest.

    The mean over objects, then over 31 degrees, so that a single view does not decide. Where the
    category hides a distinctive part, this is the middle of the hidden range.
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


CELL_COLUMNS = (
    "table",
    "row",
    "row_label",
    "method",
    "metric",
    "value",
    "sigma",
    "published",
    "ci_low",
    "ci_high",
    "difference",
    "difference_low",
    "difference_high",
    "n_objects",
    "n_images",
)


def shared_resampler(settings: ReportSettings) -> Resampler:
    """Return the object resamples that the tables and claims of one seed share."""
    return Resampler.seeded(np.random.default_rng(settings.seed), settings.n_resamples)


def cell(table: str, row: str, row_label: str, **rest: Any) -> dict[str, Any]:
    """Return one cell; columns that are not given are NaN."""
    return dict.fromkeys(CELL_COLUMNS, np.nan) | {
        "table": table,
        "row": row,
        "row_label": row_label,
        **rest,
    }


def method_cells(
    table: str,
    row: str,
    row_label: str,
    metric: str,
    sample: PairedErrors,
    resampler: Resampler,
    settings: ReportSettings,
) -> list[dict[str, Any]]:
    """Return the cells of a row: a statistic for the settings' methods on the same images.

    Methods that the sample lacks are skipped; differences are to the settings' ``reference``.
    """
    estimates = {
        method: paired.estimate(metric, sample, method, resampler)
        for method in settings.methods
        if method in sample.errors_deg
    }
    reference = estimates.get(settings.reference)
    shared = {"metric": metric, "n_objects": sample.n_objects, "n_images": sample.n_images}
    cells = []
    for method, estimate in estimates.items():
        record = cell(table, row, row_label, method=method, **shared)
        record |= estimate.interval().columns("value", "ci")
        if not metric.endswith("_sigma"):
            record["sigma"] = paired.fold_sigma(metric, sample, method)
        if reference and method != settings.reference:
            record |= estimate.minus(reference).columns("difference")
        cells.append(record)
    return cells
