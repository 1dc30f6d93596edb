"""Views of one object all round, and what a network makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
