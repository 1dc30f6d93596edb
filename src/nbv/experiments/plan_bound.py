"""How much a choice of plan can gain at most: picked with other trainings, scored with one.

The plan of least error under one training is no bound that a robot could hope for: a part of what
it picks is the chance of that training. So the plan of each object and first view is picked by the
mean error under all other trainings, none of which had the object among its training objects, and
scored by the training at hand. What is left is what the object itself says about the plan.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from studies.kept_estimates import HeldOut, KeptKey

from nbv.core.evidence import Table
from nbv.core.plans import spaced_errors_deg, spacing_bins

EVENLY_SPACED: Final = "evenly_spaced"
BEST_OF_OTHERS: Final = "best_of_others"
BEST_OF_OWN: Final = "best_of_own"

COLUMNS = ("shuffle", "replicate", "choice", "fusion", "n_views", "object_id", "error_deg")


def plan_bounds(
    held: Mapping[KeptKey, HeldOut], n_views: int, min_separation_deg: float
) -> pd.DataFrame:
    """Return each object's error under the plan that would have been best for each first view.

    Plans have equal steps and travel no farther than evenly spaced views; with two views they are
    all rotations of ``min_separation_deg`` or more (`nbv.core.plans.spacing_bins`). Views
    are fused by product.

    Parameters
    ----------
    held : mapping
        Test objects of one category and elevation with distributions, of all folds of two trainings
        or more. Every training has the same objects.
    n_views : int
        The most views of a plan; 2 or more.
    min_separation_deg : float

    Returns
    -------
    DataFrame
        Columns `COLUMNS`: means over first views, degrees. The choices are ``evenly_spaced``,
        ``best_of_others`` (picked by the mean of all other trainings) and ``best_of_own`` (picked
        and scored by the same training, which is too hopeful).

    Raises
    ------
    ValueError
        Where there is one training alone.
    """
    trainings = sorted({key[:2] for key in held})
    if len(trainings) < 2:
        raise ValueError("what other trainings pick needs two trainings or more")
    views = [_views_of_objects(held, training) for training in trainings]
    object_ids = sorted(views[0])
    distributions = [np.stack([of[name] for name in object_ids]) for of in views]
    parts = []
    for n in range(2, n_views + 1):
        spacings = spacing_bins(n, distributions[0].shape[-1], min_separation_deg)
        errors = np.stack([spaced_errors_deg(of, n, spacings) for of in distributions])
        choices = {
            EVENLY_SPACED: errors[:, 0],
            BEST_OF_OTHERS: picked_by_others(errors),
            BEST_OF_OWN: errors.min(axis=1),
        }
        for choice, of_views in choices.items():
            for training, means in zip(trainings, of_views.mean(axis=-1), strict=True):
                values = (*training, choice, "product", n, object_ids, means)
                parts.append(pd.DataFrame(dict(zip(COLUMNS, values, strict=True))))
    return pd.concat(parts, ignore_index=True)


def picked_by_others(errors: Table) -> Table:
    """Return the error of the plan of least mean error under all other trainings.

    Parameters
    ----------
    errors : ndarray (n_trainings, n_plans, ...)
        Two trainings or more.

    Returns
    -------
    ndarray (n_trainings, ...)
        Of each training, under the plan that the others pick; of equal ones the first.
    """
    others = errors.sum(axis=0) - errors
    picked = others.argmin(axis=1)
    return np.asarray(np.take_along_axis(errors, picked[:, None], axis=1)[:, 0])


def _views_of_objects(
    held: Mapping[KeptKey, HeldOut], training: tuple[int, int]
) -> dict[str, NDArray[np.float64]]:
    """Return the distributions (B, B) of each test object of one training."""
    found: dict[str, NDArray[np.float64]] = {}
    for key, one in held.items():
        if key[:2] == training and one.posteriors is not None:
            found |= dict(zip(one.object_ids, one.posteriors.distributions, strict=True))
    return found
