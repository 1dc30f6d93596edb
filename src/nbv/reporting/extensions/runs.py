"""The errors of the same methods in several runs, image by image.

Columns of the tidy table are `cells.CELL_COLUMNS`: ``method`` is the run, ``row`` is
``<category> <method>``, and ``difference*`` compares with the first run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from nbv.experiments.results import Unit
from nbv.labels import MINUS, interval_text, method_label, number
from nbv.reporting.cells import CELL_COLUMNS, method_cells, shared_resampler
from nbv.reporting.settings import ReportSettings, common_elevation_deg, unit_label
from nbv.reporting.table import Cell, Row, Table
from nbv.statistics.paired import pair_methods

_NAME = "run_comparison"


def run_comparison(
    runs: Mapping[str, Mapping[Unit, pd.DataFrame]], settings: ReportSettings
) -> Table:
    """Return the MAE of every method in every run, with paired differences to the first run.

    ``runs`` has by run the frames of `nbv.experiments.results.load_evaluations` for the same units
    and test images. A method needs to be in one of them alone.

    Raises
    ------
    UserError
        Where runs were tested on different images.
    """
    first = next(iter(runs))
    elevation = common_elevation_deg(runs[first], settings)
    resampler = shared_resampler(settings)
    shown = replace(settings, methods=tuple(runs), reference=first)
    cells = []
    for unit in runs[first]:
        frames = [evaluations[unit].assign(run=run) for run, evaluations in runs.items()]
        errors = pd.concat(frames).astype({"method": str})
        for method, part in errors.groupby("method", sort=False):
            by_run = part.drop(columns="method").rename(columns={"run": "method"})
            row = f"{unit[0]} {method}"
            label = f"{unit_label(unit, elevation)}: {method_label(str(method))}"
            sample = pair_methods(by_run, unit[0])
            cells += method_cells(_NAME, row, label, "mae", sample, resampler, shown)
    frame = pd.DataFrame(cells, columns=list(CELL_COLUMNS))
    names = list(runs)
    by_label = frame.groupby("row_label", sort=False)
    rows = tuple(_row(str(label), part, names) for label, part in by_label)
    header = ("MAE", *names, *(f"{name} {MINUS} {first}" for name in names[1:]))
    note = (
        "Mean absolute errors over test images. Differences are paired image by image, with 95 % "
        "intervals over objects; those do not contain the chance of training."
    )
    title = "The same methods in several runs"
    return Table(_NAME, title, title, frame, header, rows, (note,))


def _row(label: str, part: pd.DataFrame, runs: list[str]) -> Row:
    """Return a method's errors run by run, then the differences; a dash where there is none."""
    found = {cell["method"]: cell for cell in part.to_dict("records")}
    values = [f"{number(found[run]['value'])}°" if run in found else "–" for run in runs]
    differences = ["–"] * (len(runs) - 1)
    for index, run in enumerate(runs[1:]):
        if run in found and np.isfinite(found[run]["difference"]):
            ends = found[run]["difference_low"], found[run]["difference_high"]
            differences[index] = interval_text(found[run]["difference"], *ends)
    return tuple(map(Cell, (label, *values, *differences)))
