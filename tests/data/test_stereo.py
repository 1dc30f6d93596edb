"""The stereo camera, compared with the published steps."""

from __future__ import annotations

import numpy as np

from sensor_images import STEREO, measured, plane


def test_a_stereo_camera_measures_whole_parts_of_a_pixel():
    values = measured(STEREO, plane(1.0, k=4)).astype(np.float64)
    steps = 424 * 0.05 / values[values > 0] * 32
    assert np.abs(steps - np.rint(steps)).max() < 0.01
