"""The table of the ablation."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from nbv.experiment.report.table import DECIDED, Cell, Table, difference_cell
from nbv.experiment.statistics.object_means import mae_difference, mae_interval, paired_objects
from nbv.experiment.statistics.paired import Resampler
from nbv.labels import number


def ablation_table(
    space: pd.DataFrame, found: Mapping[int, pd.DataFrame], category: str, resampler: Resampler
) -> Table:
    """Return the table of all rows of the space, each compared with the first.

    ``space`` is of `studies.ablation.ablation_space`; ``found`` has by its rows the
    ``fold, object_id, error_deg`` of all folds.
    """
    named = [frame.assign(method=str(row)) for row, frame in found.items()]
    sample = paired_objects(pd.concat(named), category)
    cells, printed = [], []
    for row, instance in enumerate(space.to_dict("records")):
        value = mae_interval(sample, str(row), resampler)
        less = mae_difference(sample, str(row), "0", resampler)
        cells.append(instance | value.columns("value", "ci") | less.columns("difference"))
        printed.append(
            (
                Cell(instance["varied"].replace("_", " ")),
                Cell(_described(instance)),
                Cell(number(value.value)),
                difference_cell(less.value, less.low, less.high) if row else Cell("–"),
            )
        )
    header = ("Varied", "Setting", "MAE", "Difference")
    notes = (
        "MAE in degrees. The first row is the paper's method with its density chosen by the "
        "cross-validated decision; each other row changes one thing.",
        f"Differences to the first row are paired by object, with 95 % intervals. {DECIDED}",
    )
    title = f"Ablation: {category}"
    return Table("ablation", title, title, pd.DataFrame(cells), header, tuple(printed), notes)


def _described(instance: Mapping[Hashable, Any]) -> str:
    if instance["varied"] == "density":
        return (
            f"bandwidth {instance['bandwidth_deg']:g}°, "
            f"{instance['pseudo_observations']:g} pseudo-observations"
        )
    named = {
        "chosen_by": instance["chosen_by"],
        "pose_likelihood": f"{instance['pose_likelihood']}, {instance['spread']}",
        "bins": str(instance["n_bins"]),
        "calibration_objects": str(instance["n_calibration"]),
        "criterion_and_fusion": f"{instance['criterion']}, {instance['fusion']}",
        "nothing": "the paper's method",
    }
    return str(named[instance["varied"]]).replace("_", " ")
