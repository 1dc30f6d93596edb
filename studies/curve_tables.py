"""Tables and plots of errors against the number of views and against travel."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.paired import Resampler
from nbv.files import existing, read_csv
from nbv.labels import category_label, method_label, number
from nbv.style import INK, RC, Panels, method_style, panel_grid
from nbv.tables.next_camera import MOST_VIEWS
from studies.curves import ANY_DIRECTION, pooled_travel
from studies.object_errors import mae_difference, mae_interval, paired_objects
from studies.rotation_tables import NUMBERS, PROBABILITIES

_PRODUCT = "_product"
_PANEL_IN = (3.4, 2.9)


def read_rows(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Read rows by category and fold; return them by category with a column ``fold``."""
    parts: dict[str, list[pd.DataFrame]] = {}
    for (category, fold), path in files.items():
        parts.setdefault(category, []).append(read_csv(existing(path)).assign(fold=fold))
    return {category: pd.concat(frames) for category, frames in parts.items()}


def more_views_table(rows_by_category: Mapping[str, pd.DataFrame], resampler: Resampler) -> Table:
    """Return error and travel against the number of views, by category and policy.

    The rows have `studies.curves.VIEWS_COLUMNS` and ``fold``. The last column compares a
    policy's three views with four at random.
    """
    cells, printed = [], []
    views = sorted({n for rows in rows_by_category.values() for n in rows["n_views"]})
    for category, rows in rows_by_category.items():
        named = rows.assign(method=rows["method"] + "@" + rows["n_views"].astype(str))
        sample = paired_objects(named, category)
        travel = named.groupby("method")["travel_deg"].mean()
        for method in dict.fromkeys(rows["method"]):
            row, last = [Cell(f"{category_label(category)}: {method_label(method)}")], Cell("–")
            for n_views in views:
                name = f"{method}@{n_views}"
                if name not in sample.errors_deg:
                    row.append(Cell("–"))
                    continue
                mae = mae_interval(sample, name, resampler)
                made = {"category": category, "method": method, "n_views": n_views}
                made |= mae.columns("value", "ci") | {"travel_deg": travel[name]}
                if n_views == 3 and method != "random" and "random@4" in sample.errors_deg:
                    less = mae_difference(sample, name, "random@4", resampler)
                    made |= less.columns("to_random_4")
                    last = difference_cell(less.value, less.low, less.high)
                cells.append(made)
                row.append(Cell(number(mae.value), after=f"[{travel[name]:.0f}°]"))
            printed.append((*row, last))
    header = ("Policy", *(f"{n} view{'s' if n > 1 else ''}" for n in views), "3 views − Random's 4")
    notes = (
        f"MAE in degrees [mean travel from view to view]; {_fusions(rows_by_category)}.",
        f"Last column: paired by object, 95 % interval. {DECIDED}",
        "Evenly spaced knows the number of views before the first view; its last one is shown.",
    )
    title = "Error and travel against the number of views"
    return Table("more_views", title, title, pd.DataFrame(cells), header, tuple(printed), notes)


def _fusions(rows_by_category: Mapping[str, pd.DataFrame]) -> str:
    methods = {method for rows in rows_by_category.values() for method in rows["method"]}
    if any(method.endswith("_product") for method in methods):
        return "fused by posterior, or by product where the policy's name says so"
    return "all fused by posterior"


@mpl.rc_context(RC)
def more_views_figure(cells: pd.DataFrame) -> Figure:
    """Draw the cells of `more_views_table`, a panel for each category and fusion."""
    by_product = cells["method"].str.endswith(_PRODUCT)
    drawn = cells.assign(by_product=by_product, policy=cells["method"].str.removesuffix(_PRODUCT))
    policies = tuple(dict.fromkeys(drawn["policy"]))
    parts = list(drawn.groupby(["by_product", "category"], sort=False))
    grid = panel_grid(len(parts), *_PANEL_IN)
    for axes, ((product, category), part) in zip(grid.panels, parts, strict=True):
        for policy, curve in part.groupby("policy", sort=False):
            _draw(axes, curve["n_views"], curve["value"], str(policy), policies)
        fusion = "product" if product else "posterior"
        shown = f" (fused by {fusion})" if by_product.any() else ""
        axes.set_title(category_label(str(category)) + shown)
        axes.set_xticks(sorted(part["n_views"].unique()))
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Number of views")
        axes.set_ylabel("MAE (degrees)")
    _add_key(grid)
    return grid.figure


