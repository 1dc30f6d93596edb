"""The Kinect, compared with the published formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nbv.data.sensors.triangulation import NEAREST_PER_M, STEP_PER_M, axial_m, lateral_px
from sensor_images import CAMERA, DISTANCES_M, KINECT, kinect_sigma_m, measured, plane


def test_noise_scales_with_the_size_of_the_object():
    depth = plane(2.5, k=2)
    small, large = (
        KINECT(depth, CAMERA, size, np.random.default_rng(0)) * size for size in (0.2, 0.4)
    )
    for values, z_m in ((small, 0.5), (large, 1.0)):
        inner = values[:, 8:-8, 8:-8]
        assert (inner - z_m).std() == pytest.approx(kinect_sigma_m(z_m), rel=0.06)


@pytest.mark.parametrize("z_m", DISTANCES_M)
def test_a_kinect_measures_whole_steps_of_disparity(z_m):
    values = measured(KINECT, plane(z_m, k=4)).astype(np.float64)
    level = (NEAREST_PER_M - 1 / values[values > 0]) / STEP_PER_M
    assert np.abs(level - np.rint(level)).max() < 0.01
    levels = np.unique(np.rint(level))
    assert len(levels) > 1
    depths = 1 / (NEAREST_PER_M - STEP_PER_M * np.arange(levels.min(), levels.max() + 1))
    assert np.diff(depths) == pytest.approx(STEP_PER_M * (depths[:-1] * depths[1:]))


def test_grazing_surfaces_are_noisier_and_lost_more():
    lost, spread = [], []
    for tilt_deg in (0, 40, 55, 65, 72, 77):
        z = plane(1.0, tilt_deg, k=30)[:, :, 8:-8]
        window = np.zeros((30, 64, 64), np.float32)
        window[:, :, 8:-8] = z
        values = measured(KINECT, window)[:, 12:-12, 16:-16]
        there = window[:, 12:-12, 16:-16]
        lost.append((values == 0).mean())
        errors = (values - there)[values > 0]
        spread.append(errors.std() / kinect_sigma_m(there).mean())
    assert lost[0] == lost[1] == 0
    assert np.all(np.diff(lost[1:]) >= 0)
    assert lost[-1] > 0.4 > lost[3] > 0.02
    assert np.all(np.diff(spread[2:]) > 0)


def test_the_formulas_of_grazing_incidence():
    angle, z = np.float32(math.radians(70)), np.float32(1.2)
    slant = 70 / (90 - 70)
    expected = kinect_sigma_m(1.2) + 0.0001 * slant**2 / math.sqrt(1.2)
    assert axial_m(z, angle) == pytest.approx(expected, rel=1e-5)
    assert axial_m(z, np.float32(math.radians(59))) == pytest.approx(kinect_sigma_m(1.2), rel=1e-5)
    assert lateral_px(angle) == pytest.approx(0.8 + 0.035 * slant, rel=1e-5)
