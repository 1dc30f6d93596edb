"""Next views for any estimator, from the distributions that it gave of calibration objects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.choice.next_view import (
    AfterRotations,
    Recommendation,
    after_rotations,
    as_rotation_list,
    next_view,
)
from nbv.core.circle.angles import is_angle
from nbv.core.circle.logits import TEMPERATURES, fit_temperature, from_logits, on_degrees
from nbv.core.circle.selection import AFFINITY
from nbv.core.circle.sweeps import bin_apart
from nbv.errors import UserError
from nbv.files import (
    CALIBRATE_AGAIN,
    check_distributions,
    damaged,
    stored_table,
    write_arrays,
)
from nbv.labels import counted
from nbv.tables.lookup import LookupTable
from nbv.tables.pairs import FEWEST_CLASSES, as_distributions

WIDEST_BIN_DEG = 6.0
"""Widest bin of a table, because an estimator errs by up to half a class between its classes."""

_NAMES = tuple(
    f"distribution.{name}" for name in ("object_ids", "temperature", "n_classes", "of_views")
)
"""Names of the arrays in a file; the others in it are those of a lookup table."""


@dataclass(frozen=True)
class DistributionTable:
    """Distributions that an estimator gave of calibration objects.

    `recommend` does for the distributions of any estimator what `nbv.Recommender` does for frames.

    Attributes
    ----------
    object_ids : tuple of str
        The object in each of S calibration sweeps.
    temperature : float
        p^(1/T) is calibrated; above 1 the estimator was overconfident.
    distributions : ndarray (S, B, B) float32
        Calibrated p(azimuth | image) of views a bin apart.
    n_classes : int
        Number of the estimator's classes. B is its least multiple whose bins are at most
        `WIDEST_BIN_DEG` wide, so that views between two classes count with their error.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> azimuths = np.arange(36) * 10.0
    >>> rows = np.exp(4 * np.cos(np.radians(azimuths - azimuths[:, None])))
    >>> rows[:9] = rows[4]  # from these views every answer is the same
    >>> rows /= rows.sum(axis=1, keepdims=True)
    >>> table = nbv.DistributionTable.from_pairs({"mug-17": (azimuths, rows)})
    >>> answer = table.recommend(rows[4])
    >>> answer.move.expected_error_deg < answer.expected_error_deg
    True
    """

    object_ids: tuple[str, ...]
    temperature: float
    distributions: NDArray[np.float32]
    n_classes: int

    @classmethod
    def from_pairs(cls, sweeps: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> DistributionTable:
        """Return the table of calibration objects.

        Parameters
        ----------
        sweeps : mapping of str to (azimuth_deg, probabilities)
            For each object the true azimuths (n,) of its views, at most 15° apart, and the
            estimator's distributions (n, B), where class k is the azimuth 360 k / B.

        Raises
        ------
        UserError
            Where views are farther apart, a row is not a distribution, or objects have different
            numbers of classes.
        """
        known = {name: _as_sweep(name, *sweep) for name, sweep in sweeps.items()}
        n_classes, *others = widths = {rows.shape[1] for _, rows in known.values()}
        if others:
            raise UserError(f"objects have {sorted(widths)} classes; give all the same number")
        temperature = fit_temperature(
            np.log(np.concatenate([rows for _, rows in known.values()])),
            np.concatenate([azimuth for azimuth, _ in known.values()]),
        )
        distributions, n_bins = [], _n_bins(n_classes)
        for name, (azimuth, rows) in known.items():
            try:
                distributions.append(bin_apart(azimuth, _in_bins(rows, temperature, n_bins)))
            except UserError as error:
                raise error.about(f"object {name!r}") from error
        return cls(tuple(known), temperature, np.stack(distributions), n_classes)

    @property
    def warning(self) -> str:
        """A likely mistake in the calibration objects; empty if there is none."""
        least, most = TEMPERATURES
        if 1.1 * least < self.temperature < most / 1.1:
            return ""
        return (
            f"the temperature {self.temperature:.2g} is at its limit: the likeliest class is "
            "always right, or never; calibrate with objects that the estimator was not trained on"
        )

    @cached_property
    def _calibrated(self) -> AfterRotations:
        return after_rotations(self.distributions, self.object_ids)

    def recommend(
        self,
        probabilities: ArrayLike,
        rotations_deg: float | Sequence[float] = (0.0,),
        *,
        allowed_deg: ArrayLike | None = None,
        max_travel_deg: float = 180.0,
        followed: bool = True,
    ) -> Recommendation:
        """Return the estimated pose and the next view.

        Parameters
        ----------
        probabilities : (B,), or (n, B)
            The estimator's distribution of each view of the object.
        rotations_deg, allowed_deg, max_travel_deg, followed
            See `nbv.Recommender.recommend`.

        Returns
        -------
        Recommendation
            Without frames: `ood_score` is NaN, and there are no crops.

        Raises
        ------
        UserError
            Where a row is not a distribution of this estimator, or the arguments do not fit each
            other.
        """
        rows = as_distributions(probabilities, "the views")
        if rows.shape[1] != self.n_classes:
            raise UserError(
                f"{rows.shape[1]} probabilities; calibration objects have {self.n_classes}: give "
                "those of the same estimator"
            )
        return next_view(
            _in_bins(rows, self.temperature, self.distributions.shape[-1]),
            as_rotation_list(rotations_deg, len(rows), "view"),
            self._calibrated,
            AFFINITY,
            allowed_deg=allowed_deg,
            max_travel_deg=max_travel_deg,
            followed=followed,
        )

    @classmethod
    def load(cls, path: str | Path) -> DistributionTable:
        """Read a file of `save`, or of ``nbv calibrate`` for pairs with distributions.

        Raises
        ------
        UserError
            Where the file cannot be read, or has no such table.
        """
        kind = "distributions, which pairs have in columns p0, p1, …"
        with stored_table(path, _NAMES, kind) as stored:
            object_ids, temperature, n_classes, rows = (stored[name] for name in _NAMES)
            n_bins = rows.shape[-1]
            check_distributions(path, rows, (len(object_ids), n_bins, n_bins), CALIBRATE_AGAIN)
            least, most = TEMPERATURES
            if not len(rows) or not (rows > 0).all() or not least <= float(temperature) <= most:
                what = "its distributions or their temperature are out of range"
                raise damaged(path, what, CALIBRATE_AGAIN)
            is_number = n_classes.shape == () and n_classes.dtype.kind in "iu"
            if not is_number or n_classes < FEWEST_CLASSES or _n_bins(int(n_classes)) != n_bins:
                what = "its number of classes does not fit its distributions"
                raise damaged(path, what, CALIBRATE_AGAIN)
            return cls(tuple(map(str, object_ids)), float(temperature), rows, int(n_classes))

    def save(self, path: str | Path, lookup: LookupTable | None = None) -> None:
        """Write the table as ``.npz``, with the lookup table of the same estimator if given."""
        values = (self.object_ids, self.temperature, self.n_classes, self.distributions)
        arrays = {} if lookup is None else lookup.arrays()
        write_arrays(path, arrays | dict(zip(_NAMES, map(np.asarray, values), strict=True)))


def _n_bins(n_classes: int) -> int:
    return n_classes * math.ceil(360.0 / (n_classes * WIDEST_BIN_DEG))


def _in_bins(rows: NDArray[np.float64], temperature: float, n_bins: int) -> NDArray[np.float64]:
    """Return calibrated distributions (n, B), interpolated between the classes of rows (n, k)."""
    calibrated = from_logits(np.log(rows), temperature)
    return calibrated if n_bins == rows.shape[1] else on_degrees(calibrated, n_bins)


def _as_sweep(
    name: str, azimuth_deg: ArrayLike, probabilities: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows = as_distributions(probabilities, f"object {name!r}")
    try:
        azimuths = np.asarray(azimuth_deg, dtype=np.float64)
    except (TypeError, ValueError):
        raise UserError(f"object {name!r}: azimuths are not numbers") from None
    if azimuths.shape != (len(rows),) or not is_angle(azimuths).all():
        raise UserError(
            f"object {name!r}: azimuths of shape {azimuths.shape} for "
            f"{counted(len(rows), 'view')}; give one number of degrees for each"
        )
    return azimuths, rows
