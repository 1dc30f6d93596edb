"""Distributions of any estimator, from the files of a user."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.calibration.estimates import COLUMNS
from nbv.calibration.pairs import read_pair_rows, read_rows
from nbv.errors import UserError

FEWEST_CLASSES = 8

LARGEST_EXCESS = 0.01
"""How far a row's sum may be from 1: rounded probabilities are normalised again."""


def as_distributions(values: ArrayLike, name: str, first_row: int = 1) -> NDArray[np.float64]:
    """Return rows (n, B) of probabilities, each with the sum 1.

    Parameters
    ----------
    values : array-like (n, B)
    name : str
        What they are of, for messages.
    first_row : int
        The number of the first row, for messages.

    Raises
    ------
    UserError
        Where they have another shape, a value is no probability, or a sum is farther from 1 than
        `LARGEST_EXCESS`.
    """
    try:
        rows = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise UserError(f"{name}: a probability is no number") from None
    if rows.ndim != 2 or not len(rows) or rows.shape[1] < FEWEST_CLASSES:
        raise UserError(
            f"{name}: probabilities of shape {rows.shape}; give a row for each view, with "
            f"{FEWEST_CLASSES} classes or more"
        )
    if not np.isfinite(rows).all() or (rows < 0).any():
        place = int((~np.isfinite(rows) | (rows < 0)).any(axis=1).argmax())
        raise UserError(f"{name}, row {place + first_row}: a probability is below 0 or no number")
    sums = rows.sum(axis=1)
    if (far := np.abs(sums - 1.0) > LARGEST_EXCESS).any():
        place = int(far.argmax())
        raise UserError(
            f"{name}, row {place + first_row}: probabilities have the sum {sums[place]:g}; give "
            "softmax outputs, whose sum is 1"
        )
    return np.asarray(rows / sums[:, None])


def read_pair_distributions(
    path: str | Path,
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Read the distributions of a file of calibration pairs: columns ``p0, p1, …, p<B-1>``.

    ``p<k>`` is the probability of the azimuth 360 k / B.

    Returns
    -------
    dict
        For each object its azimuths (n,) and distributions (n, B); empty where the file has no
        such column.

    Raises
    ------
    UserError
        Of `nbv.calibration.pairs.read_pairs`; where a column is missing between others, or a row is
        no distribution.
    """
    path = Path(path)
    table = read_pair_rows(path)
    if not _classes(path, table):
        return {}
    rows = _rows(path, table)
    azimuth_deg = table[COLUMNS[1]].to_numpy(dtype=np.float64)
    objects = table["object_id"].to_numpy()
    return {
        str(name): (azimuth_deg[objects == name], rows[objects == name])
        for name in dict.fromkeys(objects)
    }


def read_distributions(path: str | Path) -> NDArray[np.float64]:
    """Read distributions (n, B) of n views: CSV with columns ``p0, p1, …``, or a `.npy` array.

    Raises
    ------
    UserError
        Where the file cannot be read or a row is no distribution.
    """
    path = Path(path)
    if path.suffix.lower() == ".npy":
        try:
            values = np.load(path, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise UserError(f"{path} cannot be read ({' '.join(str(error).split())})") from error
        return as_distributions(np.atleast_2d(values), str(path))
    return _rows(path, read_rows(path, ["p0"]))


def _classes(path: Path, table: pd.DataFrame) -> list[str]:
    """Return the names of the columns of probabilities, in their order."""
    found = [name for name in table.columns if name[:1] == "p" and name[1:].isdecimal()]
    wanted = [f"p{number}" for number in range(len(found))]
    if missing := [name for name in wanted if name not in found]:
        raise UserError(f"{path}: no column {missing[0]!r} among {len(found)} of probabilities")
    return wanted


def _rows(path: Path, table: pd.DataFrame) -> NDArray[np.float64]:
    texts = table[_classes(path, table)]
    numbers = texts.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    return as_distributions(numbers, str(path), first_row=2)
