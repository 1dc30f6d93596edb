"""The ring of one object's depth images as one small picture."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from PIL import Image

from nbv.data.depth_images import Codes
from nbv.experiment.report.figures.depth import depth_limits, shade

N_SHOWN = 36
"""Images round an object; fewer where it has fewer views."""

COLUMNS = 6
"""Images in a row of the picture."""

_LARGEST_SIDE = 64
_QUALITY = 30


@dataclass(frozen=True)
class Ring:
    """Depth images of one object all round, in one picture of `COLUMNS` images a row.

    Attributes
    ----------
    data : str
        A WebP picture in base64.
    n_images, side : int
        How many images, evenly spaced from azimuth 0 on, and their pixels a side.
    grey_error : float
        The mean difference of its grey levels to those of the figures, of 255.
    """

    data: str
    n_images: int
    side: int
    grey_error: float


def ring_of(codes: Codes) -> Ring:
    """Return the ring of one object's images (n_views, side, side), in the figures' grey levels."""
    n_views = len(codes)
    n_images = max(n for n in range(1, N_SHOWN + 1) if n_views % n == 0)
    shown = np.asarray(codes[:: n_views // n_images])
    grey = np.rint(255.0 * shade(shown, depth_limits(shown))).astype(np.uint8)
    side = min(grey.shape[1], _LARGEST_SIDE)
    if side < grey.shape[1]:
        tiles = [Image.fromarray(each).resize((side, side), Image.Resampling.BOX) for each in grey]
        grey = np.stack([np.asarray(tile) for tile in tiles])
    rows = -(-n_images // COLUMNS)
    padded = np.full((rows * COLUMNS, side, side), 255, dtype=np.uint8)
    padded[:n_images] = grey
    grid = padded.reshape(rows, COLUMNS, side, side).swapaxes(1, 2)
    picture = grid.reshape(rows * side, COLUMNS * side)
    stored = io.BytesIO()
    Image.fromarray(picture).save(stored, "webp", quality=_QUALITY, method=6)
    seen = np.asarray(Image.open(stored).convert("L"), dtype=np.float64)
    data = base64.b64encode(stored.getvalue()).decode("ascii")
    return Ring(data, n_images, side, float(np.abs(seen - picture).mean()))
