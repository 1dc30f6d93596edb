"""Transfer between conditions: trained on × tested on.

A condition is a sensor and a framing. Each estimator calibrates and tests on the same objects
under every condition, so that a column of the table compares estimators on the same images, and
the cost of a mismatch is a paired difference.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from nbv.experiment.report.settings import ReportSettings, cell, shared_resampler
from nbv.experiment.report.table import Cell, Row, Table
from nbv.experiment.results import Unit, load_evaluations
from nbv.experiment.statistics.paired import fold_sigma, pair_methods
from nbv.labels import category_label, method_label, number
from studies.object_errors import mae_difference, mae_interval

Pair = tuple[str, str]
"""The condition trained on and the one tested on."""

TransferFile = tuple[str, str, int, str]
"""The key of a file of errors: trained on, tested on, fold (from 1) and method."""

_NAME = "transfer"


def load_transfer(files: Mapping[TransferFile, Path], unit: Unit) -> dict[Pair, pd.DataFrame]:
    """Read every method's errors under every pair of conditions.

    Raises
    ------
    UserError
        If a file is missing, empty, or lacks a column.
    """
    by_pair: dict[Pair, dict[tuple[str, int, int, str], Path]] = {}
    for (trained, tested, fold, method), path in files.items():
        by_pair.setdefault((trained, tested), {})[*unit, fold, method] = path
    return {pair: load_evaluations(by_file)[unit] for pair, by_file in by_pair.items()}


def transfer_table(
    evaluations: Mapping[Pair, pd.DataFrame],
    conditions: Mapping[str, Mapping[str, str]],
    unit: Unit,
    settings: ReportSettings,
) -> Table:
    """Return the table of MAEs by method and pair of conditions.

    ``evaluations`` come from `load_transfer`; ``conditions`` have a ``sensor`` and a ``framing``.
    The cells have `CELL_COLUMNS`, ``trained_on`` and ``tested_on``; ``difference*`` is the paired
    difference to the estimator that was trained on the tested condition.
    """
    category, elevation = unit
    resampler = shared_resampler(settings)
    cells = []
    for tested in conditions:
        named = []
        for trained in conditions:
            frame = evaluations[trained, tested]
            named.append(frame.assign(method=f"{trained}/" + frame["method"].astype(str)))
        sample = pair_methods(pd.concat(named, ignore_index=True), category)
        for method, trained in itertools.product(settings.methods, conditions):
            name = f"{trained}/{method}"
            pair = f"{trained} on {tested}"
            made = cell(_NAME, pair, pair, method=method, metric="mae")
            made |= mae_interval(sample, name, resampler).columns("value", "ci")
            made |= {"n_objects": sample.n_objects, "n_images": sample.n_images}
            made |= {"sigma": fold_sigma("mae", sample, name)}
            if trained != tested:
                less = mae_difference(sample, name, f"{tested}/{method}", resampler)
                made |= less.columns("difference")
            cells.append(made | {"trained_on": trained, "tested_on": tested})
    frame = pd.DataFrame(cells)
    title = f"MAE of {category_label(category)} at elevation {elevation}°, trained on × tested on"
    header = ("Method", "Trained on", *conditions)
    return Table(
        _NAME, title, title, frame, header, _rows(frame), _notes(frame, conditions, settings)
    )


def _rows(cells: pd.DataFrame) -> tuple[Row, ...]:
    """Return methods and training conditions by test conditions, the best of a column bold."""
    lowest = cells.groupby(["method", "tested_on"])["value"].min().round(2).to_dict()
    rows = []
    for (method, trained), part in cells.groupby(["method", "trained_on"], sort=False):
        row = [Cell(method_label(str(method))), Cell(str(trained))]
        for record in part.to_dict("records"):
            value = round(record["value"], 2)
            interval = f"({number(record['ci_low'])} to {number(record['ci_high'])})"
            is_best = bool(value == lowest[method, record["tested_on"]])
            row.append(Cell(f"{number(value)}°", is_best, interval))
        rows.append(tuple(row))
    return tuple(rows)


def _notes(
    cells: pd.DataFrame, conditions: Mapping[str, Mapping[str, str]], settings: ReportSettings
) -> tuple[str, ...]:
    named = "; ".join(
        f"{name}: sensor {condition['sensor']}, framing {condition['framing']}"
        for name, condition in conditions.items()
    )
    return (
        "The best of each column in bold, for each method.",
        f"{int(cells['n_objects'].max())} test objects, {int(cells['n_images'].max()):,} initial "
        "views in each row.",
        f"{named}.",
        "Columns are tested on; in brackets the 95 % interval over objects "
        f"({settings.n_resamples} resamples). The CSV file has the paired differences to the "
        "estimator trained on what is tested.",
        "Lookup tables are made of calibration objects under the condition that is tested.",
    )
