"""The paper's Tables 1 to 7 from our results, laid out as in the paper.

A cell shows ``ours [published]``, the best method of a row in bold. Tables 1 to 5 close with the
paired difference to the reference method and its interval, so that a difference can be told from
noise without another table. Below, the same rows show the share of errors above 90°; a note names
those where it is 0 for all methods. The CSV files
are tidy, one row per cell; see `nbv.experiment.report.settings` for the columns.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from nbv.errors import UserError, nearest
from nbv.experiment.paper import published
from nbv.experiment.paper.published import NOTES, SIGMA_ROW, Note
from nbv.experiment.paper.statements import VERDICT_RULES, by_run
from nbv.experiment.report.settings import (
    CELL_COLUMNS,
    EXAMPLE_INITIAL_DEG,
    SUBJECT,
    ReportSettings,
    cell,
    choose_example,
    common_elevation_deg,
    example_row,
    focus_category,
    focus_unit,
    method_cells,
    reference_units,
    shared_resampler,
    unit_label,
)
from nbv.experiment.report.table import DECIDED, Cell, Part, Row, Table, difference_cell
from nbv.experiment.results import Unit
from nbv.experiment.statistics import paired
from nbv.experiment.statistics.paired import LOWER_IS_BETTER, UNIT_OF, PairedErrors, pair_methods
from nbv.labels import MINUS, category_label, method_label, number

Body = tuple[list[str], list[Row]]
"""The titles of the columns after the first, and the rows."""

METRIC_TITLES = {"mae": "MAE", "pauc": "pAUC"}
ABOVE_90 = "above_90_percent"


def comparison_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Return rows by methods, then the difference of subject and reference (Tables 1 to 5)."""
    methods = _methods(cells)
    differs = _shows_difference(cells, settings)
    rows = []
    in_blocks = cells.sort_values("metric", key=lambda names: names == ABOVE_90, kind="stable")
    for (metric, label), part in in_blocks.groupby(["metric", "row_label"], sort=False):
        title = f"{label}: errors above 90°" if metric == ABOVE_90 else str(label)
        if metric == ABOVE_90 and not part["value"].any():
            continue
        row = [Cell(title), *_values(part, methods)]
        if differs:
            subject = part[part["method"] == SUBJECT].iloc[0]
            ends = subject["difference_low"], subject["difference_high"]
            row.append(difference_cell(subject["difference"], *ends))
        rows.append(tuple(row))
    titles = [method_label(method) for method in methods]
    return titles + ([_difference_title(settings)] if differs else []), rows


