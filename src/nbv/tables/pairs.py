"""Calibration pairs of any estimator: true azimuths, estimates and distributions, from files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import MOST_DEG, wrap_deg
from nbv.core.circle.estimates import COLUMNS, Estimates
from nbv.core.circle.logits import LEAST_PROBABILITY
from nbv.core.circle.offset import FOR_PAIRS, Offset
from nbv.core.circle.sweeps import WIDEST_GAP_DEG, full_sweep, radians_hint, widest_gap_deg
from nbv.errors import UserError
from nbv.files import need_columns, read_numbers, read_rows
from nbv.labels import counted
from nbv.numbers import column

FEWEST_CLASSES = 8

SUM_TOLERANCE = 0.05
"""Tolerance of a row's sum: rounded probabilities are normalised again."""

Sweeps = dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Maps each object to the azimuths (n,) of its views and their distributions (n, B)."""


@dataclass(frozen=True)
class PairTable:
    """Calibration pairs: true azimuths, estimates, and perhaps distributions.

    The rows have ``object_id, azimuth_deg, estimate_deg`` and optionally, as text,
    ``p0, p1, …, p<B-1>``: ``p<k>`` is the probability of the azimuth 360 k / B. Their index counts
    the rows of the file from 0.
    """

    path: Path
    rows: pd.DataFrame

    @classmethod
    def load(cls, path: str | Path) -> PairTable:
        """Read a CSV file of pairs, in any order.

        Raise UserError where the file cannot be read, a column is missing, or a value is empty or
        not an angle.
        """
        return cls.from_rows(path, read_rows(Path(path), COLUMNS))

    @classmethod
    def from_rows(cls, path: str | Path, rows: pd.DataFrame) -> PairTable:
        """Return the pairs of a file's rows, as `load` does."""
        path = Path(path)
        need_columns(path, rows, COLUMNS)
        if (is_empty := rows["object_id"].str.strip() == "").any():
            raise UserError(
                f"{path}, row {int(is_empty.argmax()) + 2}: object_id is empty; give it"
            )
        for name in COLUMNS[1:]:
            rows[name] = column(path, rows, name, limit=MOST_DEG)
        if "elevation_deg" in rows:
            rows["elevation_deg"] = pd.to_numeric(rows["elevation_deg"], errors="coerce")
        return cls(path, rows)

    def for_unit(self, category: str, elevation_deg: float) -> PairTable:
        """Return the rows of a category and an elevation, as far as columns distinguish them.

        Raise UserError where no row is left.
        """
        rows = self.rows
        for name, wanted in (("category", category), ("elevation_deg", elevation_deg)):
            if name in rows:
                rows = rows[rows[name] == wanted]
                if rows.empty:
                    raise UserError(f"{self.path} has no rows with {name}={wanted}; add them")
        return replace(self, rows=rows)

    @property
    def estimates(self) -> Estimates:
        """Estimates of views one degree apart, with objects in the order of the file.

        Views between those of the file have the error of the nearest one. Raise UserError where an
        object has two views at one azimuth, or views are farther apart than `WIDEST_GAP_DEG`.
        """
        for name, rows in self.rows.groupby("object_id", sort=False):
            _check_full_sweep(self.path, str(name), rows["azimuth_deg"].to_numpy(dtype=np.float64))
        return self.thin_estimates[0]

    @property
    def thin_estimates(self) -> tuple[Estimates, tuple[str, ...]]:
        """The same of views at any azimuths, several at one too, and what is thin.

        Raise UserError where azimuths seem to be radians.
        """
        sweeps, gaps = {}, {}
        for name, rows in self.rows.groupby("object_id", sort=False):
            azimuth, estimate = (rows[key].to_numpy(dtype=np.float64) for key in COLUMNS[1:])
            if hint := radians_hint(azimuth):
                gap = widest_gap_deg(azimuth)
                raise UserError(f"{self.path}: object {name!r} leaves a gap of {gap:.0f}°{hint}")
            sweeps[str(name)] = full_sweep(wrap_deg(azimuth), estimate)
            gaps[str(name)] = widest_gap_deg(azimuth)
        warnings = []
        worst = max(gaps, key=gaps.__getitem__)
        if gaps[worst] > WIDEST_GAP_DEG + 1e-6:
            n_wide = sum(gap > WIDEST_GAP_DEG + 1e-6 for gap in gaps.values())
            warnings.append(
                f"{n_wide} of {counted(len(gaps), 'object')} leave gaps above "
                f"{WIDEST_GAP_DEG:g}° between views, {worst!r} one of {gaps[worst]:.0f}°: "
                "inside, the errors of the nearest views are assumed"
            )
        return Estimates(tuple(sweeps), np.stack(list(sweeps.values()))), tuple(warnings)

    @property
    def repeated(self) -> tuple[str, ...]:
        """A warning where one estimate stands out and repeats: a program's word for none."""
        estimate_deg = self.rows["estimate_deg"].to_numpy(dtype=np.float64)
        for strange in (estimate_deg[estimate_deg < 0], estimate_deg[estimate_deg > 360]):
            if len(strange) > 1 and (strange == strange[0]).all():
                return (
                    f"{len(strange)} of {counted(len(estimate_deg), 'estimate')} are exactly "
                    f"{strange[0]:g}, and no other is like them: leave these rows out if it says "
                    "that nothing was detected",
                )
        return ()

    @property
    def distributions(self) -> Sweeps:
        """Distributions of each object's views; empty if the file has none.

        Raise UserError where a column is missing between others, or a row is not a distribution.
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
        """Constant offset of all estimates."""
        azimuth_deg, estimate_deg = (
            self.rows[name].to_numpy(dtype=np.float64) for name in COLUMNS[1:]
        )
        return Offset.of(azimuth_deg, estimate_deg, FOR_PAIRS)

    def objects(self, elevations_deg: Mapping[str, Sequence[int]]) -> dict[str, list[str]]:
        """Return the ids of the objects in each category, given its elevations.

        Raise UserError where the column of categories or elevations is missing, an object is
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
        objects = {}
        for category, elevations in elevations_deg.items():
            ids = [
                self.for_unit(category, elevation).estimates.object_ids for elevation in elevations
            ]
            if missing := set().union(*ids) - set(ids[0]).intersection(*ids):
                raise UserError(
                    f"{self.path}: object {min(missing)!r} lacks pairs at an elevation of "
                    f"{category}; give them, or leave the object out"
                )
            objects[category] = list(ids[0])
        return objects

    def check_classes(self, n_classes: int | None) -> None:
        """Check that the file has `n_classes` columns of probabilities, or none if that is None.

        Raise UserError where the file has another number of them.
        """
        n_columns = len(class_columns(self.path, self.rows))
        if n_classes is None and n_columns:
            is_valid = n_columns >= FEWEST_CLASSES and 360 % n_columns == 0 and n_columns % 2 == 0
            choose = (
                f"choose estimator=external_distributions with estimator.n_classes={n_columns}, or "
            )
            raise UserError(
                f"{self.path} has distributions (p0 to p{n_columns - 1}): "
                f"{choose if is_valid else ''}leave these columns out"
            )
        if n_classes is not None and n_columns != n_classes:
            raise UserError(
                f"{self.path} has {n_columns} columns of probabilities (p0, p1, …), but "
                f"estimator.n_classes={n_classes}: "
                + (
                    f"set it to {n_columns}"
                    if n_columns
                    else "choose estimator=external for estimates alone"
                )
            )


