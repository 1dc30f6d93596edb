"""The joint density of estimate and viewpoint on the torus, and its two conditionals.

Bins are centred: bin k of B covers [(k - 1/2) 360/B, (k + 1/2) 360/B) degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import nearest_bin

Matrix = NDArray[np.float64]

_ROUNDING = 1e-12
"""Share of a density that the Fourier transforms of `smooth` may put anywhere."""


@dataclass(frozen=True)
class Conditionals:
    """The two conditionals of one joint density, float64 with rows that sum to 1.

    Attributes
    ----------
    viewpoint : ndarray (B, B)
        V[estimate, viewpoint] = p(viewpoint | estimate), Eq. 5 of the paper.
    estimate : ndarray (B, B)
        L[viewpoint, estimate] = p(estimate | viewpoint).

    Examples
    --------
    >>> import nbv
    >>> choice = {"bandwidth_deg": 5, "pseudo_observations": 1}
    >>> pair = nbv.conditionals([0.0, 90.0], [0.0, 100.0], **choice)
    >>> int(pair.viewpoint[90].argmax())  # what was estimated as 90° was at 100°
    100
    """

    viewpoint: Matrix
    estimate: Matrix

    @property
    def n_bins(self) -> int:
        """B, the number of bins around the circle."""
        return len(self.viewpoint)


def pair_counts(estimate_deg: ArrayLike, azimuth_deg: ArrayLike, n_bins: int) -> Matrix:
    """Count pairs of estimates and true azimuths (same shape): N[estimate, viewpoint], (B, B)."""
    rows = nearest_bin(np.ravel(estimate_deg), n_bins)
    columns = nearest_bin(np.ravel(azimuth_deg), n_bins)
    flat = np.bincount(rows * n_bins + columns, minlength=n_bins * n_bins)
    return flat.reshape(n_bins, n_bins).astype(np.float64)


def von_mises_kernel(n_bins: int, bandwidth_deg: float) -> NDArray[np.float64]:
    """Return a von Mises kernel on the grid of bins, centred on bin 0, summing to 1.

    The concentration is 1/bandwidth² (radians), so that narrow kernels are Gaussians of standard
    deviation `bandwidth_deg`. It is evaluated on the grid, so it wraps by construction. A bandwidth
    of 0 gives a single 1: no smoothing.
    """
    if not 0 <= bandwidth_deg < np.inf:
        raise ValueError(f"bandwidth_deg must be 0 or more and finite, not {bandwidth_deg}")
    if bandwidth_deg == 0:
        return np.asarray(np.eye(1, n_bins)[0])
    concentration = 1.0 / np.radians(bandwidth_deg) ** 2
    angles = 2 * np.pi * np.arange(n_bins) / n_bins
    kernel = np.exp(concentration * (np.cos(angles) - 1.0))
    return np.asarray(kernel / kernel.sum())


def smooth(counts: Matrix, bandwidth_deg: float) -> Matrix:
    """Smooth counts (B, B) by `von_mises_kernel` along both axes of the torus.

    A product of two circulants, hence a product in the Fourier domain. The sum stays the same, and
    no entry is negative.
    """
    if bandwidth_deg == 0:
        return counts.copy()
    spectrum = np.fft.fft(von_mises_kernel(len(counts), bandwidth_deg))
    response = np.outer(spectrum, spectrum[: len(counts) // 2 + 1])
    smoothed = np.fft.irfft2(np.fft.rfft2(counts) * response, s=counts.shape)
    # The transform leaves rounding errors of either sign where the density is almost 0.
    return np.maximum(smoothed, 0.0)


def conditional(joint: Matrix, pseudo_observations: float) -> Matrix:
    """Return the rows of a joint density (B, B) as distributions.

    `pseudo_observations` (0 or more) uniform observations are added to every row, so that rows
    with few observations are wide rather than sharp. A row without any observation is uniform,
    also without pseudo-observations, where smoothing leaves it the rounding of other rows.
    """
    if not 0 <= pseudo_observations < np.inf:
        raise ValueError(
            f"pseudo_observations must be 0 or more and finite, not {pseudo_observations}"
        )
    n_bins = joint.shape[1]
    mass = joint.sum(axis=1, keepdims=True) + pseudo_observations
    filled = joint + pseudo_observations / n_bins
    rows = np.full_like(joint, 1.0 / n_bins)
    np.divide(filled, mass, out=rows, where=mass > _ROUNDING * joint.sum())
    return rows


def conditionals(
    estimate_deg: ArrayLike,
    azimuth_deg: ArrayLike,
    *,
    bandwidth_deg: float,
    pseudo_observations: float,
    n_bins: int = 360,
) -> Conditionals:
    """Estimate V and L from calibration pairs (docs/method.md).

    Parameters
    ----------
    estimate_deg, azimuth_deg : array-like, same shape
        Estimate and true azimuth of every view of objects the estimator was not trained on.
    bandwidth_deg : float
        Smoothing along both axes.
    pseudo_observations : float
        Uniform observations added to each row if there are 360 bins; scaled in proportion to the
        bin width otherwise.
    n_bins : int
        B, the number of bins.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> truth = np.arange(360.0)
    >>> pair = nbv.conditionals(truth, truth, bandwidth_deg=8, pseudo_observations=0)
    >>> int(pair.viewpoint[30].argmax())  # an estimate of 30 degrees is right
    30
    """
    joint = smooth(pair_counts(estimate_deg, azimuth_deg, n_bins), bandwidth_deg)
    alpha = pseudo_observations * 360.0 / n_bins
    return Conditionals(conditional(joint, alpha), conditional(joint.T, alpha))
