"""Check that estimates and azimuths share their origin, direction and unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import signed_difference_deg, wrap_deg

LARGE_OFFSET_DEG = 15.0
"""Larger than the mean error of any estimator: azimuth origins differ more likely."""

FOR_PAIRS = "subtract it from the estimates, or add it to the azimuths, and calibrate again"
FOR_FRAMES = (
    "calibration adds it to the azimuths, and the bundle's answers keep its own zero; is each "
    "frame's azimuth right?"
)

_LEAST_AGREEMENT = 0.5
"""Resultant length of differences; near 0 if they are uniformly random."""


@dataclass(frozen=True)
class Offset:
    """The common offset of estimates.

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
    """Return the circular median of errors (n,), degrees in [-180, 180).

    Subtracting it minimises the mean absolute error. Unlike a mean, the median is robust to large
    errors of views whose pose is ambiguous.
    """
    error = np.sort(wrap_deg(error_deg))
    n = len(error)
    # The minimum is at one of the errors i; errors i to end are up to half a circle ahead of it.
    twice = np.concatenate([error, error + 360.0])
    sums = np.concatenate([[0.0], np.cumsum(twice)])
    i, end = np.arange(n), np.searchsorted(twice, error + 180.0)
    ahead = sums[end] - sums[i] - (end - i) * error
    behind = (i + n - end) * (error + 360.0) - (sums[i + n] - sums[end])
    least = error[np.argmin(ahead + behind)]
    # An even number of errors may have two minima; their middle is as good.
    median = least + np.median(signed_difference_deg(error, least))
    return float(signed_difference_deg(median, 0.0))


def frame_warning(
    azimuth_deg: NDArray[np.float64],
    estimate_deg: NDArray[np.float64],
    mirror_plane_deg: float | None = None,
) -> str:
    """Return why estimates (n,) do not follow azimuths: radians, a flipped sign, or other views.

    The text is empty if estimates follow azimuths up to a constant offset. An object with a mirror
    plane at the azimuth m is estimated at 2 m - a from its mirrored image, and at -a if the sign of
    azimuths with the right origin is wrong.
    """
    estimates_agree = _agreement(estimate_deg - azimuth_deg)
    sum_deg = estimate_deg + azimuth_deg
    if _agreement(sum_deg) > max(_LEAST_AGREEMENT, estimates_agree):
        cause = "sign flipped, or frames mirrored?"
        if mirror_plane_deg is not None:
            middle_deg = constant_offset_deg(sum_deg)
            origins_deg = np.array([0.0, 2 * mirror_plane_deg])
            flipped, mirrored = np.abs(signed_difference_deg(middle_deg, origins_deg))
            if 3 * min(flipped, mirrored) < max(flipped, mirrored):
                cause = "sign flipped?" if flipped < mirrored else "frames mirrored?"
        return (
            f"estimates run opposite to azimuths ({cause}): both count counter-clockwise seen from "
            "above"
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
    """Return `frame_warning`, or a warning of a large offset, for calibration pairs (n,).

    `what_to_do` is `FOR_PAIRS` or `FOR_FRAMES`; the text is empty if nothing is wrong. A lookup
    table from pairs with different origins or directions recommends rotations for wrong poses.
    """
    if warning := frame_warning(azimuth_deg, estimate_deg):
        return warning
    offset = constant_offset_deg(estimate_deg - azimuth_deg)
    if abs(offset) > LARGE_OFFSET_DEG:
        return f"offset {offset:+.1f}°: azimuth origins probably differ; {what_to_do}"
    return ""


def _agreement(angle_deg: NDArray[np.float64]) -> float:
    """Return the resultant length of angles, in [0, 1]."""
    return float(abs(np.exp(1j * np.radians(angle_deg)).mean()))
