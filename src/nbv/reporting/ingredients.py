"""What each ingredient of the randomisation brings: bundles that were trained without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd

from nbv.bundles.evaluation import RECOMMENDED, SINGLE
from nbv.labels import category_label, number
from nbv.reporting.table import DECIDED, Cell, Table, difference_cell
from nbv.statistics.metrics import Interval
from nbv.statistics.object_means import mae_difference, paired_objects
from nbv.statistics.paired import Resampler

ALL = ""
"""In the place of what is left out: nothing."""

_SHOWN = ((SINGLE, 1, "one view"), (RECOMMENDED, 2, "two views"))

Key = tuple[str, str]
"""Category, and what the training is without."""


def ingredient_table(
    rendered: Mapping[Key, pd.DataFrame], real: Mapping[Key, pd.DataFrame], resampler: Resampler
) -> Table:
    """Return the errors of bundles that lack an ingredient, less those of the one with all.

    Parameters
    ----------
    rendered : mapping of (str, str) to DataFrame
        By category and what is left out, `ALL` first: `nbv.bundles.evaluation.evaluate` on test
        objects, with all that is random.
    real : mapping
        The same on recordings of a real camera, or empty.
    resampler : Resampler
    """
    cells, rows = [], []
    for category, without in rendered:
        named = "with all" if without == ALL else f"without {without.replace('_', ' ')}"
        row = [Cell(f"{category_label(category)}, {named}")]
        made: dict[str, float | str] = {"category": category, "without": without or "nothing"}
        for choice, n_views, label in _SHOWN:
            found = _found(rendered, category, without, choice, n_views, resampler)
            made |= found.columns(label.replace(" ", "_"))
            row.append(
                Cell(f"{number(found.value)}°")
                if without == ALL
                else difference_cell(found.value, found.low, found.high)
            )
        for choice, n_views, label in _SHOWN if real else ():
            errors = _of_objects(real[category, without], choice, n_views)
            made[f"{label.replace(' ', '_')}_real"] = errors.mean()
            row.append(Cell(f"{number(errors.mean())}°"))
        cells.append(made)
        rows.append(tuple(row))
    return Table(
        "ingredients",
        "What is random in training",
        "What each ingredient of the randomisation brings",
        pd.DataFrame(cells),
        ("", *_titles("rendered")) + (tuple(_titles("real")) if real else ()),
        tuple(rows),
        (
            "Rendered: MAE on test objects of a view every 15°, with all that is random. Below the "
            "first line it is the difference to it, with a 95 % interval over objects; one "
            f"training each, whose chance the interval does not contain. {DECIDED}",
            *(("Real: MAE on recordings with known azimuths.",) if real else ()),
        ),
    )


def _titles(what: str) -> Iterator[str]:
    return (f"{label}, {what}" for _, _, label in _SHOWN)


def _of_objects(found: pd.DataFrame, choice: str, n_views: int) -> pd.Series[float]:
    """Return the mean error of each object over its recordings."""
    rows = found[(found["choice"] == choice) & (found["n_views"] == n_views)]
    return rows.groupby("object_id")["mae_deg"].mean()


def _found(
    rendered: Mapping[Key, pd.DataFrame],
    category: str,
    without: str,
    choice: str,
    n_views: int,
    resampler: Resampler,
) -> Interval:
    errors = {
        name: _of_objects(rendered[category, name], choice, n_views) for name in {ALL, without}
    }
    if without == ALL:
        return Interval(float(errors[ALL].mean()), np.nan, np.nan)
    means = pd.concat(
        [
            rows.rename("error_deg").reset_index().assign(method=name, fold=1)
            for name, rows in errors.items()
        ]
    )
    return mae_difference(paired_objects(means, category), without, ALL, resampler)
