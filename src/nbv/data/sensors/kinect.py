"""The first Kinect: structured light, with the noise that others measured.

- C. V. Nguyen, S. Izadi, D. Lovell: Modeling Kinect Sensor Noise for Improved 3D Reconstruction
  and Tracking. 3DIMPVT 2012. Axial and lateral noise over distance and incidence.
- K. Khoshelham, S. Oude Elberink: Accuracy and Resolution of Kinect Depth Data for Indoor Mapping
  Applications. Sensors 12 (2012) 1437-1454. Depth from disparity, and its steps.
- K. Konolige, P. Mihelich: Technical description of Kinect calibration. wiki.ros.org,
  kinect_calibration/technical. Baseline and correlation window.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nbv.data.camera import Camera
from nbv.data.depth_codes import Depths
from nbv.data.sensors.triangulation import (
    STEEPEST_DEG,
    Metres,
    displaced,
    incidence_rad,
    is_hidden,
    is_lost,
    window_noise,
)

# Khoshelham and Oude Elberink: 1/z = 3.03 - 0.00285 d in 1/m, d = 0, 1, 2, ...
NEAREST_PER_M = 3.03
STEP_PER_M = 0.00285

_GRAZING_RAD = math.radians(60.0)


def axial_m(z: Metres, incidence: Metres) -> Metres:
    """Return the standard deviation of depth, in metres (Nguyen et al.).

    ``0.0012 + 0.0019 (z - 0.4)²``, and from 60° of incidence on ``0.0001 θ² / (√z (π/2 - θ)²)``
    more. Above `STEEPEST_DEG`, where the sensor hardly measures anything, it is constant.
    """
    axial: Metres = np.float32(0.0012) + np.float32(0.0019) * np.square(z - np.float32(0.4))
    root: Metres = np.sqrt(z)
    more = np.float32(0.0001) * np.square(_slant(incidence)) / root
    return np.where(incidence > _GRAZING_RAD, axial + more, axial)


def lateral_px(incidence: Metres) -> Metres:
    """Return the standard deviation of an edge's place, in the sensor's pixels (Nguyen et al.)."""
    return np.float32(0.8) + np.float32(0.035) * _slant(incidence)


def _slant(incidence: Metres) -> Metres:
    angle: Metres = np.minimum(incidence, np.float32(math.radians(STEEPEST_DEG)))
    return angle / (np.float32(math.pi / 2) - angle)


def step_m(z: Metres) -> Metres:
    """Return the distance between neighbouring depths that can be measured, in metres."""
    return np.float32(STEP_PER_M) * z**2


def quantised(z: Metres) -> Metres:
    """Return the nearest depth that can be measured, in metres; 0 out of range."""
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
        Focal length in the sensor's pixels, the unit of lateral noise and window.
    baseline_m : float
        From the camera to the projector, which casts shadows.
    window_px : float
        Side of the correlation window.
    """

    focal_px: float
    baseline_m: float
    window_px: float

    @property
    def nearest_m(self) -> float:
        """The shortest distance that it can measure, in metres."""
        return 1 / NEAREST_PER_M

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Return measured depth: see `nbv.data.sensors.Sensor`."""
        z = depth * np.float32(diagonal_m)
        focal = camera.focal_px
        per_pixel = focal / self.focal_px
        window = self.window_px * per_pixel
        incidence = incidence_rad(z, focal)
        seen = z > 0
        there = z[seen]
        # The published noise is that of quantised depth and includes the steps.
        variance = np.square(axial_m(there, incidence[seen])) - np.square(step_m(there)) / 12
        sigma: Metres = np.sqrt(variance)
        noise = window_noise(z.shape, window, rng)[seen]
        measured = np.zeros_like(z)
        measured[seen] = quantised(there + sigma * noise)
        measured[is_lost(z, incidence, window, focal, rng)] = 0
        measured[is_hidden(z, focal, self.baseline_m)] = 0
        lateral = lateral_px(incidence) * np.float32(per_pixel)
        return displaced(measured, z, lateral, focal, rng) / np.float32(diagonal_m)
