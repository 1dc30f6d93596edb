"""The paper's Tables 1 to 7 from our results, laid out as in the paper.

Their CSV files are tidy, one row per cell; see `nbv.experiment.report.settings` for the columns.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from nbv.core.angles import circular_distance_deg
from nbv.errors import UserError, nearest
from nbv.experiment.paper import published
from nbv.experiment.paper.statements import VERDICT_RULES, by_run
from nbv.experiment.report import layout
from nbv.experiment.report.layout import METRIC_TITLES, Body
from nbv.experiment.report.settings import (
    CELL_COLUMNS,
    ReportSettings,
    cell,
    common_elevation_deg,
    focus_category,
    focus_unit,
    method_cells,
    reference_units,
    shared_resampler,
    unit_label,
)
from nbv.experiment.report.table import Cell, Part, Row, Table
from nbv.experiment.results import Unit
from nbv.experiment.statistics import paired
from nbv.experiment.statistics.paired import PairedErrors, pair_methods
from nbv.labels import category_label, method_label

_BASELINE = "single"
_SMOOTHING_DEG = 15.0


@dataclass(frozen=True)
class Example:
    """One test object, the fold that tested it, and why it was taken."""

    object_id: str
    fold: int
    reason: str


def choose_example(frame: pd.DataFrame, settings: ReportSettings) -> Example:
    """Return the test object with the median single-view error in the example fold.

    The lower median where their number is even; the first by name where errors tie. The middle
    object is neither the easiest nor the hardest, and no choice by the result of the method
    that the example is to show.

    Parameters
    ----------
    frame : pandas.DataFrame
        One unit, from `results.load_evaluations`.
    settings : ReportSettings
        Gives the fold.
    """
    folds = sorted(frame["fold"].unique())
    fold = int(settings.example_fold if settings.example_fold in folds else folds[0])
    in_fold = frame[frame["fold"] == fold]
    method = _baseline(in_fold)
    errors = in_fold[in_fold["method"] == method].groupby("object_id")["error_deg"].mean()
    ordered = errors.sort_index().sort_values(kind="stable")
    chosen = str(ordered.index[(len(ordered) - 1) // 2])
    reason = (
        f"the one with the median {method_label(method)} error of that fold's {len(ordered)} test "
        "objects"
    )
    return Example(chosen, fold, reason)


def example_row(
    frame: pd.DataFrame, example: Example, method: str, azimuth_deg: float
) -> pd.Series | None:
    """Return the evaluation of one method on the example, or None where it was not made."""
    rows = frame[
        (frame["method"] == method)
        & (frame["object_id"] == example.object_id)
        & (frame["fold"] == example.fold)
        & (frame["initial_deg"] == azimuth_deg)
    ]
    return None if rows.empty else rows.iloc[0]


def hardest_azimuth_deg(frame: pd.DataFrame) -> int:
    """Return the initial azimuth around which the single-view error is largest.

    The mean over objects, then over 31 degrees, so that one odd view does not decide; where the
    category hides what tells its pose, that is the middle of the hidden range.
    """
    single = frame[frame["method"] == _baseline(frame)]
    by_azimuth = single.groupby("initial_deg")["error_deg"].mean()
    azimuths = by_azimuth.index.to_numpy(dtype=np.float64)
    near = circular_distance_deg(azimuths[:, None], azimuths[None, :]) <= _SMOOTHING_DEG
    smooth = (near @ by_azimuth.to_numpy(dtype=np.float64)) / near.sum(axis=1)
    return int(azimuths[int(np.argmax(smooth))])


def _baseline(frame: pd.DataFrame) -> str:
    present = list(frame["method"].astype(str).unique())
    return _BASELINE if _BASELINE in present else present[0]


def claims_table(claims: pd.DataFrame) -> Table:
    """Return one row per claim: sentence, verdicts, our figures, and the paper's own.

    Those that were not run come last, under a heading of their own. The CSV file is what
    `nbv.experiment.paper.verdicts.evaluate_claims` returned: a row for each comparison.
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
    """Build one of `TABLES` from whatever of it was run; the default settings are the paper's.

    Raises
    ------
    UserError
        If there is no such table, or nothing was evaluated.
    """
    if name not in _KINDS:
        raise UserError(f"no table {name!r}; {nearest(name, _KINDS)}")
    if not evaluations:
        raise UserError(f"{name}: no evaluated category and elevation; run the workflow first")
    kind, chosen = _KINDS[name], settings or ReportSettings()
    made = kind.measure(name, evaluations, chosen)
    cells = pd.DataFrame(made.cells, columns=list(CELL_COLUMNS))
    header, rows = kind.body(cells, chosen)
    return Table(
        name,
        f"Table {name.removeprefix('table')}: {made.title}",
        made.title,
        cells,
        (made.row_title, *header),
        tuple(rows),
        (*made.notes, *kind.notes(cells, chosen), *layout.published_notes(name, cells)),
    )


