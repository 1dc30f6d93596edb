"""Linear estimators on depth features: ridge regression of azimuths, and softmax regression.

Where a category has a vertical plane of symmetry at the azimuth m, the features of an image are
their even and their odd part (`nbv.experiment.estimation.features.Features.of_both`), and a mirror
image shows the azimuth 2 m - a instead of a. The cosine of a - m is then regressed on the even part
and the sine on the odd part, which is the same as averaging an image's estimate with that of its
mirror image.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import safetensors.numpy
from numpy.typing import NDArray

from nbv.core.circle.angles import mirrored_bins
from nbv.core.circle.logits import log_softmax
from nbv.experiment.estimation.outputs import Outputs, Settings, Targets, class_targets
from nbv.experiment.splits import (
    calibration_roles,
    check_objects,
    objects_with_role,
    training_roles,
)
from nbv.files import replacing

Floats = NDArray[np.float64]
Rows = NDArray[np.float32]

PENALTIES = tuple(10.0**exponent for exponent in range(-5, 2))
"""Squared-norm penalties, as multiples of the features' mean variance."""

N_PARTS = 5
"""Parts of the training objects. The penalty is the one with the least error on left-out parts."""

CLASS_PENALTY = 1e-8
"""Penalty of `fit_classes`, nats per image: the likeliest for calibration objects of mugs."""
CLASS_STEP = 4
"""`fit_classes` takes every fourth view, because neighbouring views are similar."""
N_ITERATIONS = 60
START_SHARPNESS = 10.0
"""Initial logits, as a multiple of the cosine between a class and the regression's direction."""


@dataclass(frozen=True)
class LinearEstimator:
    """An affine map from features to outputs.

    Attributes
    ----------
    weights : ndarray (D, k)
    bias : ndarray (k,)
    penalty : float
        The penalty of the fit.
    """

    weights: Floats
    bias: Floats
    penalty: float

    def outputs(self, features: Rows) -> Outputs:
        """Return the outputs (..., k) of features (..., D)."""
        flat = features.reshape(-1, features.shape[-1]) @ self.weights.astype(np.float32)
        return np.asarray(flat.reshape(*features.shape[:-1], -1) + self.bias, dtype=np.float64)

    def save(self, path: str, settings: Settings, trained_on: Sequence[str]) -> None:
        """Write a `.safetensors` file, with the estimator's settings and its training objects."""
        tensors = {"weights": self.weights, "bias": self.bias, "penalty": np.array(self.penalty)}
        history = {"settings": dict(settings), "trained_on": list(trained_on)}
        metadata = {"nbv": json.dumps(history, sort_keys=True)}
        with replacing(path) as temporary:
            temporary.write_bytes(safetensors.numpy.save(tensors, metadata=metadata))


def fit_fold(
    features: NDArray[np.float16],
    object_ids: Sequence[str],
    splits: pd.DataFrame,
    fold: int,
    settings: Settings,
    mirror_plane_deg: float | None,
) -> tuple[LinearEstimator, dict[str, tuple[list[str], Outputs]]]:
    """Fit a fold's estimator, and return it with its outputs for what it has not seen.

    Where calibration is cross-fitted, the outputs of each part are those of a fit to the others.

    The outputs are, for each role ``calibration`` and ``test``, the objects and (m, n_views, k).

    Parameters
    ----------
    features : ndarray (n, n_views, D)
        Features of the sweeps of the n objects of the category.
    settings, mirror_plane_deg
        See `fit_linear`.

    Raises
    ------
    UserError
        Where the objects differ from those in the splits.
    """
    check_objects(splits, object_ids)
    row_of = {object_id: row for row, object_id in enumerate(object_ids)}

    def of(names: Sequence[str]) -> Rows:
        return features[[row_of[name] for name in names]].astype(np.float32)

    def fit(without: int | None = None) -> LinearEstimator:
        names = objects_with_role(splits, fold, *training_roles(splits, without=without))
        return fit_linear(of(names), settings, mirror_plane_deg)

    fitted, held_out = fit(), calibration_roles(splits)
    names: list[str] = []
    outputs = []
    for part, role in enumerate(held_out, start=1):
        estimator = fitted if held_out == ("calibration",) else fit(without=part)
        names += (in_part := objects_with_role(splits, fold, role))
        outputs.append(estimator.outputs(of(in_part)))
    test = objects_with_role(splits, fold, "test")
    return fitted, {
        "calibration": (names, np.concatenate(outputs)),
        "test": (test, fitted.outputs(of(test))),
    }


def fit_linear(
    features: Rows, settings: Settings, mirror_plane_deg: float | None
) -> LinearEstimator:
    """Fit the kind of estimator that ``settings["kind"]`` names to training objects.

    `features` (n, n_views, D) are those of their sweeps; even and odd parts where there is a plane
    of symmetry, at the azimuth `mirror_plane_deg`.
    """
    if settings["kind"] == "linear":
        return fit_directions(features, mirror_plane_deg)
    return fit_classes(features, settings, mirror_plane_deg)


