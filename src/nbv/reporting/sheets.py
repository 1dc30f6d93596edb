"""A table with its tidy cells and its printed form, and the tables of several views."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from nbv.files import write_csv, write_text
from nbv.labels import category_label, interval_text, method_label, number
from nbv.reporting.grid import Cell, Grid, grid_latex, grid_markdown
from nbv.statistics.object_means import mae_difference as gap
from nbv.statistics.object_means import mae_interval as standing
from nbv.statistics.object_means import paired_objects
from nbv.statistics.paired import PairedErrors, Resampler


@dataclass(frozen=True)
class Sheet:
    """A table: its tidy cells, and how it is printed."""

    name: str
    title: str
    cells: pd.DataFrame
    grid: Grid
    notes: tuple[str, ...]


def save_sheet(sheet: Sheet, stem: str | Path) -> None:
    """Write ``<stem>.csv``, ``<stem>.md`` and ``<stem>.tex``."""
    stem = Path(stem)
    write_csv(stem.with_suffix(".csv"), sheet.cells)
    write_text(stem.with_suffix(".md"), grid_markdown(sheet.title, sheet.grid, sheet.notes))
    write_text(
        stem.with_suffix(".tex"), grid_latex(sheet.name, sheet.title, sheet.grid, sheet.notes)
    )


def _columns(rows: pd.DataFrame, by: str) -> pd.DataFrame:
    """Return rows whose method says under which condition it was, as ``method@condition``."""
    return rows.assign(method=rows["method"] + "@" + rows[by].astype(str))


def _travel(rows: pd.DataFrame) -> pd.Series:
    return rows.groupby("method", sort=False)["travel_deg"].mean()


def _mae(sample: PairedErrors, method: str, resampler: Resampler) -> dict[str, float]:
    found = standing(sample, method, resampler)
    return {"value": found.value, "ci_low": found.low, "ci_high": found.high}


def sequence_sheet(rows_of: Mapping[str, pd.DataFrame], resampler: Resampler) -> Sheet:
    """Return error and travel against the number of views.

    Parameters
    ----------
    rows_of : mapping of str to DataFrame
        By category, rows of `nbv.experiments.more_views.sequence_rows` with their ``fold``.
    resampler : Resampler

    Returns
    -------
    Sheet
        A row for each category and rule, and a last column that holds its three views against
        four at random.
    """
    cells, printed = [], []
    views: list[int] = []
    for category, rows in rows_of.items():
        views = sorted(rows["n_views"].unique())
        named = _columns(rows, "n_views")
        sample, travel = paired_objects(named, category), _travel(named)
        for method in dict.fromkeys(rows["method"]):
            row = [Cell(f"{category_label(category)}: {method_label(method)}")]
            for n_views in views:
                name = f"{method}@{n_views}"
                found = _mae(sample, name, resampler)
                place = {"category": category, "method": method, "n_views": n_views}
                cells.append(place | found | {"travel_deg": travel[name]})
                row.append(Cell(number(found["value"]), printed=f"[{travel[name]:.0f}°]"))
            text = "–"
            if {3, 4} <= set(views) and method != "random":
                less = gap(sample, f"{method}@3", "random@4", resampler)
                cells[-len(views) + views.index(3)] |= {
                    "to_random_4": less.value,
                    "to_random_4_low": less.low,
                    "to_random_4_high": less.high,
                }
                text = interval_text(less.value, less.low, less.high)
            row.append(Cell(text, best=text != "–" and less.high < 0))
            printed.append(tuple(row))
    header = ("Rule", *(f"{n} view{'s' if n > 1 else ''}" for n in views), "3 views − Random's 4")
    notes = (
        "MAE in degrees [mean travel from view to view]; all fused by posterior.",
        "Last column: paired by object, 95 % interval; bold where three views of this rule are "
        "better than four at random and the interval excludes 0.",
        "Evenly spaced knows the number of views before the first look; its last one is shown.",
    )
    title = "Error and travel against the number of views"
    return Sheet("sequences", title, pd.DataFrame(cells), Grid(header, tuple(printed)), notes)


def sphere_sheet(rows: pd.DataFrame, category: str, resampler: Resampler) -> Sheet:
    """Return what choosing the elevation with the rotation gains, by the first elevation.

    Parameters
    ----------
    rows : DataFrame
        Of `nbv.experiments.view_sphere.sphere_rows`, with their ``fold``.
    category : str
    resampler : Resampler
    """
    cells, printed = [], []
    criteria = [m.removesuffix("_sphere") for m in rows["method"].unique() if "_sphere" in m]
    for elevation, part in rows.groupby("elevation_deg"):
        sample, travel = paired_objects(part, category), _travel(part)
        next_deg = part.groupby("method")["next_elevation_deg"].mean()
        row = [Cell(f"{elevation}°"), Cell(number(standing(sample, "opposite", resampler).value))]
        for method in sample.errors_deg:
            place = {"category": category, "elevation_deg": elevation, "method": method}
            moved = {"travel_deg": travel[method], "next_elevation_deg": next_deg[method]}
            cells.append(place | _mae(sample, method, resampler) | moved)
        for criterion in criteria:
            circle, sphere = f"{criterion}_circle", f"{criterion}_sphere"
            less = gap(sample, sphere, circle, resampler)
            values = (standing(sample, name, resampler).value for name in (circle, sphere))
            row.append(Cell(" → ".join(number(value) for value in values)))
            text = interval_text(less.value, less.low, less.high)
            row.append(Cell(text, best=less.high < 0))
        printed.append(tuple(row))
    header = ["First elevation", "Opposite"]
    for criterion in criteria:
        label = method_label(criterion)
        header += [f"{label}: circle → sphere", "difference"]
    notes = (
        "MAE in degrees of two views fused by posterior. Circle: the second view is at the first "
        "one's elevation; sphere: rotation and elevation are chosen jointly.",
        "Differences are paired by object, with 95 % intervals; bold where the sphere is better "
        "and the interval excludes 0.",
    )
    title = f"Second views from anywhere on the view sphere: {category_label(category)}"
    grid = Grid(tuple(header), tuple(printed))
    return Sheet("sphere", title, pd.DataFrame(cells), grid, notes)
