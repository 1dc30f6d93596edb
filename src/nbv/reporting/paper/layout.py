"""Tables as people read them: Markdown and LaTeX twins, laid out as in the paper.

Each cell reads ``ours [published]``, the best method of a row in bold. A last column gives the
paired difference to the reference method with its interval, so that a gap can be told from noise
without another table.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.files import write_csv, write_text
from nbv.labels import MINUS, interval_text, method_label, number
from nbv.paper import published
from nbv.reporting.grid import Cell, Grid, grid_latex, grid_markdown
from nbv.reporting.paper.cells import Table, shows_difference
from nbv.reporting.settings import TRANSFER

_METRIC_LABELS = {"mae": "MAE", "pauc": "pAUC"}


def save_table(table: Table, stem: str | Path) -> list[Path]:
    """Write ``<stem>.csv`` (tidy), ``<stem>.md`` and ``<stem>.tex``; return the three paths."""
    stem = Path(stem)
    paths = [stem.with_name(f"{stem.name}{suffix}") for suffix in (".csv", ".md", ".tex")]
    write_csv(paths[0], table.cells)
    write_text(paths[1], to_markdown(table))
    write_text(paths[2], to_latex(table))
    return paths


def to_markdown(table: Table) -> str:
    """Return the table as a heading, a pipe table and its notes as a list."""
    return grid_markdown(heading(table), _grid(table), _notes(table))


def to_latex(table: Table) -> str:
    """Return the table as LaTeX; see `nbv.reporting.grid.grid_latex`."""
    return grid_latex(table.name, table.title, _grid(table), _notes(table))


def heading(table: Table) -> str:
    """Return the table's number, where it has one, and title."""
    if table.name == TRANSFER:
        return table.title
    return f"Table {table.name.removeprefix('table')}: {table.title}"


def _notes(table: Table) -> list[str]:
    cells = table.cells
    objects = cells.groupby("row_label", sort=False)["n_objects"].max()
    if objects.min() == objects.max() or table.name == "table7":
        counts = (
            f"{int(objects.max())} test objects, {int(cells['n_images'].max()):,} initial views"
        )
        counts += " in each row" if table.name != "table7" else ""
    else:
        counts = "Test objects: " + ", ".join(f"{row} {int(n)}" for row, n in objects.items())
    shown = [] if table.name == "table6" else [f"{counts}."]
    if table.name == TRANSFER:
        shown.insert(0, "The best of each column in bold, for each method.")
    elif cells["published"].notna().any() and table.name != "table6":
        shown.insert(0, "Ours [published]; our best of each row in bold.")
    elif table.name != "table6":
        shown.insert(0, "The best of each row in bold; the paper prints no such figures.")
    return [*shown, *table.notes]


def _grid(table: Table) -> Grid:
    if table.name == TRANSFER:
        return _transfer_grid(table)
    if table.name == "table6":
        return _example_grid(table)
    if table.name == "table7":
        return _fold_grid(table)
    return _comparison_grid(table)


def _comparison_grid(table: Table) -> Grid:
    """Rows by methods, then the difference of the subject to the reference (Tables 1 to 5)."""
    cells, settings = table.cells, table.settings
    methods = list(dict.fromkeys(cells["method"]))
    degrees = "°" if cells["metric"].iloc[0] == "mae" else ""
    gap = f"{method_label(settings.subject)} {MINUS} {method_label(settings.reference)}"
    shows_gap = shows_difference(cells, settings)
    rows = []
    for label, part in cells.groupby("row_label", sort=False):
        row = [Cell(str(label))]
        row += _method_cells(part, methods, degrees)
        if shows_gap:
            row.append(Cell(_gap_text(part[part["method"] == settings.subject].iloc[0])))
        rows.append(tuple(row))
    header = [table.row_header, *map(method_label, methods)] + ([gap] if shows_gap else [])
    return Grid(tuple(header), tuple(rows))


def _fold_grid(table: Table) -> Grid:
    """Folds by (method, metric), as the paper's Table 7."""
    cells = table.cells
    methods = list(dict.fromkeys(cells["method"]))
    rows = []
    for label, part in cells.groupby("row_label", sort=False):
        by_metric = {
            metric: _method_cells(part[part["metric"] == metric], methods, degrees)
            for metric, degrees in (("mae", "°"), ("pauc", ""))
        }
        row = [Cell(str(label))]
        for position in range(len(methods)):
            row += [by_metric["mae"][position], by_metric["pauc"][position]]
        rows.append(tuple(row))
    header = [table.row_header]
    for method in methods:
        header += [f"{method_label(method)} {label}" for label in _METRIC_LABELS.values()]
    return Grid(tuple(header), tuple(rows))


def _transfer_grid(table: Table) -> Grid:
    """Methods and conditions trained on by conditions tested on; the best of each column."""
    cells = table.cells
    tested = list(dict.fromkeys(cells["tested_on"]))
    lowest = cells.groupby(["method", "tested_on"])["value"].min().round(2).to_dict()
    rows = []
    for (method, trained), part in cells.groupby(["method", "trained_on"], sort=False):
        row = [Cell(method_label(str(method))), Cell(str(trained))]
        for cell in part.to_dict("records"):
            value = round(cell["value"], 2)
            interval = f"({number(cell['ci_low'])} to {number(cell['ci_high'])})"
            is_best = value == lowest[method, cell["tested_on"]]
            row.append(Cell(f"{number(value)}°", bool(is_best), interval))
        rows.append(tuple(row))
    return Grid(("Method", table.row_header, *tested), tuple(rows))


def _example_grid(table: Table) -> Grid:
    """Ours and the published example in paired rows: they are different objects (Table 6)."""
    cells = table.cells
    methods = list(dict.fromkeys(cells["method"]))
    rows = []
    for label, part in cells.groupby("row_label", sort=False):
        errors = part[part["metric"] == "error"].set_index("method")
        estimates = part[part["metric"] == "estimate"].set_index("method")
        for column, suffix in (("value", ""), ("published", ", published")):
            if errors[column].isna().all():
                continue
            lowest = errors[column].round(1).min()
            row = [Cell(f"{label}{suffix}")]
            for method in methods:
                estimate, error = estimates[column].get(method), errors[column].get(method)
                if estimate is None or error is None or not np.isfinite(error):
                    row.append(Cell("–"))
                    continue
                turned = number(round(estimate, 1) % 360, 1)  # 359.96 reads 0.0, not 360.0
                text = f"{turned}° ({number(error, 1)}°)"
                row.append(Cell(text, bool(round(error, 1) == lowest)))
            rows.append(tuple(row))
    return Grid((table.row_header, *map(method_label, methods)), tuple(rows))


def _method_cells(part: pd.DataFrame, methods: Sequence[str], degrees: str) -> list[Cell]:
    """Return ``ours [published]`` per method; the best, as printed, is marked."""
    values = part.set_index("method")["value"].round(2)
    is_sigma = (part["row"] == published.SIGMA_ROW).all()
    lower = is_sigma or (part["metric"] == "mae").all()
    best = values.min() if lower else values.max()
    cells = []
    for method in methods:
        row = part[part["method"] == method]
        if row.empty or not np.isfinite(values[method]):
            cells.append(Cell("–"))
            continue
        text = f"{number(values[method])}{degrees}"
        printed = float(row["published"].iloc[0])
        beside = f"[{number(printed)}{degrees}]" if np.isfinite(printed) else ""
        cells.append(Cell(text, bool(values[method] == best), beside))
    return cells


def _gap_text(cell: pd.Series) -> str:
    return interval_text(cell["difference"], cell["difference_low"], cell["difference_high"])
