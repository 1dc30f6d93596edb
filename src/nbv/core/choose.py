"""Costs and decisions shared by azimuths and orientations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError, nearest

ANY_VIEW_SHARE = 0.99
"""Share of the expected error now, or of the mean of all views: 1 % less is worth no move."""

T = TypeVar("T")
Table = NDArray[np.floating]


def named(kind: str, name: str, registry: Mapping[str, T]) -> T:
    """Return the entry of a registry of a `kind`, such as a criterion.

    Raises
    ------
    UserError
        For an unknown name, with the nearest one.
    """
    if name not in registry:
        raise UserError(f"{kind} {name!r} is unknown: {nearest(name, registry)}")
    return registry[name]


def entropy(p: Table) -> Table:
    """Return the entropy along the last axis in nats, with 0 log 0 = 0 (Eq. 1)."""
    logs = np.log(np.maximum(p, np.finfo(np.float32).tiny))
    return np.asarray(-np.einsum("...j,...j->...", p, logs), dtype=p.dtype)


def mixed(belief: Table, first: Table, second: Table) -> Table:
    """Return the mixture of products of two factors (Eqs. 3 and 6), (..., n, m).

    Parameters
    ----------
    belief : ndarray (..., n, k)
        Weights of the k products.
    first, second : ndarray, broadcasting to (..., k, m)
        A product of factors that exclude each other is uniform.
    """
    product = first * second
    total = product.sum(axis=-1)
    impossible = total <= 0
    if impossible.any():
        product[impossible] = 1.0 / product.shape[-1]
        total[impossible] = 1.0
    return np.asarray((belief / total[..., None, :]) @ product)


def expected_entropy(prior: Table, noise: Table, predicted: Table) -> Table:
    """Return the expected entropy of the pose after the next estimate, by the chain rule.

    It is H(pose) + H(estimate | pose) - H(estimate), so that no posterior has to be computed:
    `prior` is the belief's entropy, `noise` the expected one of the next estimate given the pose
    (nats), and `predicted` (..., m) the distribution of the next estimate under the belief.
    """
    return prior + noise - entropy(predicted)


def with_pseudo_observations(sums: Table, mean: Table | float, alpha: float) -> Table:
    """Return weighted sums plus those of `alpha` (0 or more) pseudo-observations of a mean."""
    # The mean remains where nothing has a weight, even for an alpha of 0.
    return sums + max(alpha, float(np.finfo(np.float32).tiny)) * mean


def least_cost(cost: Table, travel: Table) -> NDArray[np.intp]:
    """Return the index of the least of costs (..., k); among equals, that of the least travel (k,).

    Then the first.
    """
    order = np.argsort(travel, kind="stable")
    return np.asarray(order[np.argmin(cost[..., order], axis=-1)])


def is_surely_less(
    gaps: ArrayLike, factor: float, weights: ArrayLike | None = None, prior: float = 0.0
) -> bool:
    """Return whether a mean gap is below 0 by more than `factor` standard errors over objects.

    Parameters
    ----------
    gaps : array-like (n,)
        Difference of each object, or its weighted sum.
    factor : float
    weights : array-like (n,), optional
        Weight of each object in the sums; 1 without it. The standard error is that of a ratio of
        sums, which is 0 for a single object.
    prior : float
        Further gap without uncertainty, as of pseudo-observations.
    """
    gaps = np.asarray(gaps, dtype=np.float64)
    n = len(gaps)
    share = np.ones(n) if weights is None else np.asarray(weights)
    mean = gaps.sum() / max(share.sum(), np.finfo(float).tiny)
    squares = np.square(gaps - mean * share).sum()
    error = np.sqrt(squares * n / max(n - 1, 1))
    return bool(gaps.sum() + prior + factor * error < 0.0)
