"""Views of one object all round, and what a network makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ELEVATION_BANDWIDTH_DEG = 10.0


@dataclass(frozen=True)
class Turn:
    """Views of one object, taken at one elevation.

    Attributes
    ----------
    object_id, sequence : str
    elevation_deg : float
        NaN where it is not known.
    azimuth_deg : ndarray (n,)
    logits : ndarray (n, B)
    codes : ndarray (n, side, side) uint8
        The crops.
    focal_px : float
        Of the camera, pixels; NaN where it is not known.
    """

    object_id: str
    sequence: str
    elevation_deg: float
    azimuth_deg: NDArray[np.float64]
    logits: NDArray[np.float32]
    codes: NDArray[np.uint8]
    focal_px: float = float("nan")


def elevation_share(known_deg: NDArray[np.floating], elevation_deg: float) -> NDArray[np.float64]:
    """Return how much calibration turns (S,) count for frames of an elevation.

    A normal kernel of `ELEVATION_BANDWIDTH_DEG`, in which the nearest turn counts 1. A turn of
    unknown elevation (NaN) counts 1 too, and so do all turns for frames of unknown elevation.
    """
    if math.isnan(elevation_deg) or np.isnan(known_deg).all():
        return np.ones(len(known_deg))
    apart = ((known_deg - elevation_deg) / ELEVATION_BANDWIDTH_DEG) ** 2
    share = np.exp(-0.5 * (apart - np.nanmin(apart)))
    return np.asarray(np.nan_to_num(share, nan=1.0), dtype=np.float64)
