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

from nbv.statistics.metrics import Interval

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


def crossed_mean(values: ArrayLike) -> Mean:
    """Return the mean of one figure of each object under each training.

    Parameters
    ----------
    values : array-like (n_trainings, n_objects)
        An object's mean error under a training, or the difference between two methods' errors.

    Returns
    -------
    Mean
        With one training, its variance is over objects alone.

    Raises
    ------
    ValueError
        Where the values are no finite matrix of one row and one column at least.
    """
    table = np.asarray(values, dtype=np.float64)
    if table.ndim != 2 or not table.size or not np.isfinite(table).all():
        raise ValueError("crossed_mean needs a finite value for each training and object")
    n_trainings, n_objects = table.shape
    mean, of_objects, of_trainings = table.mean(), table.mean(axis=0), table.mean(axis=1)
    left = table - of_objects - of_trainings[:, None] + mean
    # Mean squares over the number of values: what each adds to the variance of the mean.
    objects = _spread(of_objects) / n_objects
    trainings = _spread(of_trainings) / n_trainings
    cells = (n_trainings - 1) * (n_objects - 1)
    remainder = float((left**2).sum() / cells / table.size) if cells else 0.0
    if n_trainings == 1:
        return Mean(float(mean), objects, n_objects - 1.0, n_objects, 1)
    if n_objects == 1:
        return Mean(float(mean), float("nan"), float("nan"), 1, n_trainings)
    variance = max(objects + trainings - remainder, objects, trainings)
    terms = [(objects, n_objects - 1), (trainings, n_trainings - 1), (remainder, cells)]
    # The remainder is taken away, so the rule can fall below what the scarcer factor has alone.
    freedom = max(_freedom(variance, terms), min(n_objects, n_trainings) - 1.0)
    return Mean(float(mean), variance, freedom, n_objects, n_trainings)


def pooled_mean(parts: Sequence[Mean]) -> Mean:
    """Return the mean over the objects of several categories, trained and tested apart.

    Categories count by their objects. Their variances add up, for no training is shared.
    """
    sizes = np.array([part.n_objects for part in parts], dtype=np.float64)
    weights = sizes / sizes.sum()
    value = float(weights @ [part.value for part in parts])
    terms = [float(w**2 * part.variance) for w, part in zip(weights, parts, strict=True)]
    freedom = _freedom(
        sum(terms), [(t, part.degrees_of_freedom) for t, part in zip(terms, parts, strict=True)]
    )
    n_trainings = min(part.n_trainings for part in parts)
    return Mean(value, sum(terms), freedom, int(sizes.sum()), n_trainings)


def predicted_by_others(tables: Sequence[Floats]) -> list[Interval]:
    """Return, for each training, its mean and the 95 % interval that the others predict for it.

    The prediction interval of one more training of the same objects: the mean of the others, and
    Student's t of their spread times sqrt(1 + 1 / their number). If trainings vary normally, 95 %
    of all means lie inside.

    Parameters
    ----------
    tables : sequence of ndarray (n_trainings, n_objects)
        Of each category, with the same trainings; categories count by their objects.

    Returns
    -------
    list of Interval
        Empty with fewer than three trainings.
    """
    sizes = np.array([table.shape[1] for table in tables], dtype=np.float64)
    weights = sizes / sizes.sum()
    means = np.stack([table.mean(axis=1) for table in tables], axis=1)
    n_trainings = len(means)
    found = []
    for own in range(n_trainings if n_trainings > 2 else 0):
        others = np.delete(means, own, axis=0)
        terms = weights**2 * others.var(axis=0, ddof=1)
        freedom = _freedom(terms.sum(), [(term, n_trainings - 2.0) for term in terms])
        half = stats.t.ppf(0.975, freedom) * np.sqrt(terms.sum() * (1 + 1 / len(others)))
        centre = weights @ others.mean(axis=0)
        value = float(weights @ means[own])
        found.append(Interval(value, float(centre - half), float(centre + half)))
    return found


def holm(p_values: Mapping[str, float]) -> dict[str, float]:
    """Return p-values adjusted for their number (Holm, 1979): each that is below 0.05 still counts.

    The k-th least of n is multiplied by n - k + 1, and none is less than the one before it.
    """
    ordered = sorted(p_values, key=lambda name: p_values[name])
    adjusted: dict[str, float] = {}
    highest = 0.0
    for place, name in enumerate(ordered):
        highest = max(highest, min((len(ordered) - place) * p_values[name], 1.0))
        adjusted[name] = highest
    return {name: adjusted[name] for name in p_values}


def _spread(means: Floats) -> float:
    return float(np.var(means, ddof=1)) if means.size > 1 else 0.0


def _freedom(variance: float, terms: Sequence[tuple[float, float]]) -> float:
    """Return Satterthwaite's degrees of freedom of a sum of variances with their own."""
    of_terms = sum(term**2 / freedom for term, freedom in terms if term)
    return variance**2 / of_terms if of_terms else 1.0