@dataclass(frozen=True)
class _Measured:
    """The figures of a table, and the words that depend on what was evaluated."""

    title: str
    row_title: str
    cells: list[dict[str, Any]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Kind:
    """How a table is measured and laid out."""

    measure: Callable[[str, Evaluations, ReportSettings], _Measured]
    body: Callable[[pd.DataFrame, ReportSettings], Body] = layout.comparison_body
    notes: Callable[[pd.DataFrame, ReportSettings], Iterable[str]] = layout.comparison_notes


def _by_category(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    metric = "mae" if name == "table1" else "pauc"
    units = reference_units(evaluations, settings)
    elevation = common_elevation_deg(units, settings)
    resampler = shared_resampler(settings)
    cells = []
    for unit in units:
        sample = pair_methods(evaluations[unit], unit[0])
        label = unit_label(unit, elevation)
        for shown in (metric, layout.HALF_TURNS):
            made = method_cells(name, unit[0], label, shown, sample, resampler, settings)
            cells += _with_published(made) if unit[1] == 0 else made
    title = f"{METRIC_TITLES[metric]} by category at elevation {elevation}°"
    return _Measured(title, "Category", cells)


def _by_elevation(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    metric = "mae" if name == "table2" else "pauc"
    category = focus_category(evaluations, settings)
    resampler = shared_resampler(settings)
    cells = []
    for elevation in sorted(degrees for one, degrees in evaluations if one == category):
        sample = pair_methods(evaluations[category, elevation], category)
        row = str(elevation), f"{elevation}°"
        for shown in (metric, layout.HALF_TURNS):
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
            for shown in ("mae", layout.HALF_TURNS):
                cells += method_cells(name, *row, shown, sample, resampler, settings)
    title = f"MAE of {_of_focus(unit, 'by viewpoint group')}"
    return _Measured(title, "Viewpoint group", _published_of_focus(unit, cells))


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
        cells += [found | {"metric": metric} for found in made]
    title = f"MAE and pAUC of {_of_focus(unit, 'by fold')}"
    return _Measured(title, "Fold", _published_of_focus(unit, cells))


def _examples(name: str, evaluations: Evaluations, settings: ReportSettings) -> _Measured:
    unit = focus_unit(evaluations, settings)
    frame = evaluations[unit]
    example = choose_example(frame, settings)
    cells = []
    for azimuth in settings.example_initial_deg:
        for method in settings.methods:
            found = example_row(frame, example, method, azimuth)
            if found is None:
                continue
            shared = {"method": method, "n_objects": 1, "n_images": 1}
            for metric, column in (("estimate", "pose_estimate_deg"), ("error", "error_deg")):
                figure = {"metric": metric, "value": float(found[column])}
                cells.append(cell(name, str(azimuth), f"{azimuth}°", **shared, **figure))
    title = f"Examples of estimates (and errors) for {_of_focus(unit)}"
    note = f"Object {example.object_id} of fold {example.fold}: {example.reason}."
    return _Measured(title, "Initial azimuth", _published_of_focus(unit, cells), (note,))


def _focus_sample(evaluations: Evaluations, settings: ReportSettings) -> tuple[Unit, PairedErrors]:
    unit = focus_unit(evaluations, settings)
    return unit, pair_methods(evaluations[unit], unit[0])


def _of_focus(unit: Unit, by: str = "") -> str:
    return f"{category_label(unit[0])} {by}".rstrip() + f" at elevation {unit[1]}°"


def _published_of_focus(unit: Unit, cells: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Add what the paper prints, which is about one category at elevation 0° alone."""
    return _with_published(cells) if unit == (published.FOCUS_CATEGORY, 0) else cells


def _with_published(cells: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return cells with what the paper prints in the same place."""
    place = ("table", "metric", "row", "method")
    return [
        one | {"published": published.published_value(*(one[key] for key in place))}
        for one in cells
    ]


_KINDS: Mapping[str, _Kind] = {
    "table1": _Kind(_by_category),
    "table2": _Kind(_by_elevation),
    "table3": _Kind(_by_category),
    "table4": _Kind(_by_elevation),
    "table5": _Kind(_by_group),
    "table6": _Kind(_examples, layout.example_body, lambda *_: ()),
    "table7": _Kind(_by_fold, layout.fold_body, layout.fold_notes),
}

TABLES = tuple(_KINDS)
"""Names of the tables that `build_table` knows."""
