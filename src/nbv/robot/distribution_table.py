"""What the distributions of any estimator, on calibration objects, say of its next ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.logits import TEMPERATURES, fit_temperature, from_logits, on_degrees
from nbv.core.lookup import LookupTable
from nbv.errors import UserError
from nbv.files import (
    calibrated_file,
    damaged,
    need_distributions,
    read_arrays,
    readable,
    write_arrays,
)
from nbv.labels import counted
from nbv.robot.next_view import (
    AfterRotations,
    Recommendation,
    after_rotations,
    as_rotation_list,
    next_view,
)
from nbv.robot.pairs import FEWEST_CLASSES, as_distributions, bin_apart

AFFINITY: Mapping[str, float] = {"power": 16.0, "pseudo_observations": 90.0}
"""What `config/` sets for the expected error given a distribution."""

WIDEST_BIN_DEG = 6.0
"""Of a table: an estimator errs by up to half a class between its classes."""

_AGAIN = "make it again with nbv calibrate"

_PREFIX = "distribution."
_NAMES = tuple(_PREFIX + name for name in ("object_ids", "temperature", "n_classes", "of_views"))


@dataclass(frozen=True)
class DistributionTable:
    """The distributions that an estimator gave of calibration objects.

    `recommend` does for distributions of any estimator what `nbv.Recommender` does for frames.

    Attributes
    ----------
    object_ids : tuple of str
        Of each of S calibration turns: which object it shows.
    temperature : float
        p^(1/T) is calibrated; above 1 the estimator was too sure of itself.
    distributions : ndarray (S, B, B) float32
        Calibrated p(azimuth | image) of views a bin apart.
    n_classes : int
        Of the estimator; B is the least multiple of it whose bins are at most `WIDEST_BIN_DEG`. So
        views between two classes count with the error that they have.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> apart = np.radians(np.subtract.outer(np.arange(36) * 10.0, np.arange(36) * 10.0))
    >>> turn = np.exp(4 * np.cos(apart))
    >>> turn[:9] = turn[4]  # from these views every answer is the same
    >>> turn /= turn.sum(axis=1, keepdims=True)
    >>> table = nbv.DistributionTable.of_pairs({"mug-17": (np.arange(36) * 10.0, turn)})
    >>> answer = table.recommend(turn[4])
    >>> answer.move.expected_error_deg < answer.expected_error_deg
    True
    """

    object_ids: tuple[str, ...]
    temperature: float
    distributions: NDArray[np.float32]
    n_classes: int

    @classmethod
    def of_pairs(cls, turns: Mapping[str, tuple[ArrayLike, ArrayLike]]) -> DistributionTable:
        """Return the table of calibration objects.

        Parameters
        ----------
        turns : mapping of str to (azimuth_deg, probabilities)
            For each object the true azimuths (n,) of its views, and what the estimator gave of
            them: (n, B), where class k is the azimuth 360 k / B. Views are 15° apart or closer.

        Raises
        ------
        UserError
            Where views are farther apart, probabilities are no distributions, or objects have
            different numbers of classes.

        Examples
        --------
        >>> import numpy as np, nbv
        >>> azimuths = np.arange(24) * 15.0
        >>> rows = np.exp(4 * np.cos(np.radians(azimuths - azimuths[:, None])))
        >>> rows /= rows.sum(axis=1, keepdims=True)
        >>> table = nbv.DistributionTable.of_pairs({"mug-17": (azimuths, rows)})
        >>> table.object_ids, table.n_classes
        (('mug-17',), 24)
        """
        known = {name: _as_turn(name, *turn) for name, turn in turns.items()}
        n_classes, *others = widths = {rows.shape[1] for _, rows in known.values()}
        if others:
            raise UserError(f"objects have {sorted(widths)} classes; give all the same number")
        temperature = fit_temperature(
            np.log(np.concatenate([rows for _, rows in known.values()])),
            np.concatenate([azimuth for azimuth, _ in known.values()]),
        )
        turned, n_bins = [], _n_bins(n_classes)
        for name, (azimuth, rows) in known.items():
            try:
                turned.append(bin_apart(azimuth, _in_bins(rows, temperature, n_bins)))
            except UserError as error:
                raise error.about(f"object {name!r}") from error
        return cls(tuple(known), temperature, np.stack(turned), n_classes)

    @property
    def warning(self) -> str:
        """What may be wrong with the calibration objects; empty where nothing is.

        Examples
        --------
        >>> import numpy as np, nbv
        >>> azimuths = np.arange(24) * 15.0
        >>> rows = np.exp(4 * np.cos(np.radians(azimuths - azimuths[:, None])))
        >>> rows /= rows.sum(axis=1, keepdims=True)
        >>> table = nbv.DistributionTable.of_pairs({"mug-17": (azimuths, rows)})
        >>> table.warning.split(":")[0]  # this estimator is always right
        'the temperature 0.05 is at its limit'
        """
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
        """Return the pose that views show, and the next view.

        Parameters
        ----------
        probabilities : (B,), or (n, B)
            What the estimator gave of each view of the object.
        rotations_deg, allowed_deg, max_travel_deg, followed
            See `nbv.Recommender.recommend`.

        Returns
        -------
        Recommendation
            No frame was seen: `unfamiliarity` is NaN, and there are no crops.

        Raises
        ------
        UserError
            Where probabilities are no distributions of this estimator, or the arguments do not fit
            each other.

        Examples
        --------
        >>> import numpy as np, nbv
        >>> azimuths = np.arange(24) * 15.0
        >>> rows = np.exp(4 * np.cos(np.radians(azimuths - azimuths[:, None])))
        >>> rows /= rows.sum(axis=1, keepdims=True)
        >>> table = nbv.DistributionTable.of_pairs({"mug-17": (azimuths, rows)})
        >>> answer = table.recommend([rows[3], rows[9]], rotations_deg=[0, 90])
        >>> round(answer.azimuth_deg), answer.n_views  # of the last view
        (135, 2)
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
        """Read what `save`, or ``nbv calibrate`` of pairs with distributions, wrote.

        Raises
        ------
        UserError
            Where the file cannot be read, or has no such table.

        Examples
        --------
        >>> import nbv
        >>> try:
        ...     nbv.DistributionTable.load("table.npz")
        ... except nbv.UserError as error:
        ...     print(error)
        table.npz does not exist; name the file that nbv calibrate wrote
        """
        stored = read_arrays(calibrated_file(path), (), _AGAIN)
        if any(name not in stored for name in _NAMES):
            raise UserError(
                f"{path} holds no distributions: make it with nbv calibrate, of pairs that have "
                "columns p0, p1, …"
            )
        with readable(path, _AGAIN):
            object_ids, temperature, n_classes, rows = (stored[name] for name in _NAMES)
            n_bins = rows.shape[-1]
            need_distributions(path, rows, (len(object_ids), n_bins, n_bins), _AGAIN)
            least, most = TEMPERATURES
            if not len(rows) or not (rows > 0).all() or not least <= float(temperature) <= most:
                what = "its distributions or their temperature are out of range"
                raise damaged(path, what, _AGAIN)
            if n_classes.shape or n_classes < FEWEST_CLASSES or _n_bins(int(n_classes)) != n_bins:
                what = "its number of classes does not fit its distributions"
                raise damaged(path, what, _AGAIN)
            return cls(tuple(map(str, object_ids)), float(temperature), rows, int(n_classes))

    def save(self, path: str | Path, lookup: LookupTable | None = None) -> None:
        """Write the table as ``.npz``; with a lookup table of the same estimator, both in one file.

        Examples
        --------
        >>> import tempfile, numpy as np, nbv
        >>> azimuths = np.arange(24) * 15.0
        >>> rows = np.exp(4 * np.cos(np.radians(azimuths - azimuths[:, None])))
        >>> rows /= rows.sum(axis=1, keepdims=True)
        >>> table = nbv.DistributionTable.of_pairs({"mug-17": (azimuths, rows)})
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table.save(f"{folder}/table.npz")
        ...     nbv.DistributionTable.load(f"{folder}/table.npz").object_ids
        ('mug-17',)
        """
        numbers = np.asarray(self.temperature), np.asarray(self.n_classes)
        kept = np.asarray(self.object_ids), *numbers, self.distributions
        arrays = dict(zip(_NAMES, kept, strict=True))
        if lookup is None:
            write_arrays(path, arrays)
        else:
            lookup.save(path, arrays)


def _n_bins(n_classes: int) -> int:
    return n_classes * math.ceil(360.0 / (n_classes * WIDEST_BIN_DEG))


def _in_bins(rows: NDArray[np.float64], temperature: float, n_bins: int) -> NDArray[np.float64]:
    """Return calibrated distributions (n, B), linear between the centres of classes (n, k)."""
    calibrated = from_logits(np.log(rows), temperature)
    return calibrated if n_bins == rows.shape[1] else on_degrees(calibrated, n_bins)


def _as_turn(
    name: str, azimuth_deg: ArrayLike, probabilities: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows = as_distributions(probabilities, f"object {name!r}")
    try:
        azimuths = np.asarray(azimuth_deg, dtype=np.float64)
    except (TypeError, ValueError):
        raise UserError(f"object {name!r}: azimuths are no numbers") from None
    if azimuths.shape != (len(rows),) or not np.isfinite(azimuths).all():
        raise UserError(
            f"object {name!r}: azimuths of shape {azimuths.shape} for "
            f"{counted(len(rows), 'view')}; give one number of degrees for each"
        )
    return azimuths, rows
