"""The table of the ablation."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from nbv.labels import interval_text, number
from nbv.reporting.grid import Cell, Grid
from nbv.reporting.sheets import Sheet
from nbv.statistics.object_means import mae_difference as gap
from nbv.statistics.object_means import mae_interval as standing
from nbv.statistics.paired import PairedErrors, Resampler


def ablation_sheet(
    space: pd.DataFrame, found: Mapping[int, pd.DataFrame], category: str, resampler: Resampler
) -> Sheet:
    """Return the table of all rows of the space, each held against the first.

    Parameters
    ----------
    space : DataFrame
        From `ablation_space`.
    found : mapping of int to DataFrame
        By row: ``fold, object_id, error_deg`` of all folds.
    category : str
    resampler : Resampler
    """
    wide = pd.concat(
        {row: frame.set_index(["object_id", "fold"])["error_deg"] for row, frame in found.items()},
        axis=1,
    ).sort_index()
    sample = PairedErrors(
        {str(row): wide[row].to_numpy(dtype=np.float64) for row in wide.columns},
        np.arange(len(wide), dtype=np.int64),
        wide.index.get_level_values("fold").to_numpy(dtype=np.int64),
        np.zeros(len(wide)),
        (category,) * len(wide),
    )
    cells, printed = [], []
    for row, instance in enumerate(space.to_dict("records")):
        value = standing(sample, str(row), resampler)
        less = gap(sample, str(row), "0", resampler)
        cells.append(
            instance
            | {"value": value.value, "ci_low": value.low, "ci_high": value.high}
            | {"difference": less.value, "difference_low": less.low, "difference_high": less.high}
        )
        difference = interval_text(less.value, less.low, less.high) if row else "–"
        printed.append(
            (
                Cell(instance["varied"].replace("_", " ")),
                Cell(_described(instance)),
                Cell(number(value.value)),
                Cell(difference, best=bool(row) and less.high < 0),
            )
        )
    header = ("Varied", "Setting", "MAE", "Difference")
    notes = (
        "MAE in degrees. The first row is the paper's method with its density chosen by the "
        "cross-validated decision; each other row changes one thing.",
        "Differences to the first row are paired by object, with 95 % intervals; bold where a "
        "change is better and the interval excludes 0.",
    )
    title = f"Ablation: {category}"
    return Sheet("ablation", title, pd.DataFrame(cells), Grid(header, tuple(printed)), notes)


def _described(instance: Mapping[Hashable, Any]) -> str:
    if instance["varied"] == "density":
        return (
            f"bandwidth {instance['bandwidth_deg']:g}°, "
            f"{instance['pseudo_observations']:g} pseudo-observations"
        )
    named = {
        "chosen_by": instance["chosen_by"],
        "reading": f"{instance['reading']}, {instance['spread']}",
        "bins": str(instance["n_bins"]),
        "calibration_objects": str(instance["n_calibration"]),
        "criterion_and_fusion": f"{instance['criterion']}, {instance['fusion']}",
        "nothing": "the paper's method",
    }
    return str(named[instance["varied"]]).replace("_", " ")
