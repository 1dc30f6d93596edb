"""A table's cells: one statistic of each method on the same images, with its uncertainty."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from nbv.labels import method_label
from nbv.paper import published
from nbv.paper.published import Note
from nbv.reporting.settings import ReportSettings
from nbv.statistics import paired
from nbv.statistics.paired import PairedErrors, Resampler

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


@dataclass(frozen=True)
class Table:
    """One table: its cells (see the module's docstring), and the words around them."""

    name: str
    title: str
    row_header: str
    cells: pd.DataFrame
    notes: tuple[str, ...]
    settings: ReportSettings


def shared_resampler(settings: ReportSettings) -> Resampler:
    """Return the object resamples that the tables and claims of one seed share."""
    return Resampler.seeded(np.random.default_rng(settings.seed), settings.n_resamples)


def cell(name: str, row: str, row_label: str, **rest: Any) -> dict[str, Any]:
    """Return one cell; columns that are not given are absent."""
    return dict.fromkeys(CELL_COLUMNS, np.nan) | {
        "table": name,
        "row": row,
        "row_label": row_label,
        **rest,
    }


def assemble(
    name: str,
    title: str,
    row_header: str,
    cells: Iterable[dict[str, Any]],
    settings: ReportSettings,
    *notes: str,
) -> Table:
    """Return the table of some cells, its notes followed by those on what it shows."""
    frame = pd.DataFrame(list(cells), columns=list(CELL_COLUMNS))
    if name not in ("table6", "table7") and shows_difference(frame, settings):
        notes += (
            f"{method_label(settings.subject)} − {method_label(settings.reference)} is the paired "
            f"difference with its 95 % interval over objects ({settings.n_resamples} resamples).",
        )
    known = published.PUBLISHED[name].notes
    notes += tuple(note.text for note in known if _applies(note, frame))
    return Table(name, title, row_header, frame, notes, settings)


def _applies(note: Note, cells: pd.DataFrame) -> bool:
    """Say whether a figure that the note explains is among the cells."""
    explained = pd.Series(True, index=cells.index) if note.ours else cells["published"].notna()
    if note.metric:
        explained &= cells["metric"] == note.metric
    if note.rows:
        explained &= cells["row"].isin(note.rows)
    if note.method:
        explained &= cells["method"] == note.method
    return bool(explained.any())


def shows_difference(cells: pd.DataFrame, settings: ReportSettings) -> bool:
    """Say whether the two methods of the paired difference are both among the cells."""
    return {settings.subject, settings.reference} <= set(cells["method"])


def method_cells(
    name: str,
    row: str,
    row_label: str,
    metric: str,
    sample: PairedErrors,
    resampler: Resampler,
    settings: ReportSettings,
    comparable: bool,
) -> list[dict[str, Any]]:
    """Return one row's cells: a statistic of each method on the same images."""
    methods = [method for method in settings.methods if method in sample.errors_deg]
    estimates = {m: paired.estimate(metric, sample, m, resampler) for m in methods}
    cells = []
    for method, found in estimates.items():
        interval = found.interval()
        made = cell(
            name,
            row,
            row_label,
            method=method,
            metric=metric,
            value=interval.value,
            sigma=paired.fold_sigma(metric, sample, method),
            ci_low=interval.low,
            ci_high=interval.high,
            n_objects=sample.n_objects,
            n_images=sample.n_images,
        )
        printed = published.published_value(name, metric, row, method) if comparable else None
        made["published"] = np.nan if printed is None else printed
        if settings.reference in estimates and method != settings.reference:
            gap = found.minus(estimates[settings.reference])
            made |= {
                "difference": gap.value,
                "difference_low": gap.low,
                "difference_high": gap.high,
            }
        cells.append(made)
    return cells
