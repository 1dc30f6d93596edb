"""Reading what a run wrote, file by file: errors, objects and depth images.

A *unit* is one category at one elevation: what a row of Tables 1 to 4 is made of.
"""

from __future__ import annotations

from collections.abc import Mapping
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

EvaluationFile = tuple[str, int, int, str]
"""What a file of errors is about: category, elevation in degrees, fold (from 1) and method."""


def load_evaluations(files: Mapping[EvaluationFile, Path]) -> dict[Unit, pd.DataFrame]:
    """Read the errors of each unit.

    Parameters
    ----------
    files : mapping of (category, elevation_deg, fold, method) to path

    Returns
    -------
    dict of (category, elevation_deg) to pandas.DataFrame
        Units in the order of their first file. Columns are ``method, fold`` and
        `two_views.COLUMNS`, with one row for each method, test object and initial viewpoint.
        Methods come in the order of their first file, which is the order of the categories of
        ``method`` as well.

    Raises
    ------
    UserError
        If a file is missing, empty, or lacks a column.
    """
    parts: dict[Unit, dict[str, list[pd.DataFrame]]] = {}
    for (category, elevation_deg, fold, method), path in files.items():
        frame = read_evaluation(path).assign(method=method, fold=fold)
        parts.setdefault((category, elevation_deg), {}).setdefault(method, []).append(frame)
    return {unit: _join(by_method) for unit, by_method in parts.items()}


def _join(by_method: Mapping[str, list[pd.DataFrame]]) -> pd.DataFrame:
    frames = [frame for of_method in by_method.values() for frame in of_method]
    unit = pd.concat(frames, ignore_index=True)
    unit["method"] = pd.Categorical(unit["method"], categories=list(by_method), ordered=True)
    return unit[["method", "fold", *COLUMNS]]


def load_object_ids(splits: Path) -> tuple[str, ...]:
    """Return a category's objects in the order of the depth images, from its splits."""
    read = read_splits(existing(splits))
    return tuple(read.loc[read["fold"] == read["fold"].min(), "object_id"])


def load_depth(path: Path) -> NDArray[np.uint8]:
    """Map a unit's depth codes into memory: (n_objects, n_viewpoints, side, side) uint8.

    0 is background; nearer is a larger code. The file is read as far as it is indexed.
    """
    return open_array(existing(path))


def read_evaluation(path: Path) -> pd.DataFrame:
    """Read one method's errors of one fold; errors as of `load_evaluations`."""
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
