"""Arrays as text within a page: quantised, differenced, deflated, and told how far they are off.

The page's own script undoes each step (``explorer_data.js``).
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
