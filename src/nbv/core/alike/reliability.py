"""Recalibration of the expected error after one view, by isotonic regression."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.core.alike.compare import WITHIN_DEG, CalibrationViews
from nbv.core.circle.evidence import Float32Array as Table

FEWEST_OBJECTS = 10
"""Calibration objects from which `observed_error` is more accurate than the expected error."""

N_GROUPS = 24
"""Groups of first views by their expected error."""


def observed_error(
    views: CalibrationViews,
    expected_deg: float,
    power: float,
    pseudo_observations: float,
    share: NDArray[np.floating] | None = None,
) -> NDArray[np.float64]:
    """Return the mean error and the probabilities of `WITHIN_DEG` given an expected error, (4,).

    A kernel regression is shrunk towards the mean: it overestimates small errors and underestimates
    large ones. So the expected errors of calibration views, by the sweeps of all other objects, are
    compared with the errors of these views: by isotonic regression over `N_GROUPS` groups of first
    views, linear between the groups' means.

    The calibration views are those after one view, and `expected_deg` is the ``now_deg`` of
    `nbv.core.alike.expected.expected_errors`, whose arguments the others are.
    """
    of_sweep = np.ones(len(views.first)) if share is None else np.asarray(share, np.float64)
    key = power, pseudo_observations, of_sweep.tobytes()
    # Only the last curves: a moving camera has another elevation, and share, in each frame.
    if views.cache.get("key") != key:
        views.cache.update(
            {"key": key, "curves": _curves(views, power, pseudo_observations, of_sweep)}
        )
    expected, *curves = views.cache["curves"]
    return np.array([np.interp(expected_deg, expected, curve) for curve in curves])


def _curves(
    views: CalibrationViews, power: float, pseudo_observations: float, of_sweep: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the groups' mean expected errors, then the regressions of what happened, (5, n)."""
    from scipy.optimize import isotonic_regression

    n_first = views.first.shape[1]
    n_rotations = views.roots.shape[2]
    of_view = np.repeat(of_sweep * (360.0 / n_first), n_first)
    both = np.stack([of_view * views.outcomes[..., n_rotations].reshape(-1), of_view], axis=1)
    near = _weights_between(views, power) @ both.astype(np.float32)
    of_object = views.is_of_object @ both.reshape(len(of_sweep), n_first, 2).sum(axis=1)
    others = (of_object.sum(axis=0) - of_object)[_objects(views)]
    alpha = max(pseudo_observations, float(np.finfo(np.float32).tiny))
    expected = (near[:, 0] + alpha * others[:, 0] / others[:, 1]) / (near[:, 1] + alpha)
    order = expected.argsort(kind="stable")
    # Groups of equal weight.
    middle = of_view[order].cumsum() - of_view[order] / 2
    group = np.minimum(N_GROUPS * middle / of_view.sum(), N_GROUPS - 1).astype(np.intp)
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    error = views.error_now_deg.reshape(-1)
    within = [error <= limit for limit in WITHIN_DEG]
    rows = np.column_stack([expected, error, *within, np.ones(len(error))])
    sums = np.add.reduceat(of_view[order, None] * rows[order], starts, axis=0)
    means = (sums[:, :-1] / sums[:, -1:]).T
    # The larger the error, the less likely a small one.
    regressions = (
        isotonic_regression(curve, weights=sums[:, -1], increasing=place == 0).x
        for place, curve in enumerate(means[1:])
    )
    return np.stack([means[0], *regressions])


def _objects(views: CalibrationViews) -> NDArray[np.intp]:
    """Return the object of each first view, (S K,)."""
    return np.repeat(views.is_of_object.argmax(axis=0), views.first.shape[1])


def _weights_between(views: CalibrationViews, power: float) -> Table:
    """Return the weight of each first view for each other, 0 within an object, (S K, S K)."""
    if views.cache.get("power") != power:
        roots, objects = views.roots.reshape(views.first.size, -1), _objects(views)
        weights = (roots @ roots.T) ** np.float32(power)
        weights *= objects[:, None] != objects
        views.cache.update({"power": power, "weights": weights})
    weights = views.cache["weights"]
    return np.asarray(weights)
