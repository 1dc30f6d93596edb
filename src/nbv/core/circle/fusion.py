"""Fusion rules: one pose from two views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import (
    circular_distance_deg,
    direction_deg,
    midpoint_deg,
    nearest_bin,
    wrap_deg,
)
from nbv.core.circle.distributions import (
    in_object_frame,
    mean_direction_deg,
    product_directions_deg,
    product_of,
)
from nbv.core.circle.evidence import Evidence

Angles = NDArray[np.float64]
Bins = NDArray[np.intp]
Rotations = NDArray[np.int64]


def at_second_view(outputs: NDArray[np.float64], delta_deg: Rotations) -> NDArray[np.float64]:
    """Return the outputs of an estimator at the views that rotations lead to.

    Outputs (n_objects, n_views, ...) are the estimates or distributions of all views; view k of n
    has the azimuth 360 k / n. Rotations (n_objects, n_views) are multiples of 360 / n.
    """
    n_objects, n_views = delta_deg.shape
    views = np.arange(n_views) + np.rint(delta_deg * (n_views / 360.0)).astype(np.intp)
    return np.asarray(outputs[np.arange(n_objects)[:, None], views % n_views])


def average(
    first_deg: ArrayLike,
    second_deg: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the circular mean of the first estimate and the second, rotated back (Eq. 7).

    The arithmetic mean that the paper prints fails if the two lie on either side of 0°.

    Parameters
    ----------
    first_deg, second_deg, delta_deg : array-like, broadcasting
        Estimates phi_1 and phi_2 and the rotation between the views, degrees.
    evidence
        Not used.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view; the first estimate if the two are antipodal.

    Examples
    --------
    >>> import nbv
    >>> float(nbv.average(10.0, 100.0, 95.0))
    7.5
    """
    return midpoint_deg(first_deg, wrap_deg(np.subtract(second_deg, delta_deg)))


