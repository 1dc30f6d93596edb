"""Files of estimates and distributions for sweeps of objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from nbv.core.circle.estimates import COLUMNS, Estimates, Posteriors
from nbv.errors import UserError
from nbv.files import (
    check_columns,
    check_distributions,
    damaged,
    read_arrays,
    read_csv,
    readable,
    write_arrays,
    write_csv,
)

FoldEstimates = Mapping[str, tuple[Estimates, Posteriors | None]]
"""Estimates by role, ``calibration`` and ``test``; posteriors only of estimators that give them."""


def write_estimates(path: str | Path, estimates: Estimates) -> None:
    """Write estimates as a table with the columns `COLUMNS`."""
    n_objects, n_views = estimates.estimate_deg.shape
    columns = (
        np.repeat(np.asarray(estimates.object_ids, dtype=object), n_views),
        np.tile(estimates.azimuth_deg.astype(int), n_objects),
        # 359.99999 is rounded to 360.0, which is 0.
        (np.round(estimates.estimate_deg, 4) % 360.0).ravel(),
    )
    write_csv(path, pd.DataFrame(dict(zip(COLUMNS, columns, strict=True))))


def read_estimates(path: str | Path) -> Estimates:
    """Read a file of `write_estimates`; additional columns are ignored.

    Raise UserError where columns or views are missing, or an estimate is not in [0, 360).
    """
    frame = read_csv(path)
    check_columns(path, frame, COLUMNS)
    object_ids = sweep_objects(path, frame, "azimuth_deg")
    check_azimuths(path, frame, ("estimate_deg",))
    estimate_deg = frame["estimate_deg"].to_numpy(dtype=np.float64)
    return Estimates(object_ids, estimate_deg.reshape(len(object_ids), -1))


def sweep_objects(path: str | Path, frame: pd.DataFrame, azimuth_column: str) -> tuple[str, ...]:
    """Return the objects of a table with one row for every view of a full sweep.

    Raise UserError where the rows are not one object after the other, or the azimuths of an object
    are not 0, 360 / n_views, ….
    """
    object_ids = tuple(frame["object_id"].drop_duplicates())
    n_views, odd = divmod(len(frame), len(object_ids))
    azimuth_deg = np.tile(np.arange(n_views) * (360.0 / n_views), len(object_ids))
    if (
        odd
        or not np.array_equal(frame[azimuth_column].to_numpy(), azimuth_deg)
        or not np.array_equal(frame["object_id"], np.repeat(object_ids, n_views))
    ):
        raise damaged(path, "an object has no full sweep of equally spaced views")
    return object_ids


def check_azimuths(path: str | Path, frame: pd.DataFrame, columns: Iterable[str]) -> None:
    """Raise UserError where a column holds values other than numbers in [0, 360)."""
    for name in columns:
        with readable(path):
            values = frame[name].to_numpy(dtype=np.float64)
        # Written so that NaN is refused as well.
        wrong = ~((values >= 0.0) & (values < 360.0))
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            raise damaged(path, f"{name}={values[row]} in row {row + 1} is not in [0, 360)")


def write_posteriors(path: str | Path, posteriors: Posteriors) -> None:
    """Write distributions, with their logs as float32."""
    write_arrays(
        path,
        {
            "object_ids": np.asarray(posteriors.object_ids, dtype=np.str_),
            "log_posterior": posteriors.log_posterior.astype(np.float32),
            "temperature": np.asarray(posteriors.temperature),
        },
    )


def read_posteriors(path: str | Path, object_ids: Sequence[str]) -> Posteriors:
    """Read a file of `write_posteriors`.

    Raise UserError where the file is damaged, or its objects or their order differ from those
    given.
    """
    stored = read_arrays(path, ("object_ids", "log_posterior", "temperature"))
    names = tuple(str(name) for name in stored["object_ids"])
    if names != tuple(object_ids):
        raise UserError(f"{path}: its objects differ from those of the estimates; make both again")
    with readable(path):
        posteriors = Posteriors(names, stored["log_posterior"], float(stored["temperature"]))
        _, n_views, n_classes = posteriors.log_posterior.shape
        stored_p = np.exp(posteriors.log_posterior.astype(np.float64))
        check_distributions(path, stored_p, (len(names), n_views, n_classes))
        if not 0.0 < posteriors.temperature < np.inf:
            raise damaged(path, f"the temperature {posteriors.temperature} is not positive")
    return posteriors


def write_fold(paths: Mapping[str, str], estimates: FoldEstimates) -> None:
    """Write a fold's estimates by role, with posteriors where there are any.

    Paths are those of ``calibration`` and ``test``, and where there are posteriors those of
    ``calibration_posteriors`` and ``test_posteriors``.
    """
    for role, (azimuths, posteriors) in estimates.items():
        write_estimates(paths[role], azimuths)
        if posteriors is not None:
            write_posteriors(paths[f"{role}_posteriors"], posteriors)
