"""Estimates on disk: one row for every view of every object."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.files import damaged, need_columns, read_csv, readable, write_csv

COLUMNS = ("object_id", "azimuth_deg", "estimate_deg")


@dataclass(frozen=True)
class Estimates:
    """Estimates of full turns of objects.

    Attributes
    ----------
    object_ids : tuple of str
        n objects.
    estimate_deg : ndarray (n, n_views) float64
        In [0, 360); view k has the azimuth 360 k / n_views.
    """

    object_ids: tuple[str, ...]
    estimate_deg: NDArray[np.float64]

    @property
    def azimuth_deg(self) -> NDArray[np.float64]:
        """The true azimuth of each view, (n_views,)."""
        n_views = self.estimate_deg.shape[1]
        return np.asarray(np.arange(n_views) * (360.0 / n_views))


def write_estimates(path: str | Path, estimates: Estimates) -> None:
    """Write estimates as a table with the columns `COLUMNS`."""
    n_objects, n_views = estimates.estimate_deg.shape
    columns = (
        np.repeat(np.asarray(estimates.object_ids, dtype=object), n_views),
        np.tile(estimates.azimuth_deg.astype(int), n_objects),
        # Rounding to 4 decimals may turn 359.99999 into 360.0, which is 0.
        (np.round(estimates.estimate_deg, 4) % 360.0).ravel(),
    )
    write_csv(path, pd.DataFrame(dict(zip(COLUMNS, columns, strict=True))))


def read_estimates(path: str | Path) -> Estimates:
    """Read what `write_estimates` wrote; further columns, as older files have, are ignored.

    Raises
    ------
    UserError
        Where columns or views are missing, or an estimate is not in [0, 360).
    """
    frame = read_csv(path)
    need_columns(path, frame, COLUMNS)
    object_ids = objects_of_full_turns(path, frame, "azimuth_deg")
    need_azimuths(path, frame, ("estimate_deg",))
    estimate_deg = frame["estimate_deg"].to_numpy(dtype=np.float64)
    return Estimates(object_ids, estimate_deg.reshape(len(object_ids), -1))


def objects_of_full_turns(
    path: str | Path, frame: pd.DataFrame, azimuth_column: str
) -> tuple[str, ...]:
    """Return the objects of a table that has a row for each view of a full turn of each object.

    Raises
    ------
    UserError
        Where the rows are not one object after the other, or the azimuths of an object are not
        0, 360 / n_views, ….
    """
    object_ids = tuple(frame["object_id"].drop_duplicates())
    n_views, odd = divmod(len(frame), len(object_ids))
    azimuth_deg = np.tile(np.arange(n_views) * (360.0 / n_views), len(object_ids))
    if (
        odd
        or not np.array_equal(frame[azimuth_column].to_numpy(), azimuth_deg)
        or not np.array_equal(frame["object_id"], np.repeat(object_ids, n_views))
    ):
        raise damaged(path, "not a full turn of equally spaced views of each object")
    return object_ids


def need_azimuths(path: str | Path, frame: pd.DataFrame, columns: Iterable[str]) -> None:
    """Raise UserError where a column holds anything but numbers in [0, 360)."""
    for name in columns:
        with readable(path):
            values = frame[name].to_numpy(dtype=np.float64)
        # Written so that NaN is refused as well.
        wrong = ~((values >= 0.0) & (values < 360.0))
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise damaged(path, f"{name}={values[row]} in row {row + 1} is not in [0, 360)")