def travel_curves(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Return error against travel by category, all folds pooled.

    The files, by category and fold, hold rows of `studies.curves.travel_rows`.
    """
    return {
        category: pooled_travel({int(str(fold)): part for fold, part in rows.groupby("fold")})
        for category, rows in read_rows(files).items()
    }


@mpl.rc_context(RC)
def travel_figure(curves: Mapping[str, pd.DataFrame], methods: tuple[str, ...]) -> Figure:
    """Draw error against mean travel as its cost rises, a panel for each of `travel_curves`."""
    grid = panel_grid(len(curves), *_PANEL_IN)
    for axes, (category, rows) in zip(grid.panels, curves.items(), strict=True):
        for method in methods:
            rule = "fixed" if method.startswith(ANY_DIRECTION) else "cost"
            curve = rows[(rows["method"] == method) & (rows["rule"] == rule)]
            curve = curve.sort_values("travel_deg")
            _draw(axes, curve["travel_deg"], curve["error_deg"], method, methods)
        axes.set_title(category_label(category))
        axes.set_xlim(0, 180)
        axes.set_xticks([0, 45, 90, 135, 180])
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Mean travel (degrees)")
        axes.set_ylabel("MAE (degrees)")
    _add_key(grid)
    return grid.figure


def travel_table(curves: Mapping[str, pd.DataFrame]) -> Table:
    """Return `travel_curves` as a table for a CSV file."""
    cells = pd.concat([curve.assign(category=category) for category, curve in curves.items()])
    title = "Error against travel"
    return Table("travel", title, title, cells, header=(), rows=(), decimals=6)


@mpl.rc_context(RC)
def rotation_figure(cells: pd.DataFrame) -> Figure:
    """Draw the cells of `studies.rotation_tables.orientation_table`, a panel for each group."""
    way = cells["method"].str.split("_", expand=True)
    cells = cells.assign(order=way[0], rule=way[1])
    # Two abreast are readable on a telephone.
    grid = panel_grid(cells["group"].nunique(), 2.7, 2.5, abreast=(2,))
    for axes, (group, part) in zip(grid.panels, cells.groupby("group", sort=False), strict=True):
        curves = part.set_index("rule").groupby("order", sort=False)[["n_views", "error_deg"]]
        for order in ("random", "opposite", "recommended"):
            curve = curves.get_group(order)
            fixed = curve[curve.index.isin(NUMBERS)]
            _draw(axes, fixed["n_views"], fixed["error_deg"], order, ("recommended",))
            if order != "opposite":
                stop = curve[curve.index.isin(PROBABILITIES)].sort_values("n_views")
                color = method_style(order, ("recommended",)).color
                label = f"{method_label(order)}, until probable"
                axes.plot(stop["n_views"], stop["error_deg"], ".-", color=color, label=label)
        decision = curves.get_group("recommended").loc[["decision"]]
        mark: Any = {"marker": "*", "markersize": 11, "color": INK, "linestyle": "none"}
        axes.plot(*decision.to_numpy().T, label="Recommended, by decision", zorder=3, **mark)
        axes.set_title(category_label(str(group)))
        axes.set_xticks(range(1, MOST_VIEWS + 1))
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Mean number of views")
        axes.set_ylabel("Mean error (degrees)")
    _add_key(grid)
    return grid.figure


def _draw(axes: Axes, x: pd.Series, y: pd.Series, method: str, methods: tuple[str, ...]) -> None:
    style = method_style(method, methods)
    axes.plot(x, y, label=method_label(method), marker=style.marker, markersize=4, **style.curve)


def _add_key(grid: Panels) -> None:
    named = {
        label: handle
        for axes in grid.panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    grid.add_key(list(named.values()))
