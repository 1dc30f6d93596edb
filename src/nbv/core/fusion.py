"""One pose from two views."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import (
    circular_distance_deg,
    direction_deg,
    midpoint_deg,
    nearest_bin,
    wrap_deg,
)
from nbv.core.distributions import mean_direction_deg, product_of
from nbv.core.evidence import Evidence

Angles = NDArray[np.float64]
Bins = NDArray[np.intp]
Rotations = NDArray[np.int64]

# Image pairs fused at once, to stay within the processor's cache.
_CHUNK = 1024


def at_second_view(of_views: NDArray[np.float64], delta_deg: Rotations) -> NDArray[np.float64]:
    """Return what belongs to the view that each rotation leads to.

    Parameters
    ----------
    of_views : ndarray (n_objects, n_views, ...)
        An estimate or a distribution of each view; view k of n has the azimuth 360 k / n.
    delta_deg : ndarray (n_objects, n_views) int
        The rotation taken from each view, a multiple of 360 / n.

    Returns
    -------
    ndarray (n_objects, n_views, ...)
    """
    n_objects, n_views = delta_deg.shape
    views = np.arange(n_views) + np.rint(delta_deg * (n_views / 360.0)).astype(np.intp)
    return np.asarray(of_views[np.arange(n_objects)[:, None], views % n_views])


def average(
    first_deg: ArrayLike,
    second_deg: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the circular mean of the first estimate and the second, turned back (Eq. 7).

    The arithmetic mean that the paper prints breaks where the two lie on either side of 0°.

    Parameters
    ----------
    first_deg, second_deg, delta_deg : array-like, broadcasting
        Estimates phi_1 and phi_2 and the rotation between the views, degrees.
    evidence
        Not used.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view; the first estimate where the two are antipodal.

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

    The direction of sum_theta V[e1, theta] L[theta + delta, e2] exp(i theta): of all poses the
    one of least expected 1 - cos(error), where the errors of two views are independent.

    Parameters
    ----------
    first_deg, second_deg, delta_deg : array-like, broadcasting
        As in `average`; taken at the nearest of the evidence's B bins.
    evidence : Evidence
        V and L.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view.

    Raises
    ------
    ValueError
        Without evidence.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> truth = np.arange(360.0)
    >>> estimates = np.where(np.abs(truth - 90) < 60, 90.0, truth)  # blind about 90 degrees
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
    first, second, turn = np.broadcast_arrays(
        *(nearest_bin(angle, n_bins) for angle in (first_deg, second_deg, delta_deg))
    )
    # The moments of all pairs of estimates cost as much as those of 2 B² single ones.
    if first.size > 2 * n_bins**2:
        moments = evidence.moments
        return direction_deg(moments[turn, 0, first, second], moments[turn, 1, first, second])
    return _posterior_one_by_one(first, second, turn, evidence)


def _posterior_one_by_one(first: Bins, second: Bins, turn: Bins, evidence: Evidence) -> Angles:
    n_bins = evidence.n_bins
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    unit = np.stack([np.cos(angles), np.sin(angles)], axis=-1).astype(np.float32)
    fused = np.empty(first.size)
    flat = first.ravel(), second.ravel(), turn.ravel()
    for start in range(0, first.size, _CHUNK):
        e1, e2, delta = (each[start : start + _CHUNK] for each in flat)
        seen = evidence.second[delta[:, None] + np.arange(n_bins), e2[:, None]]
        moment = (evidence.viewpoint[e1] * seen) @ unit
        fused[start : start + _CHUNK] = direction_deg(moment[:, 0], moment[:, 1])
    return fused.reshape(first.shape)


def product(
    first: ArrayLike,
    second: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the mean direction of the pose given the distributions of both images.

    The direction of sum_theta b1(theta) b2(theta + delta) / p0 exp(i theta), the prior p0 of the
    pose being uniform. Bayes' rule gives this posterior where the two images are independent given
    the pose. They are not quite: both show the same object, and what is unusual about it misleads
    both alike, so the product is surer than it should be.

    Parameters
    ----------
    first, second : array-like (..., B), rows summing to 1
        Distributions from each image alone, each in the frame of its own view.
    delta_deg : array-like (...)
        The rotations between them, multiples of 360 / B.
    evidence
        Not used.

    Returns
    -------
    ndarray (...)
        In [0, 360), in the frame of the first view; its own mean direction where the two exclude
        each other.
    """
    delta = np.asarray(delta_deg)
    own, other = (
        np.asarray(rows, dtype=np.float64).reshape(-1, np.shape(rows)[-1])
        for rows in (first, second)
    )
    return mean_direction_deg(product_of(own, other, delta)).reshape(delta.shape)


