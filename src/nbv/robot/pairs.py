"""Calibration pairs of any estimator: true azimuths, estimates and distributions, from files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import signed_difference_deg, wrap_deg
from nbv.core.distributions import rotated
from nbv.core.estimates import COLUMNS, Estimates
from nbv.core.logits import LEAST_PROBABILITY
from nbv.core.offset import FOR_PAIRS, Offset
from nbv.errors import UserError
from nbv.files import read_numbers, read_rows

FEWEST_CLASSES = 8

SUM_TOLERANCE = 0.05
"""How far a row's sum may be from 1: rounded probabilities are normalised again."""

WIDEST_GAP_DEG = 15.0
"""Between neighbouring views of a calibration turn."""

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
            Where the file cannot be read, a column is missing, or a value is not a number.
        """
        path = Path(path)
        rows = read_rows(path, COLUMNS, _OF_FRAMES)
        for name in COLUMNS[1:]:
            rows[name] = pd.to_numeric(rows[name], errors="coerce")
            if not (finite := np.isfinite(rows[name].to_numpy(dtype=np.float64))).all():
                raise UserError(
                    f"{path}, row {int((~finite).argmax()) + 2}: {name} is not a number"
                )
        if "elevation_deg" in rows:
            rows["elevation_deg"] = pd.to_numeric(rows["elevation_deg"], errors="coerce")
        return cls(path, rows)

    def for_unit(self, category: str, elevation_deg: float) -> PairTable:
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
            ids = [self.for_unit(category, one).estimates.object_ids for one in elevations]
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
