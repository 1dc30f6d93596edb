"""Triangulating depth cameras, the Kinect and active stereo: noise, losses and shadows.

Such a camera matches a small window of its image with the image of a second eye: another camera, or
the projector's pattern. This has three effects. Neighbouring pixels share noise, because their
windows overlap. Values are lost if the window shows more than one surface. Surfaces hidden from the
second eye have no value.

Throughout, z are depth images (k, rows, columns) float32 in metres, 0 for background, and
``focal_px`` is the focal length in pixels of these images. The functions on which both sensors are
based come first, then `Kinect` with its published noise, then `Stereo`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import ndtr

from nbv.data.camera import Camera
from nbv.data.depth_codes import Depths

Metres = NDArray[np.float32]
Mask = NDArray[np.bool_]

STEEPEST_DEG = 80.0
"""Neighbours farther apart in depth than on a surface at this incidence are on two surfaces."""

FAINTEST_DEG = 60.0
"""The largest incidence without losses due to incidence; see `is_lost`."""


def incidence_rad(z: Metres, focal_px: float) -> Metres:
    """Return the angle between the surface's normal and the ray, in [0, π/2]; 0 for background.

    A slope is the smaller of the differences to the two neighbours, so that edges do not steepen
    adjacent surfaces.
    """
    down, across = _slope(z, -2), _slope(z, -1)
    row, column = (
        np.arange(size, dtype=np.float32) + np.float32(0.5 - size / 2) for size in z.shape[-2:]
    )
    row = row[:, None]
    # The normal of the surface (column z, row z, focal z) / focal, and its product with the ray.
    along = z + column * across + row * down
    normal = np.sqrt(np.float32(focal_px**2) * (down**2 + across**2) + along**2)
    ray = np.sqrt(1 + (row**2 + column**2) / np.float32(focal_px**2))
    cosine = np.ones_like(z)
    np.divide(z, normal * ray, out=cosine, where=z > 0)
    return np.arccos(np.minimum(cosine, 1))


def _slope(z: Metres, axis: int) -> Metres:
    step = np.diff(np.where(z > 0, z, np.float32(np.nan)), axis=axis)
    none = np.full_like(z.take([0], axis=axis), np.nan)
    before, after = (np.concatenate(pair, axis=axis) for pair in ((none, step), (step, none)))
    gentler = np.where((np.abs(before) <= np.abs(after)) | np.isnan(after), before, after)
    return np.nan_to_num(gentler, copy=False, nan=0.0)


def same_surface(z: Metres, there: Metres, apart_px: float | Metres, focal_px: float) -> Mask:
    """Return whether two pixels, `apart_px` apart, show the same surface (`STEEPEST_DEG`)."""
    steepest = np.float32(math.tan(math.radians(STEEPEST_DEG)) / focal_px)
    return np.asarray((there > 0) & (np.abs(there - z) <= steepest * z * apart_px))


def window_weights(width_px: float) -> NDArray[np.float64]:
    """Return the fraction of each pixel in a row that a centred window covers."""
    reach = max(math.ceil(width_px / 2 - 0.5), 0)
    return np.clip(width_px / 2 + 0.5 - np.abs(np.arange(-reach, reach + 1)), 0, 1)


def window_share(z: Metres, width_px: float, focal_px: float) -> Metres:
    """Return the fraction of each pixel's window that shows the pixel's surface, in [0, 1]."""
    weights = window_weights(width_px)
    reach = len(weights) // 2
    padded = np.pad(z, [(0, 0), (reach, reach), (reach, reach)])
    seen, index = z > 0, np.flatnonzero(padded > 0)
    depth, on_surface = z[seen], np.zeros(len(index), dtype=np.float32)
    for down, row_weight in enumerate(weights):
        for across, column_weight in enumerate(weights):
            step = (down - reach) * padded.shape[-1] + across - reach
            there = padded.ravel()[index + step]
            apart = math.hypot(down - reach, across - reach)
            weight = np.float32(row_weight * column_weight / weights.sum() ** 2)
            on_surface += weight * same_surface(depth, there, apart, focal_px)
    share = np.zeros_like(z)
    share[seen] = on_surface
    return share


def window_noise(
    shape: tuple[int, ...], width_px: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Draw standard normal noise, correlated between pixels with overlapping windows."""
    weights = window_weights(width_px)
    weights /= np.sqrt((weights**2).sum())
    noise = rng.standard_normal(shape, dtype=np.float32)
    # Wrapped, so that the variance is 1 at the edges of the image too.
    for axis in (-2, -1):
        noise = ndimage.correlate1d(noise, weights, axis=axis, mode="wrap")
    return noise


