"""Tidy cells: one statistic of each method on the same images, with its uncertainty.

``value`` is in degrees (``mae``, ``estimate``, ``error``) or percent (``pauc``,
``above_90_percent``), pooled over the images of all folds; ``sigma`` is the sample standard
deviation of the cell's figure per fold; ``ci_*`` its 95 % interval over objects; ``difference*``
the paired difference to the reference method with its interval; ``published`` what the paper prints
in the same place.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.statistics import paired
from nbv.experiment.statistics.paired import PairedErrors, Resampler

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
    """Return one cell; columns that are not given are absent."""
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
    """Return one row's cells: a statistic of each of the settings' methods on the same images.

    Methods that the sample lacks are left out; differences are to the settings' ``reference``.
    """
    estimates = {
        method: paired.estimate(metric, sample, method, resampler)
        for method in settings.methods
        if method in sample.errors_deg
    }
    reference = estimates.get(settings.reference)
    shared = {"metric": metric, "n_objects": sample.n_objects, "n_images": sample.n_images}
    cells = []
    for method, found in estimates.items():
        made = cell(table, row, row_label, method=method, **shared)
        made |= found.interval().columns("value", "ci")
        if not metric.endswith("_sigma"):
            made["sigma"] = paired.fold_sigma(metric, sample, method)
        if reference and method != settings.reference:
            made |= found.minus(reference).columns("difference")
        cells.append(made)
    return cells
