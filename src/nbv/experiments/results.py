"""Reading a results tree: which files a unit has, and what they hold.

A *unit* is one category at one elevation: what a row of Tables 1 to 4 is made of.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.calibration.splits import read_splits
from nbv.errors import UserError
from nbv.experiments.two_views import COLUMNS
from nbv.files import existing, open_array, read_csv

Unit = tuple[str, int]
"""A category and an elevation in degrees."""


def unit_dir(root: str | Path, stage: str, category: str, elevation_deg: int) -> Path:
    """Return the directory of one stage's files for a unit."""
    return Path(root) / stage / category / f"el{elevation_deg:02d}"


def evaluation_path(
    root: str | Path, category: str, elevation_deg: int, fold: int, method: str
) -> Path:
    """Return where one method's errors of one fold (counted from 1) are."""
    return unit_dir(root, "evaluation", category, elevation_deg) / f"fold{fold}" / f"{method}.csv"


def lookup_path(
    root: str | Path, category: str, elevation_deg: int, fold: int, criterion: str
) -> Path:
    """Return where one criterion's lookup table of one fold (counted from 1) is."""
    return unit_dir(root, "lookup", category, elevation_deg) / f"fold{fold}" / f"{criterion}.npz"


def depth_path(root: str | Path, category: str, elevation_deg: int) -> Path:
    """Return where the depth images of a unit are."""
    return Path(root) / "depth" / category / f"el{elevation_deg:02d}.npy"


def splits_path(root: str | Path, category: str) -> Path:
    """Return where the folds of a category are written."""
    return Path(root) / "splits" / f"{category}.csv"


def load_unit(
    root: str | Path, category: str, elevation_deg: int, n_folds: int, methods: Sequence[str]
) -> pd.DataFrame:
    """Read every method's errors of one category and elevation.

    Parameters
    ----------
    root : path
        ``results/<experiment>``.
    category : str
        Object category.
    elevation_deg : int
        Elevation in degrees.
    n_folds : int
        Folds 1 to n_folds are read.
    methods : sequence of str
        Methods, in the order in which tables show them.

    Returns
    -------
    pandas.DataFrame
        ``method, fold`` and `methods.COLUMNS`; one row per method, test object and initial
        viewpoint. `method` is categorical, its categories in the order given.

    Raises
    ------
    UserError
        If a file is missing, empty, or lacks a column.
    """
    parts = []
    for method in methods:
        for fold in range(1, n_folds + 1):
            path = evaluation_path(root, category, elevation_deg, fold, method)
            frame = read_evaluation(path)
            parts.append(frame.assign(method=method, fold=fold))
    unit = pd.concat(parts, ignore_index=True)
    unit["method"] = pd.Categorical(unit["method"], categories=list(methods), ordered=True)
    return unit[["method", "fold", *COLUMNS]]


def load_evaluations(
    root: str | Path, units: Iterable[Unit], n_folds: int, methods: Sequence[str]
) -> dict[Unit, pd.DataFrame]:
    """Read several units with `load_unit`, in the order given."""
    return {
        (category, elevation): load_unit(root, category, elevation, n_folds, methods)
        for category, elevation in units
    }


def load_object_ids(root: str | Path, category: str) -> tuple[str, ...]:
    """Return the category's objects in the order of the depth images."""
    splits = read_splits(existing(splits_path(root, category)))
    first = splits[splits["fold"] == splits["fold"].min()]
    return tuple(first["object_id"])


def load_depth(root: str | Path, category: str, elevation_deg: int) -> NDArray[np.uint8]:
    """Map a unit's depth codes into memory: (n_objects, n_viewpoints, side, side) uint8.

    0 is background; nearer is a larger code. The file is read as far as it is indexed.
    """
    return open_array(existing(depth_path(root, category, elevation_deg)))


def read_evaluation(path: Path) -> pd.DataFrame:
    """Read one method's errors of one fold: `methods.COLUMNS`.

    Raises
    ------
    UserError
        If the file is missing, empty, or lacks a column.
    """
    try:
        frame = read_csv(existing(path))
    except pd.errors.EmptyDataError:
        frame = pd.DataFrame()
    absent = [name for name in COLUMNS if name not in frame.columns]
    if absent:
        raise UserError(f"{path}: no column {absent[0]!r}; delete the file and run the stage again")
    if frame.empty:
        raise UserError(f"{path}: holds no rows; delete the file and run the stage again")
    return frame