def posterior(
    first_deg: ArrayLike,
    second_deg: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the mean direction of the pose given both estimates (docs/method.md).

    It is the direction of sum_theta V[e1, theta] L[theta + delta, e2] exp(i theta), which minimises
    the expected 1 - cos(error) if the errors of the two views are independent.

    Parameters
    ----------
    first_deg, second_deg, delta_deg : array-like, broadcasting
        The arguments of `average`, rounded to the nearest of the evidence's B bins.
    evidence : Evidence
        V and L.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view; the first estimate if the resultant is 0 up to
        rounding, as of evidence that is the same after half a turn.

    Raises
    ------
    ValueError
        Without evidence.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> truth = np.arange(360.0)
    >>> estimates = np.where(np.abs(truth - 90) < 60, 90.0, truth)  # blind around 90 degrees
    >>> density = {"pose_likelihood": "given_estimate", "spread": "entropy"}
    >>> evidence = nbv.gather_evidence(
    ...     estimates[None], density, bandwidth_deg=8, pseudo_observations=3
    ... )
    >>> int(nbv.posterior(90.0, 250.0, 180.0, evidence))  # the second view, 70, counts for more
    78
    """
    if evidence is None:
        raise ValueError("posterior fusion needs evidence")
    n_bins = evidence.n_bins
    first, second, delta = np.broadcast_arrays(
        *(nearest_bin(angle, n_bins) for angle in (first_deg, second_deg, delta_deg))
    )
    # The moments of all pairs of bins cost as much as those of 2 B² single pairs.
    if first.size > 2 * n_bins**2:
        cosine, sine = (evidence.moments[delta, part, first, second] for part in (0, 1))
    else:
        cosine, sine = _moments_of_pairs(first, second, delta, evidence)
    # L bounds the posterior's sum from above.
    is_flat = np.hypot(cosine, sine) <= _ROUNDING * evidence.second.max(axis=0)[second]
    return np.where(is_flat, wrap_deg(first_deg), direction_deg(cosine, sine))


# Pairs of views fused at once, to stay within the processor's cache.
_PAIRS_AT_ONCE = 1024

_ROUNDING = 1e-6
"""Rounding of a moment in single precision, as a share of its largest term."""


def _moments_of_pairs(
    first: Bins, second: Bins, delta: Bins, evidence: Evidence
) -> NDArray[np.float32]:
    n_bins = evidence.n_bins
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1).astype(np.float32)
    moments = np.empty((2, first.size), dtype=np.float32)
    flat = first.ravel(), second.ravel(), delta.ravel()
    for start in range(0, first.size, _PAIRS_AT_ONCE):
        end = start + _PAIRS_AT_ONCE
        e1, e2, d = (bins[start:end] for bins in flat)
        likelihood = evidence.second[d[:, None] + np.arange(n_bins), e2[:, None]]
        moments[:, start:end] = ((evidence.viewpoint[e1] * likelihood) @ unit).T
    return moments.reshape(2, *first.shape)


def product(
    first: ArrayLike,
    second: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the mean direction of the pose given the distributions of both images.

    It is the direction of sum_theta b1(theta) b2(theta + delta) / p0 exp(i theta) with a uniform
    prior p0. Bayes' rule gives this posterior if the two images are independent given the pose.
    They are not quite: both show the same object, whose peculiarities mislead the estimator in both
    views, so the product is overconfident.

    Parameters
    ----------
    first, second : array-like (..., B), rows summing to 1
        The distribution of each image, in the frame of its own view.
    delta_deg : array-like (...)
        The rotations between the views, multiples of 360 / B.
    evidence
        Not used.

    Returns
    -------
    ndarray (...)
        In [0, 360), in the frame of the first view; the mean direction of `first` if the two
        distributions exclude each other, or their product has a resultant of 0 up to rounding.
    """
    delta = np.asarray(delta_deg)
    rows, second_rows = (
        np.asarray(p, dtype=np.float64).reshape(-1, np.shape(p)[-1]) for p in (first, second)
    )
    product = product_of(rows, second_rows, delta)
    return mean_direction_deg(product, mean_direction_deg(rows)).reshape(delta.shape)


Fusion = Callable[[ArrayLike, ArrayLike, ArrayLike, Evidence | None], Angles]
FUSIONS: dict[str, Fusion] = {"average": average, "posterior": posterior, "product": product}

OF_DISTRIBUTIONS = frozenset({"product"})
"""Fusion rules for two distributions; the others fuse two estimates."""

ESTIMATE_FUSIONS = tuple(name for name in FUSIONS if name not in OF_DISTRIBUTIONS)


def calibration_errors_deg(evidence: Evidence, fusion: str) -> NDArray[np.float32]:
    """Return `rotation_errors_deg` (B, n_objects, B) of calibration views, one view for each bin.

    Raises
    ------
    ValueError
        If the rule fuses distributions and the evidence has none.
    """
    outputs = evidence.distributions if fusion in OF_DISTRIBUTIONS else evidence.estimate_deg
    if outputs is None:
        raise ValueError(f"fusion {fusion!r} needs evidence of distributions")
    views = outputs[:, :: outputs.shape[1] // evidence.n_bins]
    return evidence.once(("errors", fusion), lambda: rotation_errors_deg(views, evidence, fusion))


def rotation_errors_deg(
    outputs: NDArray[np.floating[Any]], evidence: Evidence, fusion: str
) -> NDArray[np.float32]:
    """Return the error after every rotation from every view.

    Parameters
    ----------
    outputs : ndarray (n_objects, n_views) or (n_objects, n_views, B)
        The estimate of each view in degrees, or its distribution. View k of n has the azimuth
        360 k / n; n is a multiple of the evidence's B.
    evidence : Evidence
        The argument of the fusion rule.
    fusion : str
        A name in `FUSIONS`.

    Returns
    -------
    ndarray (B, n_objects, n_views) float32
        ``l[delta, object, view] = d(fuse(e(o, phi), e(o, phi + delta), delta), phi)``, degrees.
    """
    if fusion == "product":
        return _product_errors_deg(outputs)
    n_bins, n_views = evidence.n_bins, outputs.shape[1]
    azimuth_deg = np.arange(n_views) * (360.0 / n_views)
    shifts = np.arange(n_bins) * (n_views // n_bins)
    delta_deg = np.arange(n_bins) * (360.0 / n_bins)
    twice = np.concatenate([outputs, outputs], axis=1)
    second = np.stack([twice[:, shift : shift + n_views] for shift in shifts])
    fused = FUSIONS[fusion](outputs, second, delta_deg[:, None, None], evidence)
    return circular_distance_deg(fused, azimuth_deg).astype(np.float32)


def _product_errors_deg(distributions: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return `rotation_errors_deg` of `product` for distributions (n_objects, n_views, B)."""
    n_objects, n_views, n_bins = distributions.shape
    n_sweeps = n_views // n_bins
    # Interleaved sweeps of views that are whole bins apart.
    sweeps = distributions.reshape(n_objects, n_bins, n_sweeps, n_bins).swapaxes(1, 2)
    width_deg = 360.0 / n_bins
    errors = np.empty((n_bins, n_objects, n_bins, n_sweeps), dtype=np.float32)
    for i, start in np.ndindex(n_objects, n_sweeps):
        sweep = np.asarray(sweeps[i, start], dtype=np.float64)
        rows = in_object_frame(sweep)
        single_deg = wrap_deg(mean_direction_deg(sweep) - np.arange(n_bins) * width_deg)
        both_deg = product_directions_deg(rows, rows, single_deg[:, None])
        # From [view, view] to [view, rotation].
        pose_deg = in_object_frame(both_deg)
        errors[:, i, :, start] = circular_distance_deg(pose_deg, start * width_deg / n_sweeps).T
    return errors.reshape(n_bins, n_objects, n_views)