Fusion = Callable[[ArrayLike, ArrayLike, ArrayLike, Evidence | None], Angles]
FUSIONS: dict[str, Fusion] = {"average": average, "posterior": posterior, "product": product}

OF_DISTRIBUTIONS = frozenset({"product"})
"""Fusion rules of two distributions; the others fuse two estimates."""

ESTIMATE_FUSIONS = tuple(name for name in FUSIONS if name not in OF_DISTRIBUTIONS)


def calibration_errors_deg(evidence: Evidence, fusion: str) -> NDArray[np.float32]:
    """Return `rotation_errors_deg` (B, n_objects, B) of calibration views, one for each bin.

    Raises
    ------
    ValueError
        Where the fusion is of distributions and the evidence has none.
    """
    of_views = evidence.distributions if fusion in OF_DISTRIBUTIONS else evidence.estimate_deg
    if of_views is None:
        raise ValueError(f"fusion {fusion!r} needs evidence of distributions")
    views = of_views[:, :: of_views.shape[1] // evidence.n_bins]
    return evidence.once(("errors", fusion), lambda: rotation_errors_deg(views, evidence, fusion))


def rotation_errors_deg(
    of_views: NDArray[np.floating[Any]], evidence: Evidence, fusion: str
) -> NDArray[np.float32]:
    """Return the error after every rotation from every view.

    Parameters
    ----------
    of_views : ndarray (n_objects, n_views) or (n_objects, n_views, B)
        What the fusion rule fuses: an estimate in degrees of each view, or a distribution. View k
        of n has the azimuth 360 k / n; n is a multiple of the evidence's B.
    evidence : Evidence
        For the fusion rule.
    fusion : str
        A name in `FUSIONS`.

    Returns
    -------
    ndarray (B, n_objects, n_views) float32
        ``l[delta, object, view] = d(fuse(e(o, phi), e(o, phi + delta), delta), phi)``, degrees.
    """
    if fusion == "product":
        return _product_errors_deg(of_views)
    n_bins, n_views = evidence.n_bins, of_views.shape[1]
    azimuth_deg = np.arange(n_views) * (360.0 / n_views)
    shifts = np.arange(n_bins) * (n_views // n_bins)
    delta_deg = np.arange(n_bins) * (360.0 / n_bins)
    twice = np.concatenate([of_views, of_views], axis=1)
    second = np.stack([twice[:, shift : shift + n_views] for shift in shifts])
    fused = FUSIONS[fusion](of_views, second, delta_deg[:, None, None], evidence)
    return circular_distance_deg(fused, azimuth_deg).astype(np.float32)


def _product_errors_deg(distributions: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """Return `rotation_errors_deg` of `product`, of distributions (n_objects, n_views, B).

    Let c be the distribution of a view and c' that of another one, both turned so that the true
    pose comes first. Their product has the mean direction of ``sum_u c(u) c'(u) exp(i u)`` from
    there. So one product of matrices serves all pairs of an object's views.
    """
    n_objects, n_views, n_bins = distributions.shape
    of_bin = n_views // n_bins
    # Views that are whole bins apart, one such set after the other.
    sets = distributions.reshape(n_objects, n_bins, of_bin, n_bins).swapaxes(1, 2)
    ahead = (np.arange(n_bins)[:, None] + np.arange(n_bins)) % n_bins
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    width_deg = 360.0 / n_bins
    errors = np.empty((n_bins, n_objects, n_bins, of_bin), dtype=np.float32)
    for (place, first), views in zip(
        np.ndindex(sets.shape[:2]), sets.reshape(-1, n_bins, n_bins), strict=True
    ):
        turned = np.take_along_axis(np.asarray(views, dtype=np.float64), ahead, axis=1)
        cosine, sine = (turned * part @ turned.T for part in (np.cos(angles), np.sin(angles)))
        excluded = turned @ turned.T <= 0
        if excluded.any():
            own = turned @ np.stack([np.cos(angles), np.sin(angles)], axis=1)
            cosine, sine = (
                np.where(excluded, own[:, [axis]], both) for axis, both in enumerate((cosine, sine))
            )
        pose_deg = np.take_along_axis(direction_deg(cosine, sine), ahead, axis=1)
        apart = circular_distance_deg(pose_deg, first * width_deg / of_bin)
        errors[:, place, :, first] = apart.T
    return errors.reshape(n_bins, n_objects, n_views)
