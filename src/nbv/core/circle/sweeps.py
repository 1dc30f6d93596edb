"""Evenly spaced views of an object, from a sweep with views at any azimuths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import signed_difference_deg, wrap_deg
from nbv.core.circle.distributions import rotated
from nbv.errors import UserError

WIDEST_GAP_DEG = 15.0
"""Widest gap between neighbouring views of a calibration object."""

N_VIEWS = 360


def widest_gap_deg(azimuth_deg: NDArray[np.float64]) -> float:
    """Return the widest gap between neighbouring azimuths (n,) on the circle, degrees."""
    ordered = np.sort(wrap_deg(azimuth_deg))
    return float(np.diff(ordered, append=ordered[0] + 360.0).max())


def full_sweep(
    azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the estimates (360,) of views one degree apart, from views (n,) at any azimuths.

    Each view has the error of the nearest given view; those at one azimuth alternate.
    """
    apart = signed_difference_deg(np.arange(N_VIEWS)[:, None], azimuth_deg)
    nearest = np.abs(apart).argmin(axis=1)
    moved = apart[np.arange(N_VIEWS), nearest]
    twins = apart == moved[:, None]
    chosen = np.arange(N_VIEWS) % twins.sum(axis=1) + 1
    nearest = (twins & (twins.cumsum(axis=1) == chosen[:, None])).argmax(axis=1)
    return wrap_deg(np.where(moved == 0.0, estimate_deg[nearest], estimate_deg[nearest] + moved))


def radians_hint(azimuth_deg: NDArray[np.float64]) -> str:
    """Return a hint for a message about a gap if azimuths (n,) seem to be radians, else ""."""
    is_small = np.abs(azimuth_deg).max() <= 2 * np.pi
    if is_small and widest_gap_deg(np.degrees(azimuth_deg)) <= 2 * WIDEST_GAP_DEG:
        return "; these azimuths seem to be radians: multiply them by 180/π"
    return ""


def evenly_apart(
    azimuth_deg: NDArray[np.float64], rows: NDArray[np.float64], n_views: int
) -> NDArray[np.float64]:
    """Return distributions (n_views, B) of evenly spaced views, from views (n,) at any azimuths.

    Each view has the distribution of the nearest given view, rotated by the angle between them.

    Raises
    ------
    UserError
        Where neighbouring views are farther than `WIDEST_GAP_DEG` apart.
    """
    if (gap := widest_gap_deg(azimuth_deg)) > WIDEST_GAP_DEG + 1e-6:
        raise UserError(
            f"views leave a gap of {gap:.0f}°; calibration needs one every "
            f"{WIDEST_GAP_DEG:g}°{radians_hint(azimuth_deg)}"
        )
    distributions = np.empty((n_views, rows.shape[1]))
    for i, azimuth in enumerate(np.arange(n_views) * (360.0 / n_views)):
        apart = signed_difference_deg(azimuth_deg, azimuth)
        nearest = int(np.abs(apart).argmin())
        distributions[i] = rotated(rows[nearest], float(apart[nearest]))
    return distributions


def bin_apart(azimuth_deg: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return distributions (B, B) of views a bin apart; see `evenly_apart`."""
    return evenly_apart(azimuth_deg, rows, rows.shape[1]).astype(np.float32)
