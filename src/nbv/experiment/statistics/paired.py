"""Errors of several methods on the same images or objects, and statistics with paired intervals.

Tables and claims take their figures from here, so both state the same value and interval.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.experiment.statistics import metrics
from nbv.experiment.statistics.metrics import PER_IMAGE, Floats, Interval, Ints, statistic_of

VIEWPOINT_GROUPS: Mapping[int, tuple[int, int]] = {
    1: (315, 45),
    2: (45, 135),
    3: (135, 225),
    4: (225, 315),
}
"""The first azimuth of each group in degrees, and the first after the group (Fig. 8)."""


def viewpoint_group(azimuth_deg: NDArray[np.float64]) -> Ints:
    """Return the groups, 1 to 4, of azimuths in [0, 360) (Fig. 8: quarters centred on 0)."""
    return (np.floor(np.mod(azimuth_deg + 45.0, 360.0) / 90.0)).astype(np.int64) + 1


@dataclass(frozen=True)
class PairedErrors:
    """Errors in degrees, image by image, of several methods on the same images.

    Attributes
    ----------
    errors_deg : mapping of str to (n_images,) float
        One array per method, all in the same order of images.
    objects : (n_images,) int
        The object in each image, in [0, n_objects).
    folds : (n_images,) int
        The fold in which it was tested, from 1.
    initial_deg : (n_images,) float
        Azimuth of the initial viewpoint.
    category_of : (n_objects,) tuple of str
        Each object's category; the objects of one category follow one another, sorted by name.
    """

    errors_deg: Mapping[str, Floats]
    objects: Ints
    folds: Ints
    initial_deg: Floats
    category_of: tuple[str, ...]

    def select(self, mask: NDArray[np.bool_]) -> PairedErrors:
        """Return the errors on the images of `mask`; objects keep their indices."""
        return PairedErrors(
            {method: errors[mask] for method, errors in self.errors_deg.items()},
            self.objects[mask],
            self.folds[mask],
            self.initial_deg[mask],
            self.category_of,
        )

    @property
    def n_objects(self) -> int:
        """Number of objects with at least one image."""
        return int(np.unique(self.objects).size)

    @property
    def n_images(self) -> int:
        """Number of images."""
        return int(self.objects.size)


def pair_methods(frame: pd.DataFrame, category: str) -> PairedErrors:
    """Line up the methods of one unit (of `results.load_evaluations`) image by image.

    Raise UserError if the methods were not evaluated on the same images.
    """
    key = ["fold", "object_id", "initial_deg"]
    errors: dict[str, Floats] = {}
    images: pd.DataFrame | None = None
    for method, part in frame.groupby("method", observed=True, sort=False):
        ordered = part.sort_values(key, ignore_index=True)
        if images is None:
            images = ordered[key]
        elif not images.equals(ordered[key]):
            raise UserError(
                f"{category}: {method} was evaluated on other images than {next(iter(errors))}; "
                "evaluate both again"
            )
        errors[str(method)] = ordered["error_deg"].to_numpy(dtype=np.float64)
    if images is None:
        raise UserError(f"{category}: no evaluated method; evaluate one first")
    names, codes = np.unique(images["object_id"].to_numpy(dtype=str), return_inverse=True)
    return PairedErrors(
        errors,
        codes.astype(np.int64),
        images["fold"].to_numpy(dtype=np.int64),
        images["initial_deg"].to_numpy(dtype=np.float64),
        (category,) * len(names),
    )


def pool(parts: Sequence[PairedErrors]) -> PairedErrors:
    """Join the images of several categories; the methods are those that all categories have."""
    shared = [m for m in parts[0].errors_deg if all(m in part.errors_deg for part in parts)]
    offsets = np.cumsum([0, *(len(part.category_of) for part in parts)])
    return PairedErrors(
        {m: np.concatenate([part.errors_deg[m] for part in parts]) for m in shared},
        np.concatenate([p.objects + o for p, o in zip(parts, offsets, strict=False)]),
        np.concatenate([part.folds for part in parts]),
        np.concatenate([part.initial_deg for part in parts]),
        tuple(category for part in parts for category in part.category_of),
    )


def fewest_resampled(statistic: str, sample: PairedErrors) -> int:
    """Return the size of the smallest stratum that `estimate` resamples.

    Objects are resampled within their category, and for σ within their fold as well.
    """
    objects, images = np.unique(sample.objects, return_index=True)
    strata = [sample.category_of[i] for i in objects]
    if statistic.endswith("_sigma"):
        strata = [f"{fold} {name}" for fold, name in zip(sample.folds[images], strata, strict=True)]
    return int(np.unique(strata, return_counts=True)[1].min(initial=objects.size))


@dataclass
class Resampler:
    """Object resamples, drawn once per category and shared by all comparisons.

    The draws depend on the seed and the category's name alone, so a table and a claim about the
    same unit give the same interval.
    """

    seed: int
    n_resamples: int = 2000
    _drawn: dict[tuple[str, int, int], Ints] = field(default_factory=dict, repr=False)

    @classmethod
    def seeded(cls, rng: np.random.Generator, n_resamples: int) -> Resampler:
        """Take the seed from a generator."""
        return cls(int(rng.integers(2**31)), n_resamples)

    def multiplicities(self, sample: PairedErrors) -> Ints:
        """Return (n_resamples, n_objects) draws, resampling within each category."""
        sizes = Counter(sample.category_of)
        return np.concatenate([self._draw(name, size, 0) for name, size in sizes.items()], axis=1)

    def multiplicities_by_fold(self, sample: PairedErrors) -> Ints:
        """Return (n_resamples, n_objects) draws, resampling within each fold's test objects.

        For statistics that compare folds: no resample may lose a fold.
        """
        drawn = np.zeros((self.n_resamples, len(sample.category_of)), dtype=np.int64)
        for fold in np.unique(sample.folds):
            members = np.unique(sample.objects[sample.folds == fold])
            category = sample.category_of[int(members[0])]
            drawn[:, members] = self._draw(category, members.size, int(fold))
        return drawn

    def _draw(self, category: str, n_objects: int, fold: int) -> Ints:
        key = (category, n_objects, fold)
        if key not in self._drawn:
            rng = np.random.default_rng([self.seed, zlib.crc32(category.encode()), fold])
            self._drawn[key] = metrics.resample_objects(n_objects, rng, self.n_resamples)
        return self._drawn[key]


STATISTICS = ("mae", "pauc", "above_90_percent", "median", "mae_sigma", "pauc_sigma")
"""The statistics of `estimate`."""

LOWER_IS_BETTER: Mapping[str, bool] = {name: name != "pauc" for name in STATISTICS}
UNIT_OF: Mapping[str, str] = {
    name: "\u00a0%" if "pauc" in name or "percent" in name else "°" for name in STATISTICS
}


@dataclass(frozen=True)
class Estimate:
    """A statistic of one method: its value, and its value in each resample of the objects."""

    value: float
    samples: Floats

    def interval(self) -> Interval:
        """Return the value with its 95 % interval."""
        return Interval(self.value, *metrics.percentile_interval(self.samples))

    def minus(self, other: Estimate) -> Interval:
        """Return the paired difference with its 95 % interval (the same resamples on both)."""
        low, high = metrics.percentile_interval(self.samples - other.samples)
        return Interval(self.value - other.value, low, high)


def estimate(statistic: str, sample: PairedErrors, method: str, resampler: Resampler) -> Estimate:
    """Return a statistic of one method's errors and its object resamples.

    Raise ValueError if there are no images.

    Parameters
    ----------
    statistic : str
        ``mae`` or ``median`` (degrees), ``pauc`` or ``above_90_percent`` (percent), or
        ``mae_sigma`` and ``pauc_sigma``: the standard deviation over folds.
    """
    errors, pooled = sample.errors_deg[method], statistic.removesuffix("_sigma")
    if pooled != statistic:
        return _estimate_sigma(pooled, sample, method, resampler)
    value, drawn = statistic_of(errors, statistic), resampler.multiplicities(sample)
    if statistic == "median":
        return Estimate(value, metrics.resampled_medians(errors, sample.objects, drawn))
    values = PER_IMAGE[statistic](errors)
    return Estimate(value, metrics.resampled_means(values, sample.objects, drawn))


def fold_sigma(statistic: str, sample: PairedErrors, method: str) -> float:
    """Return σ over folds of the statistic (a mean over images) of one method."""
    errors, folds = sample.errors_deg[method], np.unique(sample.folds)
    return metrics.fold_std([statistic_of(errors[sample.folds == f], statistic) for f in folds])


def _estimate_sigma(
    statistic: str, sample: PairedErrors, method: str, resampler: Resampler
) -> Estimate:
    folds = [sample.folds == fold for fold in np.unique(sample.folds)]
    if len(folds) < 2:
        return Estimate(float("nan"), np.full(resampler.n_resamples, np.nan))
    values = PER_IMAGE[statistic](sample.errors_deg[method])
    drawn = resampler.multiplicities_by_fold(sample)
    means = [metrics.resampled_means(values[f], sample.objects[f], drawn) for f in folds]
    return Estimate(fold_sigma(statistic, sample, method), np.std(means, axis=0, ddof=1))