def fit_directions(features: Rows, mirror_plane_deg: float | None) -> LinearEstimator:
    """Fit (cos, sin) of the azimuth by ridge regression; see `fit_linear`."""
    n_views, n_features = features.shape[1:]
    if mirror_plane_deg is None:
        azimuth = 2 * np.pi * np.arange(n_views) / n_views
        return _ridge(features, np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1))
    plane = np.radians(mirror_plane_deg)
    azimuth = 2 * np.pi * np.arange(n_views) / n_views - plane
    half = n_features // 2
    even = _ridge(features[..., :half], np.cos(azimuth)[:, None])
    odd = _ridge(features[..., half:], np.sin(azimuth)[:, None], has_bias=False)
    along, across = (np.array([[np.cos(a), np.sin(a)]]) for a in (plane, plane + np.pi / 2))
    return LinearEstimator(
        np.concatenate([even.weights @ along, odd.weights @ across]),
        even.bias @ along,
        even.penalty,
    )


def _ridge(features: Rows, targets: Floats, *, has_bias: bool = True) -> LinearEstimator:
    """Regress targets (n_views, k), whose mean is 0, on features (n, n_views, D) of n objects."""
    n_views, n_features = features.shape[1:]
    n_parts = min(N_PARTS, len(features))
    parts = [features[part::n_parts] for part in range(n_parts)]
    grams = np.stack([_gram(part.reshape(-1, n_features)) for part in parts])
    sums = np.stack([part.sum(axis=(0, 1), dtype=np.float64) for part in parts])
    products = np.stack([part.sum(axis=0, dtype=np.float64).T @ targets for part in parts])
    counts = np.array([len(part) * n_views for part in parts], dtype=np.float64)

    def fit(kept: Sequence[int], penalty: float) -> LinearEstimator:
        n = counts[kept].sum()
        mean = sums[kept].sum(axis=0) / n * has_bias
        scatter = grams[kept].sum(axis=0) - n * np.outer(mean, mean)
        scatter[np.diag_indices(n_features)] += penalty * np.trace(scatter) / n_features
        weights = np.linalg.solve(scatter, products[kept].sum(axis=0))
        return LinearEstimator(weights, -mean @ weights, penalty)

    def squared_error(fitted: LinearEstimator, part: int) -> float:
        """Sum over the images of a part, apart from the targets' own squares."""
        w, b = fitted.weights, fitted.bias
        quadratic = ((grams[part] @ w) * w).sum(axis=0) + 2 * b * (sums[part] @ w)
        return float((quadratic + counts[part] * b**2 - 2 * (products[part] * w).sum(axis=0)).sum())

    def left_out_error(penalty: float) -> float:
        others = [[k for k in range(n_parts) if k != part] for part in range(n_parts)]
        return sum(squared_error(fit(kept, penalty), part) for part, kept in enumerate(others))

    best = PENALTIES[-1] if n_parts == 1 else min(PENALTIES, key=left_out_error)
    return fit(range(n_parts), best)


def _gram(rows: Rows) -> Floats:
    return np.asarray(rows.T @ rows, dtype=np.float64)


def fit_classes(
    features: Rows, settings: Settings, mirror_plane_deg: float | None
) -> LinearEstimator:
    """Fit a logit for each class by penalised maximum likelihood; see `fit_linear`.

    `settings` has ``n_classes`` and ``target_bandwidth_deg``; see
    `nbv.experiment.estimation.outputs.class_targets`.
    """
    n_features, n_classes = features.shape[-1], settings["n_classes"]
    x = features[:, ::CLASS_STEP].reshape(-1, n_features)
    y = np.tile(class_targets(settings, features.shape[1])[::CLASS_STEP], (len(features), 1))
    if mirror_plane_deg is not None:
        sign = np.repeat(np.array([1, -1], dtype=np.float32), n_features // 2)
        mirrored = mirrored_bins(n_classes, mirror_plane_deg)
        x, y = np.concatenate([x, x * sign]), np.concatenate([y, y[:, mirrored]])
    start = fit_directions(features, mirror_plane_deg)
    return _softmax_regression(x, y, start)


def _softmax_regression(x: Rows, y: Targets, start: LinearEstimator) -> LinearEstimator:
    """Fit logits to the targets' distributions, from the directions of `start` on."""
    from scipy.optimize import minimize

    n_rows, n_features, n_classes = len(x), x.shape[1], y.shape[1]
    penalty = CLASS_PENALTY / float(np.square(x, dtype=np.float64).mean())
    centres = 2 * np.pi * np.arange(n_classes) / n_classes
    unit = np.stack([np.cos(centres), np.sin(centres)])

    def unpacked(flat: Floats) -> tuple[Floats, Floats]:
        return flat[n_classes:].reshape(n_features, n_classes), flat[:n_classes]

    def loss(flat: Floats) -> tuple[float, Floats]:
        weights, bias = unpacked(flat)
        log_p = log_softmax(x @ weights.astype(np.float32) + bias.astype(np.float32))
        apart = (np.exp(log_p) - y) / np.float32(n_rows)
        value = (
            -float((y * log_p).sum(dtype=np.float64)) / n_rows + penalty * np.square(weights).sum()
        )
        slope = x.T @ apart + 2 * penalty * weights
        return value, np.concatenate([apart.sum(axis=0), slope.ravel()]).astype(np.float64)

    first = np.concatenate([start.bias @ unit, (start.weights @ unit).ravel()]) * START_SHARPNESS
    solution = minimize(loss, first, jac=True, method="L-BFGS-B", options={"maxiter": N_ITERATIONS})
    weights, bias = unpacked(solution.x)
    return LinearEstimator(weights, bias, CLASS_PENALTY)
