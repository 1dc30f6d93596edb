"""Distributions of any estimator, from the files of a user."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import signed_difference_deg, wrap_deg
from nbv.core.distributions import rotated
from nbv.core.logits import LEAST_PROBABILITY
from nbv.errors import UserError
from nbv.files import read_numbers, read_rows

FEWEST_CLASSES = 8

SUM_TOLERANCE = 0.05
"""How far a row's sum may be from 1: rounded probabilities are normalised again."""

WIDEST_GAP_DEG = 15.0
"""Between neighbouring views of a calibration turn."""


def as_distributions(
    values: ArrayLike, name: str, numbers: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Return rows (n, B) of probabilities above 0, each with the sum 1.

    A probability of 0 counts as the smallest other one of its row, or as `LEAST_PROBABILITY` where
    that is less: no image excludes a pose.

    Parameters
    ----------
    values : array-like (n, B), or (B,)
    name : str
        What they are of, for messages.
    numbers : array-like (n,), optional
        Of the rows, for messages; 1, 2, … without.

    Raises
    ------
    UserError
        Where they have another shape, a value is no probability, or a sum is farther from 1 than
        `SUM_TOLERANCE`.
    """
    try:
        given = np.asarray(values)
    except ValueError:
        raise UserError(f"{name}: rows of different lengths") from None
    if given.dtype.kind not in "iuf":
        raise UserError(f"{name}: probabilities are numbers, not {given.dtype}")
    rows = np.atleast_2d(given).astype(np.float64)
    if rows.ndim != 2 or not len(rows) or rows.shape[1] < FEWEST_CLASSES:
        raise UserError(
            f"{name}: probabilities of shape {given.shape}; give a row for each view, with "
            f"{FEWEST_CLASSES} classes or more"
        )
    number = np.arange(1, len(rows) + 1) if numbers is None else np.asarray(numbers)
    is_wrong = ~np.isfinite(rows) | (rows < 0)
    if is_wrong.any():
        place, column = (int(index[0]) for index in np.nonzero(is_wrong))
        raise UserError(
            f"{name}, row {number[place]}, p{column}: a probability is below 0 or no number; "
            "give probabilities, not their logarithms"
        )
    sums = rows.sum(axis=1)
    if (far := np.abs(sums - 1.0) > SUM_TOLERANCE).any():
        place = int(far.argmax())
        raise UserError(
            f"{name}, row {number[place]}: probabilities have the sum {sums[place]:.3g} and "
            "not 1; give softmax outputs, with more decimals where they are rounded"
        )
    smallest = np.where(rows > 0, rows, np.inf).min(axis=1, keepdims=True)
    rows = np.where(rows > 0, rows, np.minimum(smallest, LEAST_PROBABILITY))
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))


def widest_gap_deg(azimuth_deg: NDArray[np.float64]) -> float:
    """Return the widest gap between neighbouring views (n,) on a turn, degrees."""
    ordered = np.sort(wrap_deg(azimuth_deg))
    return float(np.diff(ordered, append=ordered[0] + 360.0).max())


def radians_hint(azimuth_deg: NDArray[np.float64]) -> str:
    """Return the end of a sentence that refuses a gap; empty where azimuths (n,) are degrees.

    In radians they are within a turn and leave no gap that is much wider.
    """
    is_small = np.abs(azimuth_deg).max() <= 2 * np.pi
    if is_small and widest_gap_deg(np.degrees(azimuth_deg)) <= 2 * WIDEST_GAP_DEG:
        return "; these azimuths seem to be radians: multiply them by 180/π"
    return ""


def evenly_apart(
    azimuth_deg: NDArray[np.float64], rows: NDArray[np.float64], n_views: int
) -> NDArray[np.float64]:
    """Return distributions (n_views, B) of views evenly apart, of views (n,) anywhere on a turn.

    Each takes the nearest view, whose distribution is rotated by what lies between.

    Raises
    ------
    UserError
        Where neighbouring views are farther than `WIDEST_GAP_DEG` apart.
    """
    if (gap := widest_gap_deg(azimuth_deg)) > WIDEST_GAP_DEG + 1e-6:
        raise UserError(
            f"views are {gap:.0f}° apart somewhere on the turn; calibration needs one every "
            f"{WIDEST_GAP_DEG:g}°{radians_hint(azimuth_deg)}"
        )
    found = np.empty((n_views, rows.shape[1]))
    for place, azimuth in enumerate(np.arange(n_views) * (360.0 / n_views)):
        apart = signed_difference_deg(azimuth_deg, azimuth)
        nearest = int(np.abs(apart).argmin())
        found[place] = rotated(rows[nearest], float(apart[nearest]))
    return found


def bin_apart(azimuth_deg: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return distributions (B, B) of views a bin apart, as `evenly_apart` does."""
    return evenly_apart(azimuth_deg, rows, rows.shape[1]).astype(np.float32)


def read_distributions(path: str | Path) -> NDArray[np.float64]:
    """Read distributions (n, B) of n views: CSV with columns ``p0, p1, …``, or a ``.npy`` array.

    Raises
    ------
    UserError
        Where the file cannot be read or a row is no distribution.
    """
    path = Path(path)
    if path.suffix.lower() == ".npy":
        return as_distributions(read_numbers(path), str(path))
    return distributions_of_rows(path, read_rows(path, ["p0"]))


def class_columns(path: Path, table: pd.DataFrame) -> list[str]:
    """Return the names of the columns of probabilities, in their order; none without such.

    Raises
    ------
    UserError
        Where a column is missing between others.
    """
    given = [str(name) for name in table.columns]
    found = [name for name in given if re.fullmatch(r"\s*[pP][ _]?\d+\s*", name)]
    wanted = [f"p{number}" for number in range(len(found))]
    if strange := sorted(set(found) - set(wanted)):
        raise UserError(
            f"{path}: {len(found)} columns of probabilities are not p0 to p{len(found) - 1}: "
            f"rename {strange[0]!r}"
        )
    return wanted


def distributions_of_rows(path: Path, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the distributions (n, B) in the columns ``p0, p1, …`` of a file's rows."""
    texts = table[class_columns(path, table)]
    numbers = texts.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    return as_distributions(numbers, str(path), table.index.to_numpy() + 2)
