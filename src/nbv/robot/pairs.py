"""Calibration pairs of any estimator, from a CSV file."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import signed_difference_deg, wrap_deg
from nbv.core.estimates import COLUMNS, Estimates
from nbv.errors import UserError, reason_of
from nbv.files import missing, read_text

N_VIEWS = 360

_COMPRESSED = (".gz", ".bz2", ".xz", ".zip")

WIDEST_GAP_DEG = 15.0
"""Between neighbouring views of a calibration turn."""


def read_pairs(
    path: str | Path, category: str | None = None, elevation_deg: float | None = None
) -> Estimates:
    """Read calibration pairs: CSV with ``object_id, azimuth_deg, estimate_deg``, in any order.

    Parameters
    ----------
    path : path
    category : str, optional
        Of the rows to read, where the file has a column ``category``.
    elevation_deg : float, optional
        The same of ``elevation_deg``.

    Returns
    -------
    Estimates
        Of views one degree apart, objects in the order of the file. A view that the file does not
        have takes the error of the nearest one that it has.

    Raises
    ------
    UserError
        Where a column is missing, a value is no number, no row is left, or views are farther apart
        than `WIDEST_GAP_DEG`.
    """
    path = Path(path)
    return _estimates(path, read_pair_rows(path, category, elevation_deg))


def _estimates(path: Path, table: pd.DataFrame) -> Estimates:
    turns = {
        str(name): _object_turn(path, str(name), rows)
        for name, rows in table.groupby("object_id", sort=False)
    }
    return Estimates(tuple(turns), np.stack(list(turns.values())))


def read_rows(path: Path, needed: Sequence[str], n_rows: int | None = None) -> pd.DataFrame:
    """Read a user's CSV file, or its first `n_rows`, as text: an object may be called NA.

    Raises
    ------
    UserError
        Where it cannot be read, a column of `needed` is missing, or it has no rows.
    """
    if not path.is_file():
        raise UserError(f"{path} {missing(path)}; name a file with {', '.join(needed)}")
    try:
        source: Path | io.StringIO = path
        if path.suffix not in _COMPRESSED:
            if not (text := read_text(path)).strip():
                raise UserError(f"{path} is empty; it needs {', '.join(needed)}")
            source = io.StringIO(text)
        table = pd.read_csv(source, dtype=str, keep_default_na=False, nrows=n_rows)
    except (OSError, ValueError) as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error
    for name in needed:
        if name not in table:
            hint = "; commas stand between columns" if table.shape[1] == 1 else ""
            raise UserError(f"{path}: no column {name!r}; it needs {', '.join(needed)}{hint}")
    if table.empty:
        raise UserError(f"{path} has no rows")
    return table


def read_pair_rows(
    path: Path, category: str | None = None, elevation_deg: float | None = None
) -> pd.DataFrame:
    """Read the rows of a file of pairs; parameters and errors as of `read_pairs`.

    The index is that of the rows in the file, from 0.
    """
    table = read_rows(path, COLUMNS)
    for name in COLUMNS[1:]:
        table[name] = pd.to_numeric(table[name], errors="coerce")
        if not (finite := np.isfinite(table[name].to_numpy(dtype=np.float64))).all():
            raise UserError(f"{path}, row {int((~finite).argmax()) + 2}: {name} is no number")
    if "elevation_deg" in table:
        table["elevation_deg"] = pd.to_numeric(table["elevation_deg"], errors="coerce")
    return _of_unit(path, table, category, elevation_deg)


def _of_unit(
    path: Path, table: pd.DataFrame, category: str | None, elevation_deg: float | None
) -> pd.DataFrame:
    for name, wanted in (("category", category), ("elevation_deg", elevation_deg)):
        if wanted is not None and name in table:
            table = table[table[name] == wanted]
            if table.empty:
                raise UserError(f"{path} has no rows with {name}={wanted}")
    return table


def objects_of_pairs(
    path: str | Path, elevations_deg: Mapping[str, Sequence[int]]
) -> dict[str, list[str]]:
    """Return the ids of the objects that a file has pairs of, by category.

    Parameters
    ----------
    path : path
    elevations_deg : mapping of str to sequence of int
        Categories, and the elevations of each.

    Raises
    ------
    UserError
        Of `read_pairs`; where a column is missing that tells categories or elevations apart; where
        an object is missing at an elevation.
    """
    path = Path(path)
    table = read_pair_rows(path)
    several = {
        "category": ("categories", len(elevations_deg)),
        "elevation_deg": ("elevations", max(map(len, elevations_deg.values()))),
    }
    for name, (what, number) in several.items():
        if number > 1 and name not in table:
            raise UserError(
                f"{path} has no column {name!r}, and the run has {number} {what}: add the column, "
                "or run one (overrides=[categories=[mug],elevations_deg.mug=[0]])"
            )
    found = {}
    for category, elevations in elevations_deg.items():
        units = [_of_unit(path, table, category, elevation) for elevation in elevations]
        ids = [_estimates(path, unit).object_ids for unit in units]
        if missing := set().union(*ids) - set(ids[0]).intersection(*ids):
            raise UserError(
                f"{path}: object {min(missing)!r} has no pairs at some elevation of {category}; "
                "give them, or leave the object out"
            )
        found[category] = list(ids[0])
    return found


def _object_turn(path: Path, name: str, rows: pd.DataFrame) -> NDArray[np.float64]:
    azimuth_deg, estimate_deg = (rows[key].to_numpy(dtype=np.float64) for key in COLUMNS[1:])
    values, counts = np.unique(wrap_deg(azimuth_deg), return_counts=True)
    if counts.max() > 1:
        raise UserError(
            f"{path}: object {name!r} has {counts.max()} views at "
            f"{values[counts.argmax()]:g}°; give one, and other elevations and categories in "
            "files of their own; only estimator=external tells them apart by columns"
        )
    if (gap := widest_gap_deg(azimuth_deg)) > WIDEST_GAP_DEG + 1e-6:
        raise UserError(
            f"{path}: the views of object {name!r} leave a gap of {gap:.0f}°; calibration needs a "
            f"view every {WIDEST_GAP_DEG:g}°{radians_hint(azimuth_deg)}"
        )
    return full_turn(wrap_deg(azimuth_deg), estimate_deg)


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


def full_turn(
    azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the estimates (360,) of views one degree apart, of views (n,) anywhere on a turn.

    Each view takes the error of the nearest one that there is.
    """
    apart = signed_difference_deg(np.arange(N_VIEWS)[:, None], azimuth_deg)
    nearest = np.abs(apart).argmin(axis=1)
    moved = apart[np.arange(N_VIEWS), nearest]
    return wrap_deg(np.where(moved == 0.0, estimate_deg[nearest], estimate_deg[nearest] + moved))
