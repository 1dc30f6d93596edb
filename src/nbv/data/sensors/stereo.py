"""Active stereo: a camera such as the RealSense D435.

- L. Keselman, J. I. Woodfill, A. Grunnet-Jepsen, A. Bhowmik: Intel RealSense Stereoscopic Depth
  Cameras. CVPR Workshops 2017. An error that is constant in disparity; the R200's windows.
- A. Grunnet-Jepsen, J. N. Sweetser, J. Woodfill: Best-Known-Methods for Tuning Intel RealSense
  D400 Depth Cameras for Best Performance. 2019. The D435's figures, and its shortest distance.
- A. Grunnet-Jepsen et al.: Subpixel Linearity Improvement for Intel RealSense Depth Camera D400
  Series. 2019. Steps of 1/32 pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nbv.data.camera import Camera
from nbv.data.depth_codes import Depths
from nbv.data.sensors.triangulation import incidence_rad, is_hidden, is_lost, window_noise

STEPS_PER_PX = 32
LARGEST_PX = 126
"""The largest disparity that the camera searches."""


@dataclass(frozen=True)
class Stereo:
    """An active stereo camera.

    Attributes
    ----------
    focal_px : float
        Focal length in the sensor's pixels, the unit of noise and window.
    baseline_m : float
        From the left camera, whose image it is, to the right one.
    disparity_noise_px : float
        Standard deviation of a disparity. That of depth is ``z² disparity_noise_px / (focal_px
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
        """The shortest distance that it can measure, in metres."""
        return self.focal_px * self.baseline_m / LARGEST_PX

    def __call__(
        self, depth: Depths, camera: Camera, diagonal_m: float, rng: np.random.Generator
    ) -> Depths:
        """Return measured depth: see `nbv.data.sensors.Sensor`."""
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
