"""The table of error and travel against the number of views."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.object_means import mae_difference, mae_interval, paired_objects
from nbv.experiment.statistics.paired import Resampler
from nbv.labels import category_label, method_label, number


def more_views_table(rows_by_category: Mapping[str, pd.DataFrame], resampler: Resampler) -> Table:
    """Return error and travel against the number of views, by category and policy.

    The rows have `studies.more_views.COLUMNS` and ``fold``. The last column compares a
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
                found = mae_interval(sample, name, resampler)
                made = {"category": category, "method": method, "n_views": n_views}
                made |= found.columns("value", "ci") | {"travel_deg": travel[name]}
                if n_views == 3 and method != "random" and "random@4" in sample.errors_deg:
                    less = mae_difference(sample, name, "random@4", resampler)
                    made |= less.columns("to_random_4")
                    last = difference_cell(less.value, less.low, less.high)
                cells.append(made)
                row.append(Cell(number(found.value), after=f"[{travel[name]:.0f}°]"))
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
