"""One pose from two looks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.angles import midpoint_deg, wrap_deg

Rotations = NDArray[np.int64]


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
    first_deg: ArrayLike, second_deg: ArrayLike, delta_deg: ArrayLike
) -> NDArray[np.float64]:
    """Return the circular mean of the first estimate and the second, turned back (Eq. 7).

    The arithmetic mean that the paper prints breaks where the two lie on either side of 0°.

    Parameters
    ----------
    first_deg, second_deg, delta_deg : array-like, broadcasting
        Estimates phi_1 and phi_2 and the rotation between the views, degrees.

    Returns
    -------
    ndarray
        In [0, 360), in the frame of the first view; the first estimate where the two are antipodal.
    """
    return midpoint_deg(first_deg, wrap_deg(np.subtract(second_deg, delta_deg)))


Fusion = Callable[[ArrayLike, ArrayLike, ArrayLike], NDArray[np.float64]]
FUSIONS: dict[str, Fusion] = {"average": average}
