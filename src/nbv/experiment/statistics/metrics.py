"""Pose-error metrics and their uncertainty. Pure functions of errors in degrees.

An error is the circular distance of an estimated pose from the true one, in [0, 180] degrees.
The 360 views of one object share its shape and are not independent, so every interval here
resamples whole objects, with the same resampled objects for every method that is compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PAUC_LIMIT_DEG = 100.0
"""Upper end of the thresholds that the pAUC integrates over (Tables 3 and 4 of the paper)."""

FRONT_BACK_DEG = 90.0
"""Errors above this angle confuse front and back rather than being inaccurate."""


def accuracy_area(errors_deg: ArrayLike) -> Floats:
    """Return the contribution of each image to the pAUC, in percent, in [0, 100]."""
    return PAUC_LIMIT_DEG - np.minimum(np.asarray(errors_deg, dtype=np.float64), PAUC_LIMIT_DEG)


def above_90(errors_deg: ArrayLike) -> Floats:
    """Return the contribution of each image to the share of errors above 90°: 0 or 100 percent."""
    return np.where(np.asarray(errors_deg) > FRONT_BACK_DEG, 100.0, 0.0)


_MEDIAN_GRID = 1001


@dataclass(frozen=True)
class Interval:
    """A value with the ends of its 95 % interval, all in the same unit."""

    value: float
    low: float
    high: float

    def columns(self, name: str, ends: str = "") -> dict[str, float]:
        """Return the columns of a tidy table: ``name``, ``<ends>_low`` and ``<ends>_high``.

        The ends are named after `ends` (``ci`` for a value), by default after `name`.
        """
        ends = ends or name
        return {name: self.value, f"{ends}_low": self.low, f"{ends}_high": self.high}


def pea(errors_deg: ArrayLike, thresholds_deg: ArrayLike) -> Floats:
    """Return the pose estimation accuracy at each threshold (Eq. 10).

    The fraction of images, in [0, 1], whose error is strictly below the threshold: PEA(0) is 0
    even for perfect estimates. Higher is better. Do not compare methods at one threshold chosen
    after the fact; use the whole curve or the pAUC.

    Errors (n_images,) are circular distances in [0, 180]; the result has the thresholds' shape.
    """
    ordered = np.sort(_non_empty(errors_deg))
    below = np.searchsorted(ordered, np.asarray(thresholds_deg))
    return np.asarray(below / ordered.size)


PER_IMAGE: Mapping[str, Callable[[ArrayLike], Floats]] = {
    "mae": lambda errors_deg: np.asarray(errors_deg, dtype=np.float64),
    "pauc": accuracy_area,
    "above_90_percent": above_90,
}
"""The contribution of each image to the statistics that are means over images."""


def statistic_of(errors_deg: ArrayLike, name: str) -> float:
    """Return a statistic of the errors of images; pool the images of all folds before.

    ``mae``: the mean absolute error, degrees (Eq. 8). A few errors near 180 degrees (front taken
    for back) move it a great deal; read it together with the PEA or the median.
    ``median``: the median error, degrees (Fig. 9).
    ``pauc``: the area under PEA from 0 to 100 degrees, in percent of its largest value (Eq. 10).
    Exactly ``100 - mean(min(error, 100))``: integrating the step of one image from 0 to 100 leaves
    the part of the range above its error. Many published values are lower than this can be; see
    `nbv.experiment.paper.published`.
    ``above_90_percent``: the share of errors above 90 degrees, percent: front and back are
    confused. Averaging opposite estimates can split one error of 180 degrees into two of 90.

    Lower is better, but for the pAUC. Raise ValueError if there are no errors. Those (n_images,)
    are circular distances in [0, 180].
    """
    errors = _non_empty(errors_deg)
    return float(np.median(errors) if name == "median" else np.mean(PER_IMAGE[name](errors)))


def fold_std(values: ArrayLike) -> float:
    """Return the sample standard deviation (ddof = 1) of one value per fold, in its unit.

    The paper's sigma. It measures how much folds differ (which objects happen to be tested), not
    the uncertainty of the average: for that use an interval over objects. NaN for fewer than two
    folds.
    """
    folds = np.asarray(values, dtype=np.float64)
    return float(np.std(folds, ddof=1)) if folds.size > 1 else float("nan")


def resample_objects(n_objects: int, rng: np.random.Generator, n_resamples: int) -> Ints:
    """Draw n_objects objects with replacement: how often each, (n_resamples, n_objects)."""
    drawn = rng.integers(n_objects, size=(n_resamples, n_objects))
    rows = np.arange(n_resamples)[:, None] * n_objects
    counts = np.bincount((drawn + rows).ravel(), minlength=n_resamples * n_objects)
    return counts.reshape(n_resamples, n_objects).astype(np.int64)


def resampled_means(values: ArrayLike, objects: Ints, multiplicities: Ints) -> Floats:
    """Return the mean over images in each resample of the objects, (n_resamples,).

    Values and objects (n_images,) are those of the images; the multiplicities are from
    `resample_objects`. NaN where no image was drawn. Per-object sums and counts suffice, so this
    costs two small matrix products.
    """
    n_objects = multiplicities.shape[1]
    sums = np.bincount(objects, weights=np.asarray(values, dtype=np.float64), minlength=n_objects)
    counts = np.bincount(objects, minlength=n_objects).astype(np.float64)
    weights = multiplicities.astype(np.float64)
    drawn = weights @ counts
    means = np.full(drawn.shape, np.nan)
    np.divide(weights @ sums, drawn, out=means, where=drawn > 0)
    return means


def resampled_medians(values: ArrayLike, objects: Ints, multiplicities: Ints) -> Floats:
    """Return the median over images in each resample of the objects, as `resampled_means` does.

    Read from a grid of 1,001 pooled quantiles, so exact to one thousandth in rank: far finer than
    the spread of the resamples, and a matrix product instead of a sort for each resample.
    """
    flat = np.asarray(values)
    grid = np.quantile(flat, np.linspace(0.0, 1.0, _MEDIAN_GRID), method="inverted_cdf")
    n_objects = multiplicities.shape[1]
    cell = objects * _MEDIAN_GRID + np.searchsorted(grid, flat)
    histogram = np.bincount(cell, minlength=n_objects * _MEDIAN_GRID)
    up_to = np.cumsum(histogram.reshape(n_objects, _MEDIAN_GRID), axis=1)
    reached = multiplicities.astype(np.float64) @ up_to
    total = reached[:, -1:]
    medians = grid[np.argmax(reached >= total / 2, axis=1)]
    return np.where(total[:, 0] > 0, medians, np.nan)


def percentile_interval(samples: ArrayLike, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval of bootstrap samples; NaN samples are ignored."""
    finite = np.asarray(samples, dtype=np.float64)
    finite = finite[np.isfinite(finite)]
    if finite.size == 0:
        return float("nan"), float("nan")
    low, high = np.quantile(finite, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def _non_empty(errors_deg: ArrayLike) -> Floats:
    errors = np.asarray(errors_deg, dtype=np.float64)
    if errors.size == 0:
        raise ValueError("no errors to summarise")
    return errors
