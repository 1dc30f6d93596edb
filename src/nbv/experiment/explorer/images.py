"""What the explorer's page holds as compact numbers and pictures."""

from __future__ import annotations

import base64
import io
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from nbv.experiment.report.figures.views import depth_limits, shade

Codes = NDArray[np.uint8]
Hundredths = NDArray[np.int64]

TURN = 36000
"""A full turn, in hundredths of a degree."""

# Of a table's largest value; a code for less would make all others coarser.
_LEAST_PART = 1e-9


def hundredths(angle_deg: NDArray[np.floating[Any]]) -> Hundredths:
    """Return angles in hundredths of a degree, in [0, 36000)."""
    return np.rint(np.asarray(angle_deg, dtype=np.float64) * 100.0).astype(np.int64) % TURN


def half_turn(difference: Hundredths) -> Hundredths:
    """Return differences of angles as the shorter turn, in [-18000, 18000)."""
    return np.asarray((difference + TURN // 2) % TURN - TURN // 2)


def byte_planes(values: Hundredths) -> bytes:
    """Return integers in [-32768, 32767] as bytes: all high ones, then all low ones.

    Those near 0 of either sign have a high byte of 0, which deflates to next to nothing.
    """
    folded = np.where(values >= 0, 2 * values, -2 * values - 1).astype(np.uint16).ravel()
    return (folded >> 8).astype(np.uint8).tobytes() + (folded & 0xFF).astype(np.uint8).tobytes()


def rows_differenced(codes: Codes) -> bytes:
    """Return codes (B, B) as differences along both axes, modulo 256, which deflate well."""
    down = np.diff(codes, axis=0, prepend=np.zeros((1, codes.shape[1]), np.uint8))
    return np.diff(down, axis=1, prepend=np.zeros((len(codes), 1), np.uint8)).tobytes()


def as_text(*parts: bytes) -> str:
    """Return bytes, deflated together, in base64."""
    return base64.b64encode(zlib.compress(b"".join(parts), 9)).decode("ascii")


@dataclass(frozen=True)
class Quantised:
    """A table in 256 steps.

    Attributes
    ----------
    codes : ndarray uint8
    low, high : float
        What the codes 0 and 255 stand for.
    """

    codes: Codes
    low: float
    high: float

    @property
    def restored(self) -> NDArray[np.float64]:
        """The table as the page has it."""
        return self.low + self.codes.astype(np.float64) * ((self.high - self.low) / 255.0)


def quantised(table: NDArray[np.floating[Any]]) -> Quantised:
    """Return a table in equal steps from its least to its largest value."""
    values = np.asarray(table, dtype=np.float64)
    low, high = float(values.min()), float(values.max())
    steps = (values - low) * (255.0 / (high - low)) if high > low else np.zeros_like(values)
    return Quantised(np.rint(steps).astype(np.uint8), low, high)


def quantised_logs(probabilities: NDArray[np.floating[Any]]) -> Quantised:
    """Return the logs of probabilities in equal steps: each is as exact as any other.

    What is below a billionth of the largest counts as that.
    """
    values = np.asarray(probabilities, dtype=np.float64)
    return quantised(np.log(np.maximum(values, _LEAST_PART * values.max())))


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
