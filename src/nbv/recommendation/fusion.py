"""One pose from two looks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.angles import circular_distance_deg, direction_deg, midpoint_deg, nearest_bin, wrap_deg
from nbv.recommendation.evidence import Evidence

Angles = NDArray[np.float64]
Bins = NDArray[np.intp]
Rotations = NDArray[np.int64]

# Image pairs fused at once, to stay within the processor's cache.
_CHUNK = 1024


def second_look(estimate_deg: NDArray[np.float64], delta_deg: Rotations) -> NDArray[np.float64]:
    """Return the estimate from the view that each rotation leads to.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n.
    delta_deg : ndarray (n_objects, n_views) int
        The rotation taken from each view, a multiple of 360 / n.

    Returns
    -------
    ndarray (n_objects, n_views)
    """
    n_views = estimate_deg.shape[1]
    views = np.arange(n_views) + np.rint(delta_deg * (n_views / 360.0)).astype(np.intp)
    return np.take_along_axis(estimate_deg, views % n_views, axis=1)


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
    evidence : Evidence, optional
        Not used.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view; the first estimate where the two are antipodal.
    """
    return midpoint_deg(first_deg, wrap_deg(np.subtract(second_deg, delta_deg)))


def posterior(
    first_deg: ArrayLike,
    second_deg: ArrayLike,
    delta_deg: ArrayLike,
    evidence: Evidence | None = None,
) -> Angles:
    """Return the mean direction of the pose given both estimates (design, section 3).

    The direction of sum_theta V[e1, theta] L[theta + delta, e2] exp(i theta): of all answers the
    one of least expected 1 - cos(error), where the two looks err independently.

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


Fusion = Callable[[ArrayLike, ArrayLike, ArrayLike, Evidence | None], Angles]
FUSIONS: dict[str, Fusion] = {"average": average, "posterior": posterior}


def two_view_error_deg(
    estimate_deg: Angles,
    delta_deg: Rotations,
    fusion: str = "average",
    evidence: Evidence | None = None,
) -> Angles:
    """Return the error after fusing two views.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n.
    delta_deg : ndarray (n_objects, n_views) int
        The rotation taken from each view; a multiple of 360 / n.
    fusion : str
        A name in `FUSIONS`.
    evidence : Evidence, optional
        Where the fusion needs it.

    Returns
    -------
    ndarray (n_objects, n_views), degrees in [0, 180]
    """
    n_views = estimate_deg.shape[1]
    second = second_look(estimate_deg, delta_deg)
    fused = FUSIONS[fusion](estimate_deg, second, delta_deg, evidence)
    return circular_distance_deg(fused, np.arange(n_views) * (360.0 / n_views))


def calibration_errors_deg(evidence: Evidence, fusion: str) -> NDArray[np.float32]:
    """Return the error after every rotation from calibration views, one view for each bin.

    Returns
    -------
    ndarray (B, n_objects, B) float32
        ``l[delta, object, view]`` of `rotation_errors_deg`, view k being at bin k.
    """
    step = evidence.estimate_deg.shape[1] // evidence.n_bins
    views = evidence.estimate_deg[:, ::step]
    return evidence.once(("errors", fusion), lambda: rotation_errors_deg(views, evidence, fusion))


def rotation_errors_deg(
    estimate_deg: Angles, evidence: Evidence, fusion: str
) -> NDArray[np.float32]:
    """Return the error after every rotation from every view.

    Parameters
    ----------
    estimate_deg : ndarray (n_objects, n_views)
        View k of n has the azimuth 360 k / n; n is a multiple of the evidence's B.
    evidence : Evidence
        For the fusion rule.
    fusion : str
        A name in `FUSIONS`.

    Returns
    -------
    ndarray (B, n_objects, n_views) float32
        ``l[delta, object, view] = d(fuse(e(o, phi), e(o, phi + delta), delta), phi)``, degrees.
    """
    n_bins, n_views = evidence.n_bins, estimate_deg.shape[1]
    azimuth_deg = np.arange(n_views) * (360.0 / n_views)
    shifts = np.arange(n_bins) * (n_views // n_bins)
    delta_deg = (np.arange(n_bins) * (360.0 / n_bins))[:, None, None]
    twice = np.concatenate([estimate_deg, estimate_deg], axis=1)
    second = np.stack([twice[:, shift : shift + n_views] for shift in shifts])
    fused = FUSIONS[fusion](estimate_deg, second, delta_deg, evidence)
    return circular_distance_deg(fused, azimuth_deg).astype(np.float32)
