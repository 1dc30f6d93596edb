"""Curves of extensions: error against travel, and against the number of views."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nbv.experiments.travel import ANY_DIRECTION, pooled_travel
from nbv.labels import category_label, method_label
from nbv.reporting.extensions.blocks import rows_by_category
from nbv.reporting.style import RC, method_style, new_figure
from nbv.reporting.table import Table

_COLUMNS = 3
_PRODUCT = "_product"
_BASELINES: Mapping[str, str] = {
    "random": "random",
    "bisecting": "opposite",
    "evenly_spaced": "single",
    f"{ANY_DIRECTION}_average": "single",
    f"{ANY_DIRECTION}_posterior": "opposite",
}


def _draw(axes: Axes, x: pd.Series, y: pd.Series, method: str, methods: tuple[str, ...]) -> None:
    """Draw one curve: baselines in the paper's styles, criteria in the further ones in turn."""
    others = tuple(name for name in methods if name not in _BASELINES)
    style = method_style(_BASELINES.get(method, method), others)
    axes.plot(x, y, label=method_label(method), marker=style.marker, markersize=4, **style.curve)


def _grid(n_panels: int, height_in: float = 2.9) -> tuple[Figure, list[Axes]]:
    n_columns = min(n_panels, _COLUMNS)
    n_rows = -(-n_panels // n_columns)
    figure = new_figure(3.4 * n_columns + 0.4, height_in * n_rows + 0.9)
    panels = figure.subplots(n_rows, n_columns, squeeze=False).ravel().tolist()
    for spare in panels[n_panels:]:
        spare.set_visible(False)
    return figure, panels[:n_panels]


def _legend(figure: Figure, panels: list[Axes]) -> None:
    """Write the legend below, as wide as the panels are and as high as it has to be."""
    named = {
        label: handle
        for axes in panels
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    labels, handles = list(named), list(named.values())
    n_columns = min(len(panels), _COLUMNS) + 1
    figure.set_figheight(figure.get_figheight() + 0.2 * (-(-len(labels) // n_columns) - 2))
    figure.legend(handles, labels, loc="outside lower center", ncols=n_columns)


@mpl.rc_context(RC)
def more_views_figure(cells: pd.DataFrame) -> Figure:
    """Draw the cells of `more_views.more_views_table`, a panel for each category and fusion."""
    by_product = cells["method"].str.endswith(_PRODUCT)
    drawn = cells.assign(by_product=by_product, policy=cells["method"].str.removesuffix(_PRODUCT))
    policies = tuple(dict.fromkeys(drawn["policy"]))
    parts = list(drawn.groupby(["by_product", "category"], sort=False))
    figure, panels = _grid(len(parts))
    for axes, ((product, category), part) in zip(panels, parts, strict=True):
        for policy, curve in part.groupby("policy", sort=False):
            _draw(axes, curve["n_views"], curve["value"], str(policy), policies)
        fusion = "product" if product else "posterior"
        shown = f" (fused by {fusion})" if by_product.any() else ""
        axes.set_title(category_label(str(category)) + shown)
        axes.set_xticks(sorted(part["n_views"].unique()))
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Number of views")
        axes.set_ylabel("MAE (°)")
    _legend(figure, panels)
    return figure


def travel_curves(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Return error against travel by category, all folds pooled.

    The files, by category and fold, hold rows of `nbv.experiments.travel.travel_rows`.
    """
    return {
        category: pooled_travel({int(str(fold)): part for fold, part in rows.groupby("fold")})
        for category, rows in rows_by_category(files).items()
    }


@mpl.rc_context(RC)
def travel_figure(curves: Mapping[str, pd.DataFrame], methods: tuple[str, ...]) -> Figure:
    """Draw error against mean travel as its cost rises, a panel for each of `travel_curves`."""
    figure, panels = _grid(len(curves))
    for axes, (category, rows) in zip(panels, curves.items(), strict=True):
        for method in methods:
            rule = "fixed" if method in _BASELINES else "cost"
            curve = rows[(rows["method"] == method) & (rows["rule"] == rule)]
            curve = curve.sort_values("travel_deg")
            _draw(axes, curve["travel_deg"], curve["error_deg"], method, methods)
        axes.set_title(category_label(category))
        axes.set_xlim(0, 180)
        axes.set_xticks([0, 45, 90, 135, 180])
        axes.set_ylim(bottom=0)
        axes.set_xlabel("Mean travel (°)")
        axes.set_ylabel("MAE (°)")
    _legend(figure, panels)
    return figure


def travel_table(curves: Mapping[str, pd.DataFrame]) -> Table:
    """Return `travel_curves` as a table that has a CSV file only."""
    cells = pd.concat([curve.assign(category=category) for category, curve in curves.items()])
    title = "Error against travel"
    return Table("travel", title, title, cells, header=(), rows=(), decimals=6)
