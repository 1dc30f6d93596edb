"""Several runs side by side: the errors of one view and of all methods.

The columns of the tidy table are `CELL_COLUMNS`: ``method`` is the run, ``row`` is ``<scope>
<method> <role>`` with a scope such as ``mug/el00``, ``mug`` (all its elevations) or ``all`` (all
categories), and ``difference*`` compares with the first run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.circle.angles import circular_distance_deg
from nbv.experiment.estimates import read_estimates
from nbv.experiment.report.settings import (
    CELL_COLUMNS,
    ReportSettings,
    common_elevation_deg,
    method_cells,
    shared_resampler,
    unit_label,
)
from nbv.experiment.report.table import DECIDED, Cell, Row, Table, difference_cell
from nbv.experiment.results import Unit
from nbv.experiment.statistics.paired import PairedErrors, pair_methods, pool
from nbv.files import existing
from nbv.labels import MINUS, category_label, method_label, number

EstimatesFile = tuple[str, int, int, str]
"""The key of a file of estimates: category, elevation in degrees, fold (from 1) and role."""

RunErrors = Mapping[str, Mapping[Unit, pd.DataFrame]]
"""The errors of all images, by run and unit."""

_NAME = "runs"
_SINGLE = "single"
_NOTES = (
    "Mean absolute errors. No training of a fold has seen its calibration objects or its test "
    "objects.",
    "Differences are paired image by image, with 95 % intervals over objects; those do not contain "
    f"the chance of training. {DECIDED}",
)


def load_estimate_errors(files: Mapping[EstimatesFile, Path]) -> dict[Unit, pd.DataFrame]:
    """Read the errors of estimates from one view.

    Parameters
    ----------
    files : mapping of (category, elevation_deg, fold, role) to path
        Files of `nbv.experiment.estimates.write_estimates`, the role ``calibration`` or
        ``test``.

    Returns
    -------
    dict of (category, elevation_deg) to pandas.DataFrame
        Frames with the columns ``method, fold, object_id, initial_deg, error_deg``; ``method`` is
        the role. An object calibrates in several folds.

    Raises
    ------
    UserError
        Where a file is missing or damaged.
    """
    parts: dict[Unit, list[pd.DataFrame]] = {}
    for (category, elevation_deg, fold, role), path in files.items():
        estimates = read_estimates(existing(path))
        errors = circular_distance_deg(estimates.estimate_deg, estimates.azimuth_deg)
        n_objects, n_views = errors.shape
        frame = pd.DataFrame(
            {
                "method": role,
                "fold": fold,
                "object_id": np.repeat(np.asarray(estimates.object_ids, dtype=object), n_views),
                "initial_deg": np.tile(estimates.azimuth_deg, n_objects),
                "error_deg": errors.ravel(),
            }
        )
        parts.setdefault((category, elevation_deg), []).append(frame)
    return {unit: pd.concat(frames, ignore_index=True) for unit, frames in parts.items()}


def runs_table(estimates: RunErrors, evaluations: RunErrors, settings: ReportSettings) -> Table:
    """Return the MAE of Single and of every method in every run, with differences to the first run.

    A category's elevations are also pooled, and so are the categories.

    Parameters
    ----------
    estimates : mapping of str to mapping of (category, elevation_deg) to DataFrame
        Errors of one view from `load_estimate_errors`. All runs have the
        same units and roles.
    evaluations : mapping of str to mapping of (category, elevation_deg) to DataFrame
        Errors of two views from `nbv.experiment.results.load_evaluations`. Runs may have different
        methods.
    settings : ReportSettings
        The reference elevation and the resamples.

    Raises
    ------
    UserError
        Where runs have errors on different images.
    """
    runs = list(estimates)
    units = list(estimates[runs[0]])
    shown = replace(settings, methods=tuple(runs), reference=runs[0])
    resampler = shared_resampler(settings)
    lines = _lines(estimates, evaluations)
    cells = []
    for scope, scope_label, categories in _scopes(units, common_elevation_deg(units)):
        for (method, role), errors in lines.items():
            sample = pool([_paired(errors, *category) for category in categories.items()])
            row = f"{scope} {method} {role}"
            label = f"{scope_label}: {method_label(method)}, {role} objects"
            cells += method_cells(_NAME, row, label, "mae", sample, resampler, shown)
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    by_label = frame.groupby("row_label", sort=False)
    rows = tuple(_row(str(label), part, runs) for label, part in by_label)
    header = ("MAE", *runs, *(f"{run} {MINUS} {runs[0]}" for run in runs[1:]))
    title = "Runs side by side"
    return Table(_NAME, title, title, frame, header, rows, _NOTES)


def _lines(
    estimates: RunErrors, evaluations: RunErrors
) -> dict[tuple[str, str], dict[tuple[str, Unit], pd.DataFrame]]:
    """Return the errors by method and role, then by run and unit."""
    lines: dict[tuple[str, str], dict[tuple[str, Unit], pd.DataFrame]] = {}
    for run, by_unit in estimates.items():
        for unit, errors in by_unit.items():
            for role, part in errors.groupby("method", sort=False):
                lines.setdefault((_SINGLE, str(role)), {})[run, unit] = part
    for run, by_unit in evaluations.items():
        for unit, errors in by_unit.items():
            for method, part in errors.groupby("method", observed=True, sort=False):
                lines.setdefault((str(method), "test"), {})[run, unit] = part
    return lines


def _scopes(
    all_units: list[Unit], common_deg: int
) -> Iterator[tuple[str, str, Mapping[str, list[Unit]]]]:
    """Yield the name, label and units by category of all scopes."""
    by_category: dict[str, list[Unit]] = {}
    for unit in all_units:
        by_category.setdefault(unit[0], []).append(unit)
    for category, units in by_category.items():
        for unit in units:
            yield f"{category}/el{unit[1]:02d}", unit_label(unit, common_deg), {category: [unit]}
        if len(units) > 1:
            yield category, f"{category_label(category)}, all elevations", {category: units}
    if len(by_category) > 1:
        yield "all", "All categories", by_category


def _paired(
    errors: Mapping[tuple[str, Unit], pd.DataFrame], category: str, units: list[Unit]
) -> PairedErrors:
    """Return the errors of all runs; an object is resampled with its images at all elevations."""
    parts = [
        part.assign(method=run, elevation_deg=unit[1])
        for (run, unit), part in errors.items()
        if unit in units
    ]
    # The order of images at several elevations is the same in all runs.
    by_elevation = pd.concat(parts).sort_values("elevation_deg", kind="stable")
    return pair_methods(by_elevation, category)


def _row(label: str, part: pd.DataFrame, runs: list[str]) -> Row:
    """Return the errors by run, then the differences; a dash where a run has none."""
    by_run = {cell["method"]: cell for cell in part.to_dict("records")}
    values = [Cell(f"{number(by_run[run]['value'])}°" if run in by_run else "–") for run in runs]
    differences = [Cell("–")] * (len(runs) - 1)
    for index, run in enumerate(runs[1:]):
        if run in by_run and np.isfinite(by_run[run]["difference"]):
            ends = by_run[run]["difference_low"], by_run[run]["difference_high"]
            differences[index] = difference_cell(by_run[run]["difference"], *ends)
    return (Cell(label), *values, *differences)


def files_by_run(
    keys: Sequence[tuple[Any, ...]], paths: Iterable[str]
) -> dict[str, dict[tuple[Any, ...], str]]:
    """Return the files of each run by the rest of their key.

    A key is a run's name and what the file is about: category, elevation, fold, ….
    """
    files: dict[str, dict[tuple[Any, ...], str]] = {}
    for (run, *rest), path in zip(keys, paths, strict=True):
        files.setdefault(run, {})[tuple(rest)] = path
    return files
