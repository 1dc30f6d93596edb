"""Curves of extensions: error against travel, and against the number of views."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nbv.experiment.report.table import Table
from nbv.labels import category_label, method_label
from nbv.robot.style import RC, Panels, method_style, panel_grid
from studies.blocks import rows_by_category
from studies.travel import ANY_DIRECTION, pooled_travel

_PRODUCT = "_product"
_PANEL_IN = (3.4, 2.9)


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


@mpl.rc_context(RC)
def more_views_figure(cells: pd.DataFrame) -> Figure:
    """Draw the cells of `more_views.more_views_table`, a panel for each category and fusion."""
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

    The files, by category and fold, hold rows of `studies.travel.travel_rows`.
    """
    return {
        category: pooled_travel({int(str(fold)): part for fold, part in rows.groupby("fold")})
        for category, rows in rows_by_category(files).items()
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
    """Return `travel_curves` as a table that has a CSV file only."""
    cells = pd.concat([curve.assign(category=category) for category, curve in curves.items()])
    title = "Error against travel"
    return Table("travel", title, title, cells, header=(), rows=(), decimals=6)
