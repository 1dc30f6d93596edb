"""The paper's Tables 1 to 7 from our results, tidy: one row per cell.

Columns of `cells.Table.cells`: ``table, row, row_label, method, metric, value, sigma, published,
ci_low, ci_high, difference, difference_low, difference_high, n_objects, n_images``.

``value`` is in degrees (``mae``, ``estimate``, ``error``) or percent (``pauc``), pooled over the
images of all folds; ``sigma`` is the sample standard deviation of the cell's figure per fold;
``ci_*`` its 95 % interval over objects; ``difference*`` the paired difference to the reference
method (Opposite, unless set otherwise).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd

from nbv.errors import UserError, nearest
from nbv.experiments.results import Unit
from nbv.labels import category_label
from nbv.paper import published
from nbv.reporting.paper.cells import Table, assemble, cell, method_cells, shared_resampler
from nbv.reporting.paper.examples import choose_example, example_row
from nbv.reporting.settings import (
    ReportSettings,
    common_elevation_deg,
    focus_category,
    focus_unit,
    reference_units,
    unit_label,
)
from nbv.statistics import paired
from nbv.statistics.paired import pair_methods

Evaluations = Mapping[Unit, pd.DataFrame]


def build_table(
    name: str, evaluations: Evaluations, settings: ReportSettings | None = None
) -> Table:
    """Build one of the paper's tables from whatever of it was run.

    Parameters
    ----------
    name : str
        ``table1`` to ``table7``.
    evaluations : mapping of (category, elevation_deg) to pandas.DataFrame
        Frames of `results.load_unit`. Tables have rows for what is present only.
    settings : ReportSettings, optional
        Defaults are the paper's.

    Raises
    ------
    UserError
        If there is no such table, or nothing was evaluated.
    """
    if name not in _BUILDERS:
        raise UserError(f"no table {name!r}; {nearest(name, _BUILDERS)}")
    chosen = settings or ReportSettings()
    if not evaluations:
        raise UserError(f"{name}: no evaluated category and elevation; run the workflow first")
    return _BUILDERS[name](name, evaluations, chosen)


def _by_category(name: str, evaluations: Evaluations, settings: ReportSettings) -> Table:
    metric = "mae" if name == "table1" else "pauc"
    units = reference_units(evaluations, settings)
    elevation = common_elevation_deg(units, settings)
    resampler = shared_resampler(settings)
    cells = []
    for unit in units:
        sample = pair_methods(evaluations[unit], unit[0])
        label = unit_label(unit, elevation)
        cells += method_cells(
            name, unit[0], label, metric, sample, resampler, settings, unit[1] == 0
        )
    title = f"{_METRIC_TITLES[metric]} by category at elevation {elevation}°"
    return assemble(name, title, "Category", cells, settings)


def _by_elevation(name: str, evaluations: Evaluations, settings: ReportSettings) -> Table:
    metric = "mae" if name == "table2" else "pauc"
    category = focus_category(evaluations, settings)
    resampler = shared_resampler(settings)
    cells = []
    for elevation in sorted(elevation for name_, elevation in evaluations if name_ == category):
        sample = pair_methods(evaluations[category, elevation], category)
        cells += method_cells(
            name,
            str(elevation),
            f"{elevation}°",
            metric,
            sample,
            resampler,
            settings,
            category == published.FOCUS_CATEGORY,
        )
    title = f"{_METRIC_TITLES[metric]} of {category_label(category)} by elevation"
    return assemble(name, title, "Elevation", cells, settings)


def _by_group(name: str, evaluations: Evaluations, settings: ReportSettings) -> Table:
    category, elevation = focus_unit(evaluations, settings)
    resampler = shared_resampler(settings)
    everything = pair_methods(evaluations[category, elevation], category)
    groups = paired.viewpoint_group(everything.initial_deg)
    cells = []
    for group, (start, stop) in paired.VIEWPOINT_GROUPS.items():
        mask = groups == group
        if not mask.any():
            continue
        span = f"{start}–359°, 0–{stop - 1}°" if start > stop else f"{start}–{stop - 1}°"
        cells += method_cells(
            name,
            str(group),
            f"{group} ({span})",
            "mae",
            everything.select(mask),
            resampler,
            settings,
            (category, elevation) == (published.FOCUS_CATEGORY, 0),
        )
    title = f"MAE of {category_label(category)} by viewpoint group at elevation {elevation}°"
    return assemble(name, title, "Viewpoint group", cells, settings)


def _examples(name: str, evaluations: Evaluations, settings: ReportSettings) -> Table:
    unit = focus_unit(evaluations, settings)
    frame = evaluations[unit]
    example = choose_example(frame, settings)
    comparable = unit == (published.FOCUS_CATEGORY, 0)
    cells = []
    for azimuth in settings.example_initial_deg:
        for method in settings.methods:
            row = example_row(frame, example, method, azimuth)
            if row is None:
                continue
            for metric, column in (("estimate", "pose_estimate_deg"), ("error", "error_deg")):
                printed = published.published_value(name, metric, str(azimuth), method)
                cells.append(
                    cell(
                        name,
                        str(azimuth),
                        f"{azimuth}°",
                        method=method,
                        metric=metric,
                        value=float(row[column]),
                        published=np.nan if printed is None or not comparable else printed,
                        n_objects=1,
                        n_images=1,
                    )
                )
    title = (
        f"Examples of estimates (and errors) for {category_label(unit[0])} at elevation {unit[1]}°"
    )
    note = f"Object {example.object_id} of fold {example.fold}: {example.reason}."
    return assemble(name, title, "Initial azimuth", cells, settings, note)


def _by_fold(name: str, evaluations: Evaluations, settings: ReportSettings) -> Table:
    category, elevation = focus_unit(evaluations, settings)
    resampler = shared_resampler(settings)
    everything = pair_methods(evaluations[category, elevation], category)
    comparable = (category, elevation) == (published.FOCUS_CATEGORY, 0)
    rows = [
        (str(fold), f"Fold {fold}", everything.select(everything.folds == fold))
        for fold in np.unique(everything.folds)
    ]
    rows.append((published.AVERAGE_ROW, "Average", everything))
    cells = []
    for metric in ("mae", "pauc"):
        for row, label, sample in rows:
            cells += method_cells(name, row, label, metric, sample, resampler, settings, comparable)
        cells += [
            found | {"metric": metric}
            for found in method_cells(
                name,
                published.SIGMA_ROW,
                "σ",
                f"{metric}_sigma",
                everything,
                resampler,
                settings,
                comparable=False,
            )
        ]
    for one in cells:
        if one["row"] == published.SIGMA_ROW:
            one["sigma"] = np.nan
            printed = published.published_value(name, one["metric"], one["row"], one["method"])
            one["published"] = np.nan if printed is None or not comparable else printed
    title = f"MAE and pAUC of {category_label(category)} by fold at elevation {elevation}°"
    note = "The average is over the pooled images of all folds."
    return assemble(name, title, "Fold", cells, settings, note)


_METRIC_TITLES: Mapping[str, str] = {"mae": "MAE", "pauc": "pAUC"}

_BUILDERS: Mapping[str, Callable[[str, Evaluations, ReportSettings], Table]] = {
    "table1": _by_category,
    "table2": _by_elevation,
    "table3": _by_category,
    "table4": _by_elevation,
    "table5": _by_group,
    "table6": _examples,
    "table7": _by_fold,
}

TABLES = tuple(_BUILDERS)
"""Names of the tables that `build_table` knows."""
