"""The errors of the same methods in several runs, image by image.

Columns of the tidy table are `cells.CELL_COLUMNS`: ``method`` is the run, ``row`` is
``<category> <method>``, and ``difference*`` compares with the first run.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.experiments.results import Unit, load_unit
from nbv.labels import method_label, number
from nbv.reporting.markdown import pipe_row
from nbv.reporting.paper.cells import CELL_COLUMNS, method_cells, shared_resampler
from nbv.reporting.settings import ReportSettings as ReadingSettings
from nbv.reporting.settings import common_elevation_deg, unit_label
from nbv.statistics.paired import pair_methods

Runs = Mapping[str, tuple[Path, Sequence[str]]]
"""A run's folder and its methods, by the run's name."""


def sidebyside_cells(
    runs: Runs, units: Iterable[Unit], n_folds: int, settings: ReadingSettings
) -> pd.DataFrame:
    """Return the MAE of every method in every run, with paired differences to the first run.

    Parameters
    ----------
    runs : mapping
        All were tested on the same images. A method needs to be in one of them alone.
    units : iterable of (category, elevation_deg)
    n_folds : int
    settings : ReadingSettings
        ``n_resamples`` and ``seed``.

    Raises
    ------
    UserError
        Where a file is missing, or runs were tested on different images.
    """
    units = list(units)
    elevation = common_elevation_deg(units, settings)
    resampler = shared_resampler(settings)
    shown = replace(settings, methods=tuple(runs), reference=next(iter(runs)))
    cells = []
    for unit in units:
        frames = [
            load_unit(root, *unit, n_folds, methods).assign(run=run)
            for run, (root, methods) in runs.items()
        ]
        errors = pd.concat(frames).astype({"method": str})
        for method, part in errors.groupby("method", sort=False):
            by_run = part.drop(columns="method").rename(columns={"run": "method"})
            label = f"{unit_label(unit, elevation)}: {method_label(str(method))}"
            cells += method_cells(
                "sidebyside",
                f"{unit[0]} {method}",
                label,
                "mae",
                pair_methods(by_run, unit[0]),
                resampler,
                shown,
                comparable=False,
            )
    return pd.DataFrame(cells, columns=list(CELL_COLUMNS))


def sidebyside_markdown(cells: pd.DataFrame) -> str:
    """Return the table of `sidebyside_cells` for people."""
    runs = list(dict.fromkeys(cells["method"]))
    differing = [f"{run} \u2212 {runs[0]}" for run in runs[1:]]
    lines = ["## The same methods in several runs", ""]
    lines.append(pipe_row(["MAE", *runs, *differing]))
    lines.append(pipe_row(["---"] + ["---:"] * (len(runs) + len(differing))))
    for label, part in cells.groupby("row_label", sort=False):
        found = {cell["method"]: cell for cell in part.to_dict("records")}
        values = [f"{number(found[run]['value'])}°" if run in found else "–" for run in runs]
        differences = [_difference(found[run]) if run in found else "–" for run in runs[1:]]
        lines.append(pipe_row([str(label), *values, *differences]))
    note = (
        "- Mean absolute errors over test images. Differences are paired image by image, with 95 % "
        "intervals over objects; those do not contain the chance of training."
    )
    return "\n".join([*lines, "", note]) + "\n"


def _difference(cell: Mapping[Hashable, Any]) -> str:
    if not np.isfinite(cell["difference"]):
        return "–"
    low, high = cell["difference_low"], cell["difference_high"]
    return f"{number(cell['difference'])} ({number(low)} to {number(high)})"