def _check_full_sweep(path: Path, name: str, azimuth_deg: NDArray[np.float64]) -> None:
    values, counts = np.unique(wrap_deg(azimuth_deg), return_counts=True)
    if counts.max() > 1:
        raise UserError(
            f"{path}: object {name!r} has {counts.max()} views at "
            f"{values[counts.argmax()]:g}°; give one, and a separate file for each elevation and "
            "category; only estimator=external distinguishes them by columns"
        )
    if (gap := widest_gap_deg(azimuth_deg)) > WIDEST_GAP_DEG + 1e-6:
        raise UserError(
            f"{path}: the views of object {name!r} leave a gap of {gap:.0f}°; calibration needs a "
            f"view every {WIDEST_GAP_DEG:g}°{radians_hint(azimuth_deg)}"
        )


def as_distributions(
    values: ArrayLike, name: str, numbers: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Return rows (n, B) of probabilities above 0, each with the sum 1.

    Because no image excludes a pose, a probability of 0 is replaced by the smallest other one of
    its row, or by `LEAST_PROBABILITY` if that is less. Raise UserError where the shape is neither
    (n, B) nor (B,), a value is not a probability, or a sum differs from 1 by more than
    `SUM_TOLERANCE`. Messages have the `numbers` (n,) of rows, by default 1, 2, ….
    """
    try:
        given = np.asarray(values)
    except ValueError:
        raise UserError(f"{name}: rows of different lengths; give equal ones") from None
    if given.dtype.kind not in "iuf":
        raise UserError(f"{name}: {given.dtype}; give probabilities as numbers")
    rows = np.atleast_2d(given).astype(np.float64)
    if rows.ndim != 2 or not len(rows) or rows.shape[1] < FEWEST_CLASSES:
        raise UserError(
            f"{name}: probabilities of shape {given.shape}; give a row for each view, with "
            f"{FEWEST_CLASSES} classes or more"
        )
    number = np.arange(1, len(rows) + 1) if numbers is None else np.asarray(numbers)
    is_wrong = ~np.isfinite(rows) | (rows < 0)
    if is_wrong.any():
        row, column = (int(index[0]) for index in np.nonzero(is_wrong))
        raise UserError(
            f"{name}, row {number[row]}, p{column}: a probability is negative or not a number; "
            "give probabilities, not their logarithms"
        )
    sums = rows.sum(axis=1)
    if (far := np.abs(sums - 1.0) > SUM_TOLERANCE).any():
        row = int(far.argmax())
        raise UserError(
            f"{name}, row {number[row]}: probabilities sum to {sums[row]:.3g} instead of 1; give "
            "softmax outputs, with more decimals if they are rounded"
        )
    smallest = np.where(rows > 0, rows, np.inf).min(axis=1, keepdims=True)
    rows = np.where(rows > 0, rows, np.minimum(smallest, LEAST_PROBABILITY))
    return np.asarray(rows / rows.sum(axis=1, keepdims=True))


def read_distributions(path: str | Path) -> NDArray[np.float64]:
    """Read distributions (n, B) of n views: CSV with columns ``p0, p1, …``, or a ``.npy`` array.

    Raise UserError where the file cannot be read or a row is not a distribution.
    """
    path = Path(path)
    if path.suffix.lower() == ".npy":
        return as_distributions(read_numbers(path), str(path))
    return distributions_of_rows(path, read_rows(path, ["p0"]))


def class_columns(path: Path, table: pd.DataFrame) -> list[str]:
    """Return the names of the columns of probabilities in order; empty if there are none.

    Raise UserError where a column is missing between others.
    """
    given = [str(name) for name in table.columns]
    similar = [name for name in given if re.fullmatch(r"p[ _]?\d+", name)]
    wanted = [f"p{number}" for number in range(len(similar))]
    if strange := sorted(set(similar) - set(wanted)):
        raise UserError(
            f"{path}: {len(similar)} columns of probabilities are not p0 to p{len(similar) - 1}: "
            f"rename {strange[0]!r}"
        )
    return wanted


def distributions_of_rows(path: Path, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the distributions (n, B) in the columns ``p0, p1, …`` of a file's rows."""
    texts = table[class_columns(path, table)]
    numbers = texts.apply(pd.to_numeric, errors="coerce").to_numpy(dtype=np.float64)
    return as_distributions(numbers, str(path), table.index.to_numpy() + 2)
