"""Trained on × tested on: what an estimator is worth under conditions that it was not trained for.

A condition is a sensor and a framing. Each estimator calibrates and tests on the same objects
under every condition, so that a column of the table compares estimators on the same images, and
what a mismatch costs is a paired difference.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from nbv.experiments.results import Unit, read_evaluation, unit_dir
from nbv.labels import category_label
from nbv.reporting.paper.cells import Table, cell, shared_resampler
from nbv.reporting.settings import TRANSFER
from nbv.reporting.settings import ReportSettings as ReadingSettings
from nbv.statistics import paired
from nbv.statistics.paired import pair_methods

Evaluations = Mapping[tuple[str, str], pd.DataFrame]
"""By the condition trained on and the one tested on: ``method, fold`` and `methods.COLUMNS`."""


def load_transfer(
    root: str | Path,
    conditions: Sequence[str],
    unit: Unit,
    folds: Sequence[int],
    methods: Sequence[str],
) -> dict[tuple[str, str], pd.DataFrame]:
    """Read every method's errors under every pair of conditions.

    Parameters
    ----------
    root : path
        ``results/<name>``.
    conditions : sequence of str
    unit : (category, elevation_deg)
    folds : sequence of int
    methods : sequence of str

    Raises
    ------
    UserError
        If a file is missing, empty, or lacks a column.
    """
    evaluations = {}
    for trained, tested in itertools.product(conditions, conditions):
        folder = unit_dir(Path(root) / TRANSFER, f"evaluation/{trained}/{tested}", *unit)
        parts = [
            read_evaluation(folder / f"fold{fold}" / f"{method}.csv").assign(
                method=method, fold=fold
            )
            for method, fold in itertools.product(methods, folds)
        ]
        evaluations[trained, tested] = pd.concat(parts, ignore_index=True)
    return evaluations


def build_transfer(
    evaluations: Evaluations,
    conditions: Mapping[str, Mapping[str, str]],
    unit: Unit,
    settings: ReadingSettings,
) -> Table:
    """Return the table of MAEs, one cell for each method and pair of conditions.

    Parameters
    ----------
    evaluations : mapping
        From `load_transfer`.
    conditions : mapping
        ``sensor`` and ``framing`` of each condition.
    unit : (category, elevation_deg)
    settings : ReadingSettings
        ``methods``, and the object bootstrap.

    Returns
    -------
    Table
        Its cells have the columns ``trained_on`` and ``tested_on`` besides `cells.CELL_COLUMNS`;
        ``difference*`` is the paired difference to the estimator that was trained on what is
        tested.
    """
    category, elevation = unit
    resampler = shared_resampler(settings)
    cells = []
    for tested in conditions:
        frames = {trained: evaluations[trained, tested] for trained in conditions}
        named = [f.assign(method=f"{trained}/" + f["method"]) for trained, f in frames.items()]
        sample = pair_methods(pd.concat(named, ignore_index=True), category)
        for method, trained in itertools.product(settings.methods, conditions):
            name = f"{trained}/{method}"
            found = paired.estimate("mae", sample, name, resampler)
            matched = paired.estimate("mae", sample, f"{tested}/{method}", resampler)
            interval, gap = found.interval(), found.minus(matched)
            made = cell(
                TRANSFER,
                f"{trained} on {tested}",
                f"{trained} on {tested}",
                method=method,
                metric="mae",
                value=interval.value,
                sigma=paired.fold_sigma("mae", sample, name),
                ci_low=interval.low,
                ci_high=interval.high,
                n_objects=sample.n_objects,
                n_images=sample.n_images,
            )
            if trained != tested:
                made |= {
                    "difference": gap.value,
                    "difference_low": gap.low,
                    "difference_high": gap.high,
                }
            cells.append(made | {"trained_on": trained, "tested_on": tested})
    frame = pd.DataFrame(cells)
    title = f"MAE of {category_label(category)} at elevation {elevation}°, trained on × tested on"
    return Table(TRANSFER, title, "Trained on", frame, _notes(conditions, settings), settings)


def _notes(
    conditions: Mapping[str, Mapping[str, str]], settings: ReadingSettings
) -> tuple[str, ...]:
    named = "; ".join(
        f"{name}: sensor {one['sensor']}, framing {one['framing']}"
        for name, one in conditions.items()
    )
    return (
        f"{named}.",
        "Columns are tested on; in brackets the 95 % interval over objects "
        f"({settings.n_resamples} resamples). The CSV file has the paired differences to the "
        "estimator trained on what is tested.",
        "Lookup tables are made of calibration objects under the condition that is tested.",
    )
