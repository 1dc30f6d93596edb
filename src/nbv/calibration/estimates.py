"""Estimates on disk: one row for every view of every object."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.files import read_csv, write_csv

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
        Where columns or views are missing.
    """
    frame = read_csv(path)
    missing = set(COLUMNS) - set(frame.columns)
    if missing:
        raise UserError(f"{path}: column {sorted(missing)[0]!r} is missing")
    object_ids = tuple(frame["object_id"].drop_duplicates())
    n_views, odd = divmod(len(frame), max(len(object_ids), 1))
    azimuth = np.tile(np.arange(n_views) * (360.0 / max(n_views, 1)), len(object_ids))
    if odd or not np.array_equal(frame["azimuth_deg"].to_numpy(), azimuth):
        raise UserError(f"{path}: not a full turn of equally spaced views of each object")
    estimate_deg = frame["estimate_deg"].to_numpy(dtype=np.float64)
    return Estimates(object_ids, estimate_deg.reshape(len(object_ids), n_views))
