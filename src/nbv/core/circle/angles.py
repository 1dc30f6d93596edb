"""Angles on the circle, in degrees. Every function works elementwise and broadcasts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError

Angles = NDArray[np.float64]

MOST_DEG = 1e6
"""A larger angle is a mistake: its direction would be lost in rounding."""


def is_angle(angle_deg: ArrayLike) -> NDArray[np.bool_]:
    """Return whether each value is a number of degrees, at most `MOST_DEG` either way."""
    angle = np.asarray(angle_deg)
    if angle.dtype.kind not in "iuf":
        return np.zeros(angle.shape, dtype=bool)
    return np.asarray(np.abs(angle.astype(np.float64)) <= MOST_DEG)


def wrap_deg(angle_deg: ArrayLike) -> Angles:
    """Return the same directions in [0, 360)."""
    angle = np.asarray(angle_deg, dtype=np.float64)
    # The result of np.mod, bit for bit, in a third of the time.
    wrapped = angle - 360.0 * np.floor(angle / 360.0)
    # The quotient may round up to the next whole turn.
    wrapped = np.where(wrapped < 0.0, wrapped + 360.0, wrapped)
    # -1e-17 rounds up to 360 itself, which is outside the half-open range.
    return np.where(wrapped >= 360.0, 0.0, wrapped)


def signed_difference_deg(a_deg: ArrayLike, b_deg: ArrayLike) -> Angles:
    """Return the shorter way from b to a, in [-180, 180)."""
    difference = np.asarray(a_deg, dtype=np.float64) - np.asarray(b_deg, dtype=np.float64)
    return wrap_deg(difference + 180.0) - 180.0


def circular_distance_deg(a_deg: ArrayLike, b_deg: ArrayLike) -> Angles:
    """Return the angle between two directions, in [0, 180] (Eq. 9 with its cases corrected)."""
    return np.abs(signed_difference_deg(a_deg, b_deg))


def travel_deg(delta_deg: ArrayLike) -> Angles:
    """Return how far the camera travels for a rotation delta, the shorter way, in [0, 180]."""
    return circular_distance_deg(delta_deg, 0.0)


def midpoint_deg(first_deg: ArrayLike, second_deg: ArrayLike) -> Angles:
    """Return the circular mean of two directions, in [0, 360).

    Opposite directions have no mean; the result is then the first direction.
    """
    difference = signed_difference_deg(second_deg, first_deg)
    half = np.where(difference == -180.0, 0.0, difference / 2)
    return wrap_deg(np.asarray(first_deg, dtype=np.float64) + half)


def direction_deg(cos: ArrayLike, sin: ArrayLike) -> Angles:
    """Return the direction of the vector (cos, sin), in [0, 360)."""
    return wrap_deg(np.degrees(np.arctan2(np.asarray(sin), np.asarray(cos))))


def nearest_bin(angle_deg: ArrayLike, n_bins: int) -> NDArray[np.intp]:
    """Return the bin of each angle: bin k of width w = 360/n_bins covers [kw - w/2, kw + w/2)."""
    width = 360.0 / n_bins
    return (np.floor(wrap_deg(angle_deg) / width + 0.5)).astype(np.intp) % n_bins


def mirrored_bins(n_bins: int, plane_deg: float) -> NDArray[np.intp]:
    """Return the bin (n_bins,) that each bin becomes in a mirror image; see `nbv.bundles.network`.

    Raises
    ------
    UserError
        Where twice `plane_deg`, the azimuth of the mirror plane, is not the centre of a bin.
    """
    shift = 2 * plane_deg * n_bins / 360
    if abs(shift - round(shift)) > 1e-6:
        raise UserError(
            f"mirror_plane_deg={plane_deg:g}: with {n_bins} bins it has to be a multiple of "
            f"{180 / n_bins:g} degrees"
        )
    return (round(shift) - np.arange(n_bins)) % n_bins
