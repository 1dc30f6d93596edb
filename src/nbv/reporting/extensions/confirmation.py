"""Tables over all trainings: means of methods, and contrasts between them."""

from __future__ import annotations

import pandas as pd

from nbv.labels import category_label, interval_text, number
from nbv.reporting.table import Cell, Part, Table

_INTERVALS = (
    "Intervals are 95 % and contain the chance of objects and of trainings (docs/method.md)."
)


def methods_table(means: pd.DataFrame) -> Table:
    """Return the means of `nbv.statistics.confirmation.method_means` as a table.

    A row for each choice and number of views, a column for each fusion.
    """
    fusions = [fusion for fusion in dict.fromkeys(means["fusion"]) if fusion != "none"]
    parts = []
    for (dataset, category), part in means.groupby(["dataset", "category"], sort=False):
        rows = []
        for (n_views, choice), of_choice in part.groupby(["n_views", "choice"], sort=False):
            by_fusion = {str(row["fusion"]): _mean(row) for _, row in of_choice.iterrows()}
            shown = [by_fusion.get(fusion, "–") for fusion in fusions]
            if "none" in by_fusion:
                shown = [by_fusion["none"]] * len(fusions)
            rows.append((Cell(_choice(str(choice), int(str(n_views)))), *map(Cell, shown)))
        parts.append(Part(tuple(rows), f"{dataset}, {category_label(str(category))}"))
    title = "Every choice of view with every fusion"
    header = ("Choice", *(fusion.capitalize() for fusion in fusions))
    notes = ("MAE in degrees.", _INTERVALS)
    return Table("methods", title, title, means, header, tuple(parts), notes)


def contrasts_table(contrasts: pd.DataFrame) -> Table:
    """Return the contrasts of `nbv.statistics.confirmation.method_contrasts` as a table."""
    parts = []
    for (dataset, category), part in contrasts.groupby(["dataset", "category"], sort=False):
        rows = [
            (
                Cell(_contrast(str(row["contrast"]))),
                Cell(str(row["fusion"])),
                Cell(
                    interval_text(row["difference_deg"], row["low"], row["high"]),
                    bold=bool(row["low"] > 0 or row["high"] < 0),
                ),
                Cell(number(row["p_holm"], 3)),
            )
            for _, row in part.iterrows()
        ]
        heading = f"{dataset}, {category_label(str(category))}"
        sizes = part.iloc[0]
        heading += f" ({sizes['n_objects']} objects, {sizes['n_trainings']} trainings)"
        parts.append(Part(tuple(rows), heading))
    title = "Differences between methods"
    header = ("Contrast", "Fusion", "Difference of MAE", "p")
    notes = (
        "Difference of MAE in degrees, paired by object and training; bold where the interval "
        "excludes 0.",
        _INTERVALS,
        "p: of expected error less fixed, the primary contrast, as it is; of all others adjusted "
        "by Holm's method within their data set and category.",
    )
    return Table(
        "contrasts", title, title, contrasts, header, tuple(parts), notes, n_text_columns=2
    )


def _mean(row: pd.Series) -> str:
    return interval_text(row["mae_deg"], row["low"], row["high"])


def _choice(choice: str, n_views: int) -> str:
    if choice == "none":
        return "One view"
    name = choice.replace("_", " ").capitalize()
    return name if n_views == 2 else f"{name}, {n_views} views"


def _contrast(name: str) -> str:
    return name.replace("_", " ").replace(" - ", " less ").capitalize()
