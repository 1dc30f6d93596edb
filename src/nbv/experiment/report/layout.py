"""The rows and notes of the paper's tables, laid out as in the paper.

A cell shows ``ours [published]``, the best method of a row in bold. Tables 1 to 5 close with the
paired difference to the reference method and its interval, so that a difference can be told from
noise without another table. Below, the same rows show the share of errors above 90°.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from nbv.experiment.paper.published import PUBLISHED, SIGMA_ROW, Note
from nbv.experiment.report.settings import ReportSettings
from nbv.experiment.report.table import DECIDED, Cell, Row, difference_cell
from nbv.experiment.statistics.paired import LOWER_IS_BETTER, UNIT_OF
from nbv.labels import MINUS, method_label, number

Body = tuple[list[str], list[Row]]
"""The titles of the columns after the first, and the rows."""

METRIC_TITLES = {"mae": "MAE", "pauc": "pAUC"}
HALF_TURNS = "above_90_percent"


def comparison_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Rows by methods, then the difference of the subject to the reference (Tables 1 to 5)."""
    methods = _methods(cells)
    differs = _shows_difference(cells, settings)
    rows = []
    in_blocks = cells.sort_values("metric", key=lambda names: names == HALF_TURNS, kind="stable")
    for (metric, label), part in in_blocks.groupby(["metric", "row_label"], sort=False):
        title = f"{label}: errors above 90°" if metric == HALF_TURNS else str(label)
        row = [Cell(title), *_values(part, methods)]
        if differs:
            subject = part[part["method"] == settings.subject].iloc[0]
            ends = subject["difference_low"], subject["difference_high"]
            row.append(difference_cell(subject["difference"], *ends))
        rows.append(tuple(row))
    titles = [method_label(method) for method in methods]
    return titles + ([_difference_title(settings)] if differs else []), rows


def fold_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Folds by methods and, for each, MAE and pAUC (Table 7)."""
    methods = _methods(cells)
    rows = []
    for label, part in cells.groupby("row_label", sort=False):
        of_metric = [part[part["metric"] == metric] for metric in METRIC_TITLES]
        columns = [_values(found, methods) for found in of_metric]
        pairs = zip(*columns, strict=True)
        rows.append((Cell(str(label)), *(cell for pair in pairs for cell in pair)))
    titles = METRIC_TITLES.values()
    return [f"{method_label(method)} {title}" for method in methods for title in titles], rows


def example_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Ours and the published example in pairs of rows: they are different objects (Table 6)."""
    methods = _methods(cells)
    rows: list[Row] = []
    for label, part in cells.groupby("row_label", sort=False):
        errors = part[part["metric"] == "error"].set_index("method")
        estimates = part[part["metric"] == "estimate"].set_index("method")
        for column, suffix in (("value", ""), ("published", ", published")):
            found = errors[column].reindex(methods)
            if found.notna().any():
                shown = _examples(estimates[column].reindex(methods), found)
                rows.append((Cell(f"{label}{suffix}"), *shown))
    return [method_label(method) for method in methods], rows


def comparison_notes(cells: pd.DataFrame, settings: ReportSettings) -> Iterator[str]:
    """Say what is shown, how many objects it rests on, and what the difference is."""
    yield _legend(cells)
    objects = cells.groupby("row_label", sort=False)["n_objects"].max()
    if objects.min() == objects.max():
        yield f"{_counts(cells)} in each row."
    else:
        yield f"Test objects: {', '.join(f'{row} {int(n)}' for row, n in objects.items())}."
    if _shows_difference(cells, settings):
        yield (
            f"{_difference_title(settings)} is the paired difference with its 95 % interval over "
            f"objects ({settings.n_resamples} resamples). {DECIDED}"
        )


def fold_notes(cells: pd.DataFrame, settings: ReportSettings) -> Iterator[str]:
    """Say what is shown, and how many objects all folds together rest on."""
    yield _legend(cells)
    yield f"{_counts(cells)}."
    yield "The average is over the pooled images of all folds."


def published_notes(name: str, cells: pd.DataFrame) -> list[str]:
    """Return what is to be known about the published figures that a table shows."""
    return [note.text for note in PUBLISHED[name].notes if _explains(note, cells)]


def _methods(cells: pd.DataFrame) -> list[str]:
    return list(dict.fromkeys(cells["method"]))


def _values(row: pd.DataFrame, methods: list[str]) -> list[Cell]:
    """Return ``ours [published]`` per method; the best of the row, as printed, is bold."""
    by_method = row.set_index("method").reindex(methods)
    values = by_method["value"].round(2)
    (metric,) = row["metric"].unique()
    unit = "" if metric == "pauc" else UNIT_OF[metric]
    lower_is_better = LOWER_IS_BETTER[metric] or (row["row"] == SIGMA_ROW).all()
    best = values.min() if lower_is_better else values.max()
    cells = []
    for value, published in zip(values, by_method["published"], strict=True):
        if np.isfinite(value):
            after = f"[{number(published)}{unit}]" if np.isfinite(published) else ""
            cells.append(Cell(f"{number(value)}{unit}", bool(value == best), after))
        else:
            cells.append(Cell("–"))
    return cells


def _examples(estimates: pd.Series, errors: pd.Series) -> Iterator[Cell]:
    """Yield ``estimate (error)`` per method; the least error, as printed, is bold."""
    least = errors.round(1).min()
    for estimate, error in zip(estimates, errors, strict=True):
        if np.isfinite(error):
            turned = number(round(estimate, 1) % 360, 1)  # 359.96 is shown as 0.0, not as 360.0
            yield Cell(f"{turned}° ({number(error, 1)}°)", bool(round(error, 1) == least))
        else:
            yield Cell("–")


def _shows_difference(cells: pd.DataFrame, settings: ReportSettings) -> bool:
    return {settings.subject, settings.reference} <= set(cells["method"])


def _difference_title(settings: ReportSettings) -> str:
    return f"{method_label(settings.subject)} {MINUS} {method_label(settings.reference)}"


def _legend(cells: pd.DataFrame) -> str:
    if cells["published"].notna().any():
        return "Ours [published]; our best of each row in bold."
    return "The best of each row in bold; the paper prints no such figures."


def _counts(cells: pd.DataFrame) -> str:
    objects, images = int(cells["n_objects"].max()), int(cells["n_images"].max())
    return f"{objects} test objects, {images:,} initial views"


def _explains(note: Note, cells: pd.DataFrame) -> bool:
    """Say whether a figure that the note explains is among the cells."""
    explained = pd.Series(True, index=cells.index) if note.ours else cells["published"].notna()
    if note.metric:
        explained &= cells["metric"] == note.metric
    if note.rows:
        explained &= cells["row"].isin(note.rows)
    if note.method:
        explained &= cells["method"] == note.method
    return bool(explained.any())