def fold_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Return folds by methods, with MAE and pAUC for each method (Table 7)."""
    methods = _methods(cells)
    rows = []
    for label, part in cells.groupby("row_label", sort=False):
        by_metric = [part[part["metric"] == metric] for metric in METRIC_TITLES]
        columns = [_values(part, methods) for part in by_metric]
        pairs = zip(*columns, strict=True)
        rows.append((Cell(str(label)), *(cell for pair in pairs for cell in pair)))
    titles = METRIC_TITLES.values()
    return [f"{method_label(method)} {title}" for method in methods for title in titles], rows


def example_body(cells: pd.DataFrame, settings: ReportSettings) -> Body:
    """Return our and the published example, different objects, in pairs of rows (Table 6)."""
    methods = _methods(cells)
    rows: list[Row] = []
    for label, part in cells.groupby("row_label", sort=False):
        errors = part[part["metric"] == "error"].set_index("method")
        estimates = part[part["metric"] == "estimate"].set_index("method")
        for column, suffix in (("value", ""), ("published", ", published")):
            present = errors[column].reindex(methods)
            if present.notna().any():
                shown = _example_cells(estimates[column].reindex(methods), present)
                rows.append((Cell(f"{label}{suffix}"), *shown))
    return [method_label(method) for method in methods], rows


def comparison_notes(cells: pd.DataFrame, settings: ReportSettings) -> Iterator[str]:
    """Yield notes on the cells, the number of objects, and the difference."""
    yield _legend(cells)
    objects = cells.groupby("row_label", sort=False)["n_objects"].max()
    if objects.min() == objects.max():
        yield f"{_counts(cells)} in each row."
    else:
        yield f"Test objects: {', '.join(f'{row} {int(n)}' for row, n in objects.items())}."
    shares = cells[cells["metric"] == ABOVE_90].groupby("row_label", sort=False)["value"].max()
    if (shares == 0).all():
        yield "No error is above 90°."
    elif (shares == 0).any():
        yield f"Without an error above 90°: {', '.join(shares.index[shares == 0])}."
    if _shows_difference(cells, settings):
        yield (
            f"{_difference_title(settings)} is the paired difference with its 95 % interval over "
            f"objects ({settings.n_resamples} resamples). {DECIDED}"
        )


def fold_notes(cells: pd.DataFrame, settings: ReportSettings) -> Iterator[str]:
    """Yield notes on the cells and the number of objects in all folds."""
    yield _legend(cells)
    yield f"{_counts(cells)}."
    yield "The average is over the pooled images of all folds."


def published_notes(name: str, cells: pd.DataFrame) -> list[str]:
    """Return the notes on the published numbers that a table shows."""
    return [note.text for note in NOTES if name in note.tables and _explains(note, cells)]


def _methods(cells: pd.DataFrame) -> list[str]:
    return list(dict.fromkeys(cells["method"]))


def _values(row: pd.DataFrame, methods: list[str]) -> list[Cell]:
    """Return ``ours [published]`` per method; the best of the row, as rounded, is bold."""
    by_method = row.set_index("method").reindex(methods)
    values = by_method["value"].round(2)
    (metric,) = row["metric"].unique()
    unit = "" if metric == "pauc" else UNIT_OF[metric]
    lower_is_better = LOWER_IS_BETTER[metric] or (row["row"] == SIGMA_ROW).all()
    best = values.min() if lower_is_better else values.max()
    cells = []
    for value, printed in zip(values, by_method["published"], strict=True):
        if np.isfinite(value):
            after = f"[{number(printed)}{unit}]" if np.isfinite(printed) else ""
            cells.append(Cell(f"{number(value)}{unit}", bool(value == best), after))
        else:
            cells.append(Cell("–"))
    return cells


def _example_cells(estimates: pd.Series, errors: pd.Series) -> Iterator[Cell]:
    """Yield ``estimate (error)`` per method; the least error, as rounded, is bold."""
    least = errors.round(1).min()
    for estimate, error in zip(estimates, errors, strict=True):
        if np.isfinite(error):
            shown = number(round(estimate, 1) % 360, 1)  # 359.96 is shown as 0.0, not as 360.0
            yield Cell(f"{shown}° ({number(error, 1)}°)", bool(round(error, 1) == least))
        else:
            yield Cell("–")


def _shows_difference(cells: pd.DataFrame, settings: ReportSettings) -> bool:
    return {SUBJECT, settings.reference} <= set(cells["method"])


def _difference_title(settings: ReportSettings) -> str:
    return f"{method_label(SUBJECT)} {MINUS} {method_label(settings.reference)}"


def _legend(cells: pd.DataFrame) -> str:
    if cells["published"].notna().any():
        return "Ours [published]; our best of each row in bold."
    return "The best of each row in bold; the paper prints no such figures."


def _counts(cells: pd.DataFrame) -> str:
    objects, images = int(cells["n_objects"].max()), int(cells["n_images"].max())
    return f"{objects} test objects, {images:,} initial views"


def _explains(note: Note, cells: pd.DataFrame) -> bool:
    """Return whether the note explains a number among the cells."""
    explained = pd.Series(True, index=cells.index) if note.ours else cells["published"].notna()
    if note.metric:
        explained &= cells["metric"] == note.metric
    if note.rows:
        explained &= cells["row"].isin(note.rows)
    if note.method:
        explained &= cells["method"] == note.method
    return bool(explained.any())


def claims_table(claims: pd.DataFrame) -> Table:
    """Return one row per claim: sentence, verdicts, our numbers, and the paper's own.

    Claims that were not run come last, under a heading. The CSV file has a row for each comparison,
    from `nbv.experiment.paper.verdicts.evaluate_claims`.
    """
    header = (
        "Section",
        "The paper says",
        "What is compared",
        "Verdict",
        "By point estimates",
        "Our figures",
        "The paper's own figures",
    )
    run, not_run = (tuple(map(_row, part.to_dict("records"))) for part in by_run(claims))
    parts = (Part(run), Part(not_run, "Not run"))
    title, n_text = "The paper's claims", len(header)
    return Table(
        "claims", title, title, claims, header, parts, VERDICT_RULES, n_text_columns=n_text
    )


def _row(claim: Mapping[Hashable, Any]) -> Row:
    note = f" ({claim['note']})" if claim["note"] else ""
    return (
        Cell(str(claim["section"])),
        Cell(claim["sentence"]),
        Cell(f"{claim['compared']}{note}"),
        Cell(claim["verdict"]),
        Cell(claim["point_verdict"]),
        Cell(claim["summary"] or "–"),
        Cell(claim["published_verdict"]),
    )


Evaluations = Mapping[Unit, pd.DataFrame]
"""Frames of `results.load_evaluations` by category and elevation."""


def build_table(
    name: str, evaluations: Evaluations, settings: ReportSettings | None = None
) -> Table:
    """Build one of `TABLES` from the units that were run; the default settings are the paper's.

    Raises
    ------
    UserError
        If the table is unknown, or nothing was evaluated.
    """
    if name not in _KINDS:
        raise UserError(f"no table {name!r}; {nearest(name, _KINDS)}")
    if not evaluations:
        raise UserError(f"{name}: no evaluated category and elevation; run the workflow first")
    kind, chosen = _KINDS[name], settings or ReportSettings()
    made = kind.measure(name, evaluations, chosen)
    cells = pd.DataFrame(made.cells, columns=list(CELL_COLUMNS))
    header, rows = kind.body(cells, chosen)
    subject = method_label(SUBJECT)
    return Table(
        name,
        f"Table {name.removeprefix('table')}: {made.title}",
        made.title,
        cells,
        (made.row_title, *header),
        tuple(rows),
        (*made.notes, *kind.notes(cells, chosen), *published_notes(name, cells)),
        in_sight=next((i for i, title in enumerate(header, 1) if title.startswith(subject)), None),
    )


@dataclass(frozen=True)
class _Measured:
    """The cells of a table, and the texts that depend on them."""

    title: str
    row_title: str
    cells: list[dict[str, Any]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Kind:
    """The functions that measure and lay out a table."""

    measure: Callable[[str, Evaluations, ReportSettings], _Measured]
    body: Callable[[pd.DataFrame, ReportSettings], Body] = comparison_body
    notes: Callable[[pd.DataFrame, ReportSettings], Iterable[str]] = comparison_notes


def _by_category(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    metric = "mae" if name == "table1" else "pauc"
    units = reference_units(evaluations)
    elevation = common_elevation_deg(units)
    resampler = shared_resampler(settings)
    cells = []
    for unit in units:
        sample = pair_methods(evaluations[unit], unit[0])
        label = unit_label(unit, elevation)
        for shown in (metric, ABOVE_90):
            made = method_cells(name, unit[0], label, shown, sample, resampler, settings)
            cells += _with_published(made) if unit[1] == 0 else made
    title = f"{METRIC_TITLES[metric]} by category at elevation {elevation}°"
    return _Measured(title, "Category", cells)


def _by_elevation(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    metric = "mae" if name == "table2" else "pauc"
    category = focus_category(evaluations, settings.focus_category)
    resampler = shared_resampler(settings)
    cells = []
    for elevation in sorted(degrees for other, degrees in evaluations if other == category):
        sample = pair_methods(evaluations[category, elevation], category)
        row = str(elevation), f"{elevation}°"
        for shown in (metric, ABOVE_90):
            cells += method_cells(name, *row, shown, sample, resampler, settings)
    if category == published.FOCUS_CATEGORY:
        cells = _with_published(cells)
    title = f"{METRIC_TITLES[metric]} of {category_label(category)} by elevation"
    return _Measured(title, "Elevation", cells)


def _by_group(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    unit, everything = _focus_sample(evaluations, settings)
    resampler = shared_resampler(settings)
    groups = paired.viewpoint_group(everything.initial_deg)
    cells = []
    for group, (start, stop) in paired.VIEWPOINT_GROUPS.items():
        if (groups == group).any():
            span = f"{start}–359°, 0–{stop - 1}°" if start > stop else f"{start}–{stop - 1}°"
            sample = everything.select(groups == group)
            row = str(group), f"{group} ({span})"
            for shown in ("mae", ABOVE_90):
                cells += method_cells(name, *row, shown, sample, resampler, settings)
    title = f"MAE of {_focus_title(unit, 'by viewpoint group')}"
    return _Measured(title, "Viewpoint group", _with_published_focus(unit, cells))


def _by_fold(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    unit, everything = _focus_sample(evaluations, settings)
    resampler = shared_resampler(settings)
    rows = [
        (str(fold), f"Fold {fold}", everything.select(everything.folds == fold))
        for fold in np.unique(everything.folds)
    ]
    rows.append((published.AVERAGE_ROW, "Average", everything))
    cells = []
    for metric in METRIC_TITLES:
        for row, label, sample in rows:
            cells += method_cells(name, row, label, metric, sample, resampler, settings)
        over_folds = name, published.SIGMA_ROW, "σ", f"{metric}_sigma"
        made = method_cells(*over_folds, everything, resampler, settings)
        cells += [record | {"metric": metric} for record in made]
    title = f"MAE and pAUC of {_focus_title(unit, 'by fold')}"
    return _Measured(title, "Fold", _with_published_focus(unit, cells))


def _examples(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    unit = focus_unit(evaluations, settings.focus_category)
    frame = evaluations[unit]
    example = choose_example(frame)
    cells = []
    for azimuth in EXAMPLE_INITIAL_DEG:
        for method in settings.methods:
            outcome = example_row(frame, example, method, azimuth)
            if outcome is None:
                continue
            shared = {"method": method, "n_objects": 1, "n_images": 1}
            for metric, column in (("estimate", "pose_estimate_deg"), ("error", "error_deg")):
                figure = {"metric": metric, "value": float(outcome[column])}
                cells.append(cell(name, str(azimuth), f"{azimuth}°", **shared, **figure))
    title = f"Examples of estimates (and errors) for {_focus_title(unit)}"
    note = f"Object {example.object_id} of fold {example.fold}: {example.reason}."
    return _Measured(title, "Initial azimuth", _with_published_focus(unit, cells), (note,))


def _focus_sample(evaluations: Evaluations, settings: ReportSettings) -> tuple[Unit, PairedErrors]:
    unit = focus_unit(evaluations, settings.focus_category)
    return unit, pair_methods(evaluations[unit], unit[0])


def _focus_title(unit: Unit, by: str = "") -> str:
    return f"{category_label(unit[0])} {by}".rstrip() + f" at elevation {unit[1]}°"


def _with_published_focus(unit: Unit, cells: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Add the published values, which exist for one category at elevation 0° only."""
    return _with_published(cells) if unit == (published.FOCUS_CATEGORY, 0) else cells


def _with_published(cells: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return cells with the published values of the same cells."""
    key = ("table", "metric", "row", "method")
    return [
        record | {"published": published.published_value(*(record[column] for column in key))}
        for record in cells
    ]


_KINDS: Mapping[str, _Kind] = {
    "table1": _Kind(_by_category),
    "table2": _Kind(_by_elevation),
    "table3": _Kind(_by_category),
    "table4": _Kind(_by_elevation),
    "table5": _Kind(_by_group),
    "table6": _Kind(_examples, example_body, lambda *_: ()),
    "table7": _Kind(_by_fold, fold_body, fold_notes),
}

TABLES = tuple(_KINDS)
"""The names of the tables of `build_table`."""
