"""Intervals for the variation of both objects and trainings.

Every training meets every object (as a test object of one of its folds), so objects and trainings
are crossed, and an error is ``mean + object + training + remainder``. The variance of the mean
over both is estimated by the mean squares of a two-way analysis of variance (Cornfield and Tukey,
1956) and its degrees of freedom by Satterthwaite (1946). A bootstrap of objects and trainings would
be too narrow with five trainings (docs/method.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from nbv.experiment.statistics.metrics import Interval

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mean:
    """A mean over objects and trainings, with its uncertainty.

    Attributes
    ----------
    value : float
    variance : float
        Variance of the value over other objects and trainings; NaN for a single object.
    degrees_of_freedom : float
        Degrees of freedom of the variance.
    n_objects, n_trainings : int
    """

    value: float
    variance: float
    degrees_of_freedom: float
    n_objects: int
    n_trainings: int

    def interval(self, level: float = 0.95) -> Interval:
        """Return the interval by Student's t."""
        quantile = stats.t.ppf((1.0 + level) / 2.0, self.degrees_of_freedom)
        half = float(quantile * np.sqrt(self.variance))
        return Interval(self.value, self.value - half, self.value + half)

    @property
    def p_value(self) -> float:
        """The two-sided p-value of a mean of 0; 1 where all values are 0."""
        if self.variance == 0.0:
            return float(self.value == 0.0)
        t = abs(self.value) / np.sqrt(self.variance)
        return float(2.0 * stats.t.sf(t, self.degrees_of_freedom))


def crossed_mean(*tables: ArrayLike, equal_categories: bool = False) -> Mean:
    """Return the mean of one quantity over crossed objects and trainings.

    Parameters
    ----------
    *tables : array-like (n_trainings, n_objects)
        An object's mean error under a training, or the difference between two methods' errors. One
        table per category, all with the same trainings: objects vary within their category, and
        categories may share the variation between trainings.
    equal_categories : bool
        Give all categories equal weight, instead of all objects.

    Returns
    -------
    Mean
        With one training, the variance is over objects only.

    Raises
    ------
    ValueError
        Where a table is not a finite, non-empty matrix, or tables have different numbers of
        trainings.
    """
    arrays = [np.asarray(table, dtype=np.float64) for table in tables]
    for table in arrays:
        if table.ndim != 2 or not table.size or not np.isfinite(table).all():
            raise ValueError("crossed_mean needs a finite value for each training and object")
    by_training = training_means(arrays, equal_categories)
    n_trainings, n_objects = len(by_training), sum(table.shape[1] for table in arrays)
    mean = float(by_training.mean())
    if min(table.shape[1] for table in arrays) == 1:
        nan = float("nan")
        return Mean(mean, nan, nan, n_objects, n_trainings)
    trainings = _spread(by_training) / n_trainings
    # By category: contributions of mean squares to the variance of the mean, and their freedom.
    objects, remainders = [], []
    for table in arrays:
        n = table.shape[1]
        share = (1 / len(arrays) if equal_categories else n / n_objects) ** 2
        object_means = table.mean(axis=0)
        objects.append((share * _spread(object_means) / n, n - 1))
        left = table - object_means - table.mean(axis=1, keepdims=True) + table.mean()
        cells = (n_trainings - 1) * (n - 1)
        square = float((left**2).sum() / cells) if cells else 0.0
        remainders.append((share * square / table.size, cells))
    object_variance, remainder = (sum(term for term, _ in terms) for terms in (objects, remainders))
    if n_trainings == 1:
        freedom = _freedom(object_variance, objects)
        return Mean(mean, object_variance, freedom, n_objects, 1)
    variance = max(object_variance + trainings - remainder, object_variance, trainings)
    freedom = _freedom(variance, [*objects, (trainings, n_trainings - 1), *remainders])
    # The remainder is subtracted, so the rule can fall below the freedom of the scarcer factor.
    least = min(n_trainings, *(table.shape[1] for table in arrays)) - 1.0
    return Mean(mean, variance, max(freedom, least), n_objects, n_trainings)


def training_means(tables: Sequence[Floats], equal_categories: bool = False) -> Floats:
    """Return the mean of each training, (n_trainings,); see `crossed_mean`."""
    if len({len(table) for table in tables}) > 1:
        raise ValueError("all categories need the same trainings")
    if equal_categories:
        return np.asarray(np.mean([table.mean(axis=1) for table in tables], axis=0))
    return np.asarray(np.concatenate(tables, axis=1).mean(axis=1))


def predicted_by_others(tables: Sequence[Floats]) -> list[Interval]:
    """Return the mean of each training with the 95 % interval predicted by the others.

    The prediction interval of one more training of the same objects: the mean of the others, and
    Student's t of their spread times sqrt(1 + 1 / their number). If trainings vary normally, 95 %
    of all means lie inside.

    Parameters
    ----------
    tables : sequence of ndarray (n_trainings, n_objects)
        See `crossed_mean`.

    Returns
    -------
    list of Interval
        Empty with fewer than three trainings.
    """
    means = training_means(tables)
    predictions = []
    for k in range(len(means) if len(means) > 2 else 0):
        others = np.delete(means, k)
        half = stats.t.ppf(0.975, len(others) - 1) * others.std(ddof=1)
        half *= np.sqrt(1 + 1 / len(others))
        centre = others.mean()
        predictions.append(Interval(float(means[k]), float(centre - half), float(centre + half)))
    return predictions


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Return p-values adjusted for their number (Holm, 1979), to compare with 0.05.

    The k-th least of n is multiplied by n - k + 1, and none is less than the one before it. NaN
    stays NaN and does not count.
    """
    known = [name for name, p in p_values.items() if not np.isnan(p)]
    ordered = sorted(known, key=lambda name: p_values[name])
    adjusted: dict[str, float] = {}
    highest = 0.0
    for rank, name in enumerate(ordered):
        highest = max(highest, min((len(ordered) - rank) * p_values[name], 1.0))
        adjusted[name] = highest
    return {name: adjusted.get(name, float("nan")) for name in p_values}


def _spread(means: Floats) -> float:
    return float(np.var(means, ddof=1)) if means.size > 1 else 0.0


def _freedom(variance: float, terms: Sequence[tuple[float, float]]) -> float:
    """Return Satterthwaite's degrees of freedom for a sum of (variance, freedom) terms."""
    total = sum(term**2 / freedom for term, freedom in terms if term)
    return variance**2 / total if total else 1.0
