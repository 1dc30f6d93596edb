"""Intervals that contain what varies: objects, and trainings of the same objects.

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
    """A mean over objects and trainings, and how well it is known.

    Attributes
    ----------
    value : float
    variance : float
        Of the value, over other objects and other trainings; NaN for a single object.
    degrees_of_freedom : float
        Of the variance.
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
        """Of a mean of 0, two-sided; 1 where nothing varies about 0."""
        if self.variance == 0.0:
            return float(self.value == 0.0)
        t = abs(self.value) / np.sqrt(self.variance)
        return float(2.0 * stats.t.sf(t, self.degrees_of_freedom))


def crossed_mean(*tables: ArrayLike) -> Mean:
    """Return the mean of one figure of each object under each training.

    Parameters
    ----------
    *tables : array-like (n_trainings, n_objects)
        An object's mean error under a training, or the difference between two methods' errors. Of
        several categories under the same trainings, a table of each: objects vary within their
        category, and categories may share what varies between trainings.

    Returns
    -------
    Mean
        Over all objects alike. With one training, its variance is over objects alone.

    Raises
    ------
    ValueError
        Where a table is no finite matrix of one row and one column at least, or tables have other
        numbers of trainings.
    """
    found = [np.asarray(table, dtype=np.float64) for table in tables]
    for table in found:
        if table.ndim != 2 or not table.size or not np.isfinite(table).all():
            raise ValueError("crossed_mean needs a finite value for each training and object")
    of_training = training_means(found)
    n_trainings, n_objects = len(of_training), sum(table.shape[1] for table in found)
    mean = float(of_training.mean())
    if min(table.shape[1] for table in found) == 1:
        nan = float("nan")
        return Mean(mean, nan, nan, n_objects, n_trainings)
    trainings = _spread(of_training) / n_trainings
    # Of each category: what a mean square adds to the variance of the mean, and its freedom.
    objects, remainders = [], []
    for table in found:
        n = table.shape[1]
        share = (n / n_objects) ** 2
        of_objects = table.mean(axis=0)
        objects.append((share * _spread(of_objects) / n, n - 1))
        left = table - of_objects - table.mean(axis=1, keepdims=True) + table.mean()
        cells = (n_trainings - 1) * (n - 1)
        square = float((left**2).sum() / cells) if cells else 0.0
        remainders.append((share * square / table.size, cells))
    of_objects_all, of_rest = (sum(term for term, _ in terms) for terms in (objects, remainders))
    if n_trainings == 1:
        freedom = _freedom(of_objects_all, objects)
        return Mean(mean, of_objects_all, freedom, n_objects, 1)
    variance = max(of_objects_all + trainings - of_rest, of_objects_all, trainings)
    freedom = _freedom(variance, [*objects, (trainings, n_trainings - 1), *remainders])
    # The remainder is taken away, so the rule can fall below what the scarcer factor has alone.
    least = min(n_trainings, *(table.shape[1] for table in found)) - 1.0
    return Mean(mean, variance, max(freedom, least), n_objects, n_trainings)


def training_means(tables: Sequence[Floats]) -> Floats:
    """Return each training's mean over the objects of all tables, as of `crossed_mean`, (n,)."""
    if len({len(table) for table in tables}) > 1:
        raise ValueError("all categories need the same trainings")
    return np.asarray(np.concatenate(tables, axis=1).mean(axis=1))


def predicted_by_others(tables: Sequence[Floats]) -> list[Interval]:
    """Return, for each training, its mean and the 95 % interval that the others predict for it.

    The prediction interval of one more training of the same objects: the mean of the others, and
    Student's t of their spread times sqrt(1 + 1 / their number). If trainings vary normally, 95 %
    of all means lie inside.

    Parameters
    ----------
    tables : sequence of ndarray (n_trainings, n_objects)
        As of `crossed_mean`.

    Returns
    -------
    list of Interval
        Empty with fewer than three trainings.
    """
    means = training_means(tables)
    found = []
    for own in range(len(means) if len(means) > 2 else 0):
        others = np.delete(means, own)
        half = stats.t.ppf(0.975, len(others) - 1) * others.std(ddof=1)
        half *= np.sqrt(1 + 1 / len(others))
        centre = others.mean()
        found.append(Interval(float(means[own]), float(centre - half), float(centre + half)))
    return found


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Return p-values adjusted for their number (Holm, 1979): each that is below 0.05 still counts.

    The k-th least of n is multiplied by n - k + 1, and none is less than the one before it. What
    is NaN stays it and does not count.
    """
    known = [name for name, p in p_values.items() if not np.isnan(p)]
    ordered = sorted(known, key=lambda name: p_values[name])
    adjusted: dict[str, float] = {}
    highest = 0.0
    for place, name in enumerate(ordered):
        highest = max(highest, min((len(ordered) - place) * p_values[name], 1.0))
        adjusted[name] = highest
    return {name: adjusted.get(name, float("nan")) for name in p_values}


def _spread(means: Floats) -> float:
    return float(np.var(means, ddof=1)) if means.size > 1 else 0.0


def _freedom(variance: float, terms: Sequence[tuple[float, float]]) -> float:
    """Return Satterthwaite's degrees of freedom of a sum of variances with their own."""
    of_terms = sum(term**2 / freedom for term, freedom in terms if term)
    return variance**2 / of_terms if of_terms else 1.0
