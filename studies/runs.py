"""The errors of the same methods, or of single views, in several runs, image by image.

Columns of the tidy table are `cells.CELL_COLUMNS`: ``method`` is the run, ``row`` is
``<category> <method>``, and ``difference*`` compares with the first run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from nbv.experiment.layout import unit_folder
from nbv.experiment.report.settings import (
    CELL_COLUMNS,
    ReportSettings,
    common_elevation_deg,
    method_cells,
    shared_resampler,
    unit_label,
)
from nbv.experiment.report.table import DECIDED, Cell, Row, Table, difference_cell
from nbv.experiment.results import ESTIMATED_ROLES, Unit
from nbv.experiment.statistics.paired import PairedErrors, pair_methods, pool
from nbv.labels import MINUS, category_label, method_label, number

_NOTE = (
    "Differences are paired image by image, with 95 % intervals over objects; those do not contain "
    "the chance of training."
)


def run_comparison(
    runs: Mapping[str, Mapping[Unit, pd.DataFrame]], settings: ReportSettings
) -> Table:
    """Return the MAE of every method in every run, with paired differences to the first run.

    ``runs`` has by run the frames of `nbv.experiment.results.load_evaluations` for the same units
    and test images. A method needs to be in one of them alone.

    Raises
    ------
    UserError
        Where runs were tested on different images.
    """
    first = next(iter(runs))
    elevation = common_elevation_deg(runs[first], settings)
    samples = {}
    for unit in runs[first]:
        errors = _of_runs(runs, [unit])
        for method, part in errors.groupby("method", sort=False):
            label = f"{unit_label(unit, elevation)}: {method_label(str(method))}"
            samples[f"{unit[0]} {method}", label] = _paired(part, unit[0])
    notes = ("Mean absolute errors over test images.", _NOTE)
    title = "The same methods in several runs"
    return _table("run_comparison", title, samples, list(runs), settings, notes)


def estimator_comparison(
    runs: Mapping[str, Mapping[Unit, pd.DataFrame]], settings: ReportSettings
) -> Table:
    """Return the MAE of one view in every run, with paired differences to the first run.

    ``runs`` has by run the frames of `nbv.experiment.results.load_estimate_errors` for the same
    units and objects. Calibration objects have lines of their own: what is chosen on them is not
    chosen on test objects. A category's elevations are also pooled, and so are the categories.

    Raises
    ------
    UserError
        Where runs have estimates of different images.
    """
    units = list(next(iter(runs.values())))
    elevation = common_elevation_deg(units, settings)
    samples = {}
    for role in ESTIMATED_ROLES:
        of_category = {}
        for category in dict.fromkeys(category for category, _ in units):
            own = [unit for unit in units if unit[0] == category]
            for unit in own:
                label = f"{unit_label(unit, elevation)}: {role} objects"
                name = f"{unit_folder(*unit)} {role}"
                samples[name, label] = _paired(_of_runs(runs, [unit], role), category)
            # An object is resampled with its images at all elevations.
            of_category[category] = _paired(_of_runs(runs, own, role), category)
            if len(own) > 1:
                label = f"{category_label(category)}, all elevations: {role} objects"
                samples[f"{category} {role}", label] = of_category[category]
        if len(of_category) > 1:
            label = f"All categories: {role} objects"
            samples[f"all {role}", label] = pool(list(of_category.values()))
    notes = (
        "Mean absolute errors of one view. No training of a fold has seen its calibration objects "
        "or its test objects.",
        _NOTE,
    )
    title = "Estimators of several runs"
    return _table("estimator_comparison", title, samples, list(runs), settings, notes)


def _of_runs(
    runs: Mapping[str, Mapping[Unit, pd.DataFrame]], units: list[Unit], method: str | None = None
) -> pd.DataFrame:
    """Return the errors of some units in all runs, of one method or of all."""
    frames = [
        evaluations[unit].assign(run=run, elevation_deg=unit[1])
        for run, evaluations in runs.items()
        for unit in units
    ]
    errors = pd.concat(frames).astype({"method": str})
    return errors if method is None else errors[errors["method"] == method]


def _paired(errors: pd.DataFrame, category: str) -> PairedErrors:
    by_run = errors.drop(columns="method").rename(columns={"run": "method"})
    # The order of images at several elevations is the same in all runs.
    return pair_methods(by_run.sort_values("elevation_deg", kind="stable"), category)


def _table(
    name: str,
    title: str,
    samples: Mapping[tuple[str, str], PairedErrors],
    runs: list[str],
    settings: ReportSettings,
    notes: tuple[str, ...],
) -> Table:
    """Return a table with a row for each sample, whose key is the row's name and its label."""
    shown = replace(settings, methods=tuple(runs), reference=runs[0])
    resampler = shared_resampler(settings)
    cells = [
        cell
        for (row, label), sample in samples.items()
        for cell in method_cells(name, row, label, "mae", sample, resampler, shown)
    ]
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    by_label = frame.groupby("row_label", sort=False)
    rows = tuple(_row(str(label), part, runs) for label, part in by_label)
    header = ("MAE", *runs, *(f"{run} {MINUS} {runs[0]}" for run in runs[1:]))
    return Table(name, title, title, frame, header, rows, (" ".join((*notes, DECIDED)),))


def _row(label: str, part: pd.DataFrame, runs: list[str]) -> Row:
    """Return a method's errors run by run, then the differences; a dash where there is none."""
    found = {cell["method"]: cell for cell in part.to_dict("records")}
    values = [Cell(f"{number(found[run]['value'])}°" if run in found else "–") for run in runs]
    differences = [Cell("–")] * (len(runs) - 1)
    for index, run in enumerate(runs[1:]):
        if run in found and np.isfinite(found[run]["difference"]):
            ends = found[run]["difference_low"], found[run]["difference_high"]
            differences[index] = difference_cell(found[run]["difference"], *ends)
    return (Cell(label), *values, *differences)
