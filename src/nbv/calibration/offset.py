"""Whether estimates and azimuths count from the same zero, and the same way round."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.angles import direction_deg, signed_difference_deg

LARGE_OFFSET_DEG = 15.0
"""More than estimators err by on the whole: another zero is likelier."""

_LEAST_AGREEMENT = 0.5
"""Length of the mean of unit vectors; that of uniformly random differences is near 0."""


def constant_offset_deg(error_deg: ArrayLike) -> float:
    """Return the mean direction of errors (n,), degrees in [-180, 180): what all have in common."""
    angles = np.radians(np.asarray(error_deg, dtype=np.float64))
    mean = direction_deg(np.cos(angles).mean(), np.sin(angles).mean())
    return float(signed_difference_deg(mean, 0.0))


def frame_warning(azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]) -> str:
    """Return why estimates (n,) do not follow azimuths: radians, another sense, or others' views.

    Nothing where estimates follow azimuths, whatever constant offset lies between them.
    """
    estimates_agree = _agreement(estimate_deg - azimuth_deg)
    if _agreement(estimate_deg + azimuth_deg) > max(_LEAST_AGREEMENT, estimates_agree):
        return (
            "estimates fall where azimuths grow: both count counter-clockwise seen from above; "
            "turn the sign of one of them"
        )
    if estimates_agree > _LEAST_AGREEMENT:
        return ""
    for name, in_degrees in (
        ("estimates", np.degrees(estimate_deg) - azimuth_deg),
        ("azimuths", estimate_deg - np.degrees(azimuth_deg)),
    ):
        if _agreement(in_degrees) > _LEAST_AGREEMENT:
            return f"{name} are radians: multiply them by 180/π"
    return (
        "estimates do not follow azimuths: are they of the same views, in the same order, and does "
        "the object have a front that can be seen?"
    )


def offset_warning(azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]) -> str:
    """Return what is wrong with the frame of calibration pairs (n,); nothing where all is well.

    A lookup table made of pairs whose estimates count from another zero, or the other way round,
    recommends rotations for poses that the object does not have.
    """
    if warning := frame_warning(azimuth_deg, estimate_deg):
        return warning
    offset = constant_offset_deg(estimate_deg - azimuth_deg)
    if abs(offset) > LARGE_OFFSET_DEG:
        return (
            f"an offset of {offset:+.1f}° is another zero rather than an error: subtract it from "
            "the estimates, or add it to the azimuths, and calibrate again"
        )
    return ""


def _agreement(angle_deg: NDArray[np.float64]) -> float:
    """Return the length of the mean of unit vectors, in [0, 1]."""
    return float(abs(np.exp(1j * np.radians(angle_deg)).mean()))
