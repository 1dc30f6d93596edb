"""What methods are compared within: the objects' errors of one run and category.

The configuration's methods and extensions come as one mapping of a name to its ``policy`` and its
``fusion``, which is the average where it is not given. Names say nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nbv.experiment.statistics.object_means import mae_interval, paired_objects
from nbv.experiment.statistics.paired import PairedErrors, Resampler
from nbv.files import existing, read_csv

Block = tuple[str, str]
"""A run and a category."""

Blocks = Mapping[Block, PairedErrors]
Methods = Mapping[str, Mapping[str, str]]

ORACLE = "oracle"
SELECTED = "selected"
SUBJECT = "proposed"

CELL_COLUMNS = (
    "run",
    "category",
    "method",
    "value",
    "ci_low",
    "ci_high",
    "among_best",
    "versus",
    "difference",
    "difference_low",
    "difference_high",
    "n_objects",
)


def blocks_of(
    runs: Mapping[str, pd.DataFrame], elevation_deg: int = 0
) -> dict[Block, PairedErrors]:
    """Return the objects' errors of each run and category at its reference elevation.

    Where a category was not run at it, its lowest one is taken. ``runs`` has by a run's name what
    `nbv.experiment.statistics.object_means.load_folds` read of ``objects.csv``.
    """
    blocks = {}
    for run, means in runs.items():
        for category, rows in means.groupby("category", sort=False):
            present = rows["elevation_deg"].unique()
            taken = elevation_deg if elevation_deg in present else present.min()
            at = rows[rows["elevation_deg"] == taken]
            blocks[run, str(category)] = paired_objects(at, str(category))
    return blocks


def rows_by_category(files: Mapping[tuple[str, int], Path]) -> dict[str, pd.DataFrame]:
    """Read rows by category and fold; return each category's, with their ``fold``."""
    parts: dict[str, list[pd.DataFrame]] = {}
    for (category, fold), path in files.items():
        parts.setdefault(category, []).append(read_csv(existing(path)).assign(fold=fold))
    return {category: pd.concat(found) for category, found in parts.items()}


def shared_methods(blocks: Blocks, methods: Methods) -> list[str]:
    """Return the methods of the configuration that every block has.

    Of several with the same policy and fusion, only the first is ranked: they are one method.
    """
    first = next(iter(blocks.values()))
    everywhere = [m for m in first.errors_deg if all(m in s.errors_deg for s in blocks.values())]
    named = {
        method_with(methods, m["policy"], m.get("fusion", "average")) for m in methods.values()
    }
    return [method for method in everywhere if method in named]


def method_with(methods: Methods, policy: str, fusion: str) -> str | None:
    """Return the first method that has a policy and a fusion, or None."""
    for name, method in methods.items():
        if (method["policy"], method.get("fusion", "average")) == (policy, fusion):
            return name
    return None


def block_cell(
    block: Block, method: str, sample: PairedErrors, resampler: Resampler
) -> dict[str, Any]:
    """Return the tidy cell of a method's MAE in a block."""
    run, category = block
    return (
        dict.fromkeys(CELL_COLUMNS, np.nan)
        | {"run": run, "category": category, "method": method, "n_objects": sample.n_objects}
        | mae_interval(sample, method, resampler).columns("value", "ci")
    )
