"""Whether estimates and azimuths count from the same zero, and the same way round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.angles import signed_difference_deg, wrap_deg

LARGE_OFFSET_DEG = 15.0
"""More than estimators err by on the whole: another zero is likelier."""

FOR_PAIRS = "subtract it from the estimates, or add it to the azimuths, and calibrate again"
FOR_FRAMES = (
    "calibration adds it to the azimuths, and the bundle's answers keep its own zero; is each "
    "frame's azimuth right?"
)

_LEAST_AGREEMENT = 0.5
"""Length of the mean of unit vectors; that of uniformly random differences is near 0."""


@dataclass(frozen=True)
class Offset:
    """The offset that estimates have in common.

    Attributes
    ----------
    offset_deg : float
        In [-180, 180].
    warning : str or None
        See `offset_warning`.
    """

    offset_deg: float
    warning: str | None

    @classmethod
    def of(
        cls, azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64], what_to_do: str
    ) -> Offset:
        """Return the offset between estimates (n,) and azimuths (n,); see `offset_warning`."""
        warning = offset_warning(azimuth_deg, estimate_deg, what_to_do)
        return cls(constant_offset_deg(estimate_deg - azimuth_deg), warning or None)


def constant_offset_deg(error_deg: ArrayLike) -> float:
    """Return the circular median of errors (n,), degrees in [-180, 180): what all have in common.

    Without it the mean absolute error is least. A view whose pose cannot be known moves it no more
    than another one on the same side; it would move a mean by as much as it errs.
    """
    error = np.sort(wrap_deg(error_deg))
    n = len(error)
    # The least is at one of the errors. From each one, those of the next half turn lie ahead.
    twice = np.concatenate([error, error + 360.0])
    sums = np.concatenate([[0.0], np.cumsum(twice)])
    place, ahead = np.arange(n), np.searchsorted(twice, error + 180.0)
    in_front = sums[ahead] - sums[place] - (ahead - place) * error
    behind = (place + n - ahead) * (error + 360.0) - (sums[place + n] - sums[ahead])
    least = error[np.argmin(in_front + behind)]
    # Of an even number there may be two: their middle has as little.
    median = least + np.median(signed_difference_deg(error, least))
    return float(signed_difference_deg(median, 0.0))


def frame_warning(azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64]) -> str:
    """Return why estimates (n,) do not follow azimuths: radians, another sense, or others' views.

    Nothing where estimates follow azimuths, whatever constant offset lies between them.
    """
    estimates_agree = _agreement(estimate_deg - azimuth_deg)
    if _agreement(estimate_deg + azimuth_deg) > max(_LEAST_AGREEMENT, estimates_agree):
        return (
            "estimates run opposite to azimuths (sign flipped?): both count counter-clockwise seen "
            "from above"
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


def offset_warning(
    azimuth_deg: NDArray[np.float64], estimate_deg: NDArray[np.float64], what_to_do: str
) -> str:
    """Return what is wrong with the frame of calibration pairs (n,); nothing where all is well.

    What is to be done about a large offset is `FOR_PAIRS` or `FOR_FRAMES`. A lookup table made of
    pairs whose estimates count from another zero, or the other way round, recommends rotations for
    poses that the object does not have.
    """
    if warning := frame_warning(azimuth_deg, estimate_deg):
        return warning
    offset = constant_offset_deg(estimate_deg - azimuth_deg)
    if abs(offset) > LARGE_OFFSET_DEG:
        return f"offset {offset:+.1f}°: azimuth origins probably differ; {what_to_do}"
    return ""


def _agreement(angle_deg: NDArray[np.float64]) -> float:
    """Return the length of the mean of unit vectors, in [0, 1]."""
    return float(abs(np.exp(1j * np.radians(angle_deg)).mean()))
