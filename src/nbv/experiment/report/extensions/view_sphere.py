"""The table of second views from anywhere on the view sphere."""

from __future__ import annotations

import pandas as pd

from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.object_means import mae_difference, mae_interval, paired_objects
from nbv.experiment.statistics.paired import Resampler
from nbv.labels import category_label, method_label, number


def view_sphere_table(rows: pd.DataFrame, category: str, resampler: Resampler) -> Table:
    """Return what choosing the elevation with the rotation gains, by the first elevation.

    The rows have `nbv.experiment.view_sphere.COLUMNS` and ``fold``.
    """
    cells, printed = [], []
    criteria = [m.removesuffix("_sphere") for m in rows["method"].unique() if "_sphere" in m]
    for elevation, part in rows.groupby("elevation_deg"):
        sample = paired_objects(part, category)
        means = part.groupby("method")[["travel_deg", "next_elevation_deg"]].mean()
        found = {name: mae_interval(sample, name, resampler) for name in sample.errors_deg}
        for method, interval in found.items():
            place = {"category": category, "elevation_deg": elevation, "method": method}
            cells.append(place | interval.columns("value", "ci") | means.loc[method].to_dict())
        row = [Cell(f"{elevation}°"), Cell(number(found["opposite"].value))]
        for criterion in criteria:
            circle, sphere = f"{criterion}_circle", f"{criterion}_sphere"
            row.append(Cell(f"{number(found[circle].value)} → {number(found[sphere].value)}"))
            less = mae_difference(sample, sphere, circle, resampler)
            row.append(difference_cell(less.value, less.low, less.high))
        printed.append(tuple(row))
    header = ["First elevation", "Opposite"]
    for criterion in criteria:
        header += [f"{method_label(criterion)}: circle → sphere", "difference"]
    notes = (
        "MAE in degrees of two views fused by posterior. Circle: the second view is at the first "
        "one's elevation; sphere: rotation and elevation are chosen jointly.",
        f"Differences are paired by object, with 95 % intervals. {DECIDED}",
    )
    title = f"Second views from anywhere on the view sphere: {category_label(category)}"
    frame = pd.DataFrame(cells)
    return Table("view_sphere", title, title, frame, tuple(header), tuple(printed), notes)