def is_lost(
    z: Metres, incidence: Metres, width_px: float, focal_px: float, rng: np.random.Generator
) -> Mask:
    """Draw the pixels that have no value because their window shows too little of the surface.

    The probability of a value is the product of two factors: the fraction of the window on the
    surface, which is small at silhouettes and on thin parts; and the cosine of the incidence
    relative to `FAINTEST_DEG`, at most 1. Losses come in patches as large as a window. These causes
    of loss are known; the product is our assumption.
    """
    breadth = np.cos(incidence) / np.float32(math.cos(math.radians(FAINTEST_DEG)))
    kept = window_share(z, width_px, focal_px) * np.minimum(breadth, 1)
    return np.asarray(ndtr(window_noise(z.shape, width_px, rng)) >= kept)


def is_hidden(z: Metres, focal_px: float, baseline_m: float) -> Mask:
    """Return which pixels are hidden from a second eye, `baseline_m` to the right.

    A pixel is hidden if another pixel of its row, nearer by more than one pixel of disparity, falls
    on the same pixel of the second eye's image. Shadows are on the left of objects.
    """
    seen = np.flatnonzero(z > 0)
    hidden = np.zeros(z.size, dtype=bool)
    if len(seen):
        disparity = np.float32(focal_px * baseline_m) / z.ravel()[seen]
        row, column = np.divmod(seen, z.shape[-1])
        shift = disparity - disparity.min()
        width = z.shape[-1] + math.ceil(shift.max()) + 1
        index = row * width + np.rint(column - shift).astype(np.intp) + (width - z.shape[-1])
        nearest = np.zeros(z.size // z.shape[-1] * width, dtype=np.float32)
        np.maximum.at(nearest, index, disparity)
        hidden[seen] = nearest[index] > disparity + 1
    return hidden.reshape(z.shape)


def displaced(
    measured: Metres, z: Metres, sigma_px: Metres, focal_px: float, rng: np.random.Generator
) -> Metres:
    """Return measured depth with a normal error of position at edges.

    Within a surface the published axial noise includes such errors. The position of an edge between
    two pixel centres is unknown, so displacements are rounded at random without bias. `sigma_px`
    (k, rows, columns) is their standard deviation along rows and along columns.
    """
    shifts = []
    for _ in range(2):
        shift = sigma_px * rng.standard_normal(z.shape, dtype=np.float32)
        shift += rng.random(z.shape, dtype=np.float32)
        shifts.append(np.floor(shift, out=shift).astype(np.int32))
    # Displacements far from the object have no effect.
    farthest = max(int(np.abs(shift).max()) for shift in shifts)
    is_near = ndimage.maximum_filter((z > 0).any(axis=0), 2 * farthest + 1)
    moved = np.flatnonzero(((shifts[0] != 0) | (shifts[1] != 0)) & is_near)
    rows, columns = z.shape[-2:]
    above, column = np.divmod(moved, columns)
    image, row = np.divmod(above, rows)
    source_row = np.clip(row + shifts[0].ravel()[moved], 0, rows - 1)
    source_column = np.clip(column + shifts[1].ravel()[moved], 0, columns - 1)
    source = (image * rows + source_row) * columns + source_column
    apart = np.hypot(source_row - row, source_column - column).astype(np.float32)
    crosses = ~same_surface(z.ravel()[moved], z.ravel()[source], apart, focal_px)
    out = measured.copy()
    out.ravel()[moved[crosses]] = measured.ravel()[source[crosses]]
    return out


# Khoshelham and Oude Elberink: 1/z = 3.03 - 0.00285 d in 1/m, d = 0, 1, 2, ...
NEAREST_PER_M = 3.03
STEP_PER_M = 0.00285

_GRAZING_RAD = math.radians(60.0)


def axial_m(z: Metres, incidence: Metres) -> Metres:
    """Return the standard deviation of depth, in metres (Nguyen et al.).

    It is ``0.0012 + 0.0019 (z - 0.4)²``, plus ``0.0001 θ² / (√z (π/2 - θ)²)`` for incidences θ
    above 60°, constant above `STEEPEST_DEG`, where measurements are rare.
    """
    axial: Metres = np.float32(0.0012) + np.float32(0.0019) * np.square(z - np.float32(0.4))
    root: Metres = np.sqrt(z)
    more = np.float32(0.0001) * np.square(_slant(incidence)) / root
    return np.where(incidence > _GRAZING_RAD, axial + more, axial)


def lateral_px(incidence: Metres) -> Metres:
    """Return the standard deviation of an edge's position, in sensor pixels (Nguyen et al.)."""
    return np.float32(0.8) + np.float32(0.035) * _slant(incidence)


def _slant(incidence: Metres) -> Metres:
    angle: Metres = np.minimum(incidence, np.float32(math.radians(STEEPEST_DEG)))
    return angle / (np.float32(math.pi / 2) - angle)


def step_m(z: Metres) -> Metres:
    """Return the distance between neighbouring measurable depths, in metres."""
    return np.float32(STEP_PER_M) * z**2


def quantised(z: Metres) -> Metres:
    """Return the nearest measurable depth, in metres; 0 out of range."""
    level = np.rint((np.float32(NEAREST_PER_M) - 1 / z) / np.float32(STEP_PER_M))
    inverse = np.float32(NEAREST_PER_M) - np.float32(STEP_PER_M) * level
    in_range = (level >= 0) & (inverse > 0)
    depth: Metres = np.divide(1, inverse, out=np.zeros_like(z), where=in_range)
    return depth


@dataclass(frozen=True)
class Kinect:
    """A Kinect of the first kind.

    Attributes
    ----------
    focal_px : float
        Focal length in sensor pixels, the unit of lateral noise and window.
    baseline_m : float
        Distance from the camera to the projector.
    window_px : float
        Side of the correlation window.
    """

    focal_px: float
    baseline_m: float
    window_px: float

    @property
    def nearest_m(self) -> float:
        """The shortest measurable distance, in metres."""
        return 1 / NEAREST_PER_M

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Measure depth; see `nbv.data.sensors.Sensor`."""
        z = depth * np.float32(diagonal_m)
        focal = camera.focal_px
        per_pixel = focal / self.focal_px
        window = self.window_px * per_pixel
        incidence = incidence_rad(z, focal)
        seen = z > 0
        there = z[seen]
        # The published noise of quantised depth includes the steps.
        variance = np.square(axial_m(there, incidence[seen])) - np.square(step_m(there)) / 12
        sigma: Metres = np.sqrt(variance)
        noise = window_noise(z.shape, window, rng)[seen]
        measured = np.zeros_like(z)
        measured[seen] = quantised(there + sigma * noise)
        measured[is_lost(z, incidence, window, focal, rng)] = 0
        measured[is_hidden(z, focal, self.baseline_m)] = 0
        lateral = lateral_px(incidence) * np.float32(per_pixel)
        return displaced(measured, z, lateral, focal, rng) / np.float32(diagonal_m)


STEPS_PER_PX = 32
LARGEST_PX = 126
"""The camera's largest disparity."""


@dataclass(frozen=True)
class Stereo:
    """An active stereo camera.

    Attributes
    ----------
    focal_px : float
        Focal length in sensor pixels, the unit of noise and window.
    baseline_m : float
        Distance from the left camera, which takes the image, to the right one.
    disparity_noise_px : float
        Standard deviation of a disparity; depth has ``z² disparity_noise_px / (focal_px
        baseline_m)``.
    window_px : float
        Side of the correlation window.
    """

    focal_px: float
    baseline_m: float
    disparity_noise_px: float
    window_px: float

    @property
    def nearest_m(self) -> float:
        """The shortest measurable distance, in metres."""
        return self.focal_px * self.baseline_m / LARGEST_PX

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Measure depth; see `nbv.data.sensors.Sensor`."""
        z = depth * np.float32(diagonal_m)
        focal = camera.focal_px
        window = self.window_px * focal / self.focal_px
        product = np.float32(self.focal_px * self.baseline_m)
        seen = z > 0
        noise = window_noise(z.shape, window, rng)[seen]
        disparity = product / z[seen] + np.float32(self.disparity_noise_px) * noise
        disparity = np.rint(disparity * STEPS_PER_PX) / np.float32(STEPS_PER_PX)
        in_range = (disparity > 0) & (disparity <= LARGEST_PX)
        measured: Depths = np.zeros_like(z)
        measured[seen] = np.divide(product, disparity, out=np.zeros_like(disparity), where=in_range)
        measured[is_lost(z, incidence_rad(z, focal), window, focal, rng)] = 0
        measured[is_hidden(z, focal, self.baseline_m)] = 0
        return measured / np.float32(diagonal_m)
