"""Calibration pairs of any estimator, from a CSV file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.angles import signed_difference_deg, wrap_deg
from nbv.core.estimates import COLUMNS, Estimates
from nbv.core.offset import FOR_PAIRS, Offset
from nbv.errors import UserError
from nbv.files import read_rows
from nbv.robot.pair_distributions import (
    FEWEST_CLASSES,
    WIDEST_GAP_DEG,
    class_columns,
    distributions_of_rows,
    radians_hint,
    widest_gap_deg,
)

N_VIEWS = 360

_OF_FRAMES = "; frames need a `bundle`, such as mug, and an `output` that ends in .safetensors"

Turns = dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
"""For each object the azimuths (n,) of its views, and their distributions (n, B)."""


@dataclass(frozen=True)
class PairTable:
    """Calibration pairs: true azimuths, estimates, and perhaps distributions.

    Attributes
    ----------
    path : Path
        The file, for messages.
    rows : DataFrame
        Columns ``object_id, azimuth_deg, estimate_deg``, and as text ``p0, p1, …, p<B-1>`` where
        the file has them: ``p<k>`` is the probability of the azimuth 360 k / B. The index counts
        the rows of the file from 0.
    """

    path: Path
    rows: pd.DataFrame

    @classmethod
    def load(cls, path: str | Path) -> PairTable:
        """Read a CSV file of pairs, in any order.

        Raises
        ------
        UserError
            Where the file cannot be read, a column is missing, or a value is no number.
        """
        path = Path(path)
        rows = read_rows(path, COLUMNS, _OF_FRAMES)
        for name in COLUMNS[1:]:
            rows[name] = pd.to_numeric(rows[name], errors="coerce")
            if not (finite := np.isfinite(rows[name].to_numpy(dtype=np.float64))).all():
                raise UserError(f"{path}, row {int((~finite).argmax()) + 2}: {name} is no number")
        if "elevation_deg" in rows:
            rows["elevation_deg"] = pd.to_numeric(rows["elevation_deg"], errors="coerce")
        return cls(path, rows)

    def of_unit(self, category: str, elevation_deg: float) -> PairTable:
        """Return the rows of a category and an elevation, where columns tell them apart.

        Raises
        ------
        UserError
            Where no row is left.
        """
        rows = self.rows
        for name, wanted in (("category", category), ("elevation_deg", elevation_deg)):
            if name in rows:
                rows = rows[rows[name] == wanted]
                if rows.empty:
                    raise UserError(f"{self.path} has no rows with {name}={wanted}")
        return replace(self, rows=rows)

    @property
    def estimates(self) -> Estimates:
        """Estimates of views one degree apart, objects in the order of the file.

        A view that the file does not have takes the error of the nearest one that it has.

        Raises
        ------
        UserError
            Where an object has two views at one azimuth, or views are farther apart than
            `WIDEST_GAP_DEG`.
        """
        turns = {
            str(name): _object_turn(self.path, str(name), rows)
            for name, rows in self.rows.groupby("object_id", sort=False)
        }
        return Estimates(tuple(turns), np.stack(list(turns.values())))

    @property
    def distributions(self) -> Turns:
        """Distributions of each object's views; empty where the file has none.

        Raises
        ------
        UserError
            Where a column is missing between others, or a row is no distribution.
        """
        if not class_columns(self.path, self.rows):
            return {}
        probabilities = distributions_of_rows(self.path, self.rows)
        azimuth_deg = self.rows["azimuth_deg"].to_numpy(dtype=np.float64)
        objects = self.rows["object_id"].to_numpy()
        return {
            str(name): (azimuth_deg[objects == name], probabilities[objects == name])
            for name in dict.fromkeys(objects)
        }

    @property
    def offset(self) -> Offset:
        """What all estimates have in common."""
        azimuth_deg, estimate_deg = (
            self.rows[name].to_numpy(dtype=np.float64) for name in COLUMNS[1:]
        )
        return Offset.of(azimuth_deg, estimate_deg, FOR_PAIRS)

    def objects(self, elevations_deg: Mapping[str, Sequence[int]]) -> dict[str, list[str]]:
        """Return the ids of the objects in each category.

        Parameters
        ----------
        elevations_deg : mapping of str to sequence of int
            The elevations in each category.

        Raises
        ------
        UserError
            Where a column is missing that tells categories or elevations apart, an object is
            missing at an elevation, and as in `estimates`.
        """
        several = {
            "category": ("categories", len(elevations_deg)),
            "elevation_deg": ("elevations", max(map(len, elevations_deg.values()))),
        }
        for name, (what, number) in several.items():
            if number > 1 and name not in self.rows:
                raise UserError(
                    f"{self.path} has no column {name!r}, and the run has {number} {what}: add the "
                    "column, or run one (overrides=[categories=[mug],elevations_deg.mug=[0]])"
                )
        found = {}
        for category, elevations in elevations_deg.items():
            ids = [self.of_unit(category, one).estimates.object_ids for one in elevations]
            if missing := set().union(*ids) - set(ids[0]).intersection(*ids):
                raise UserError(
                    f"{self.path}: object {min(missing)!r} has no pairs at some elevation of "
                    f"{category}; give them, or leave the object out"
                )
            found[category] = list(ids[0])
        return found

    def check_classes(self, n_classes: int | None) -> None:
        """Check that the file has columns of `n_classes` probabilities; none without a number.

        Raises
        ------
        UserError
            Where it has another number of them.
        """
        found = len(class_columns(self.path, self.rows))
        if n_classes is None and found:
            may = found >= FEWEST_CLASSES and 360 % found == 0 and found % 2 == 0
            choose = (
                f"choose estimator=external_distributions with estimator.n_classes={found}, or "
            )
            raise UserError(
                f"{self.path} has distributions (p0 to p{found - 1}): {choose if may else ''}leave "
                "these columns out"
            )
        if n_classes is not None and found != n_classes:
            raise UserError(
                f"{self.path} has {found} columns of probabilities (p0, p1, …), and "
                f"estimator.n_classes={n_classes}: "
                + (
                    f"set it to {found}"
                    if found
                    else "choose estimator=external for estimates alone"
                )
            )


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
