"""Incidence, shared noise, shadows and moved edges, compared with geometry and statistics."""

import math

import numpy as np
import pytest
from scipy import ndimage

from nbv.data.camera import Camera
from nbv.data.sensors.triangulation import (
    displaced,
    incidence_rad,
    is_hidden,
    same_surface,
    window_noise,
    window_share,
    window_weights,
)
from sensor_images import CAMERA, plane, plate


def test_noise_is_shared_by_neighbours_and_by_nobody_else():
    noise = window_noise((200, 64, 64), 2.2, np.random.default_rng(0))
    assert noise.std() == pytest.approx(1, abs=0.01)

    def correlation(pixels, axis):
        return float((noise * np.roll(noise, pixels, axis)).mean())

    weights = np.array([0.6, 1.0, 0.6])
    expected = np.correlate(weights, weights, "full")[2:] / (weights**2).sum()
    for axis in (1, 2):
        found = [correlation(pixels, axis) for pixels in (1, 2, 3)]
        assert found == pytest.approx([*expected[1:], 0.0], abs=0.01)
    assert correlation(1, 0) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("tilt_deg", [0, 20, 45, 60, 75])
def test_incidence_on_a_tilted_plane(tilt_deg):
    z = plane(1.0, tilt_deg)
    tangent = (np.arange(64) + 0.5 - 32) / CAMERA.focal_px
    tilt = math.radians(tilt_deg)
    normal = np.array([-math.sin(tilt), 0, math.cos(tilt)])
    x, y = np.meshgrid(tangent, tangent)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    cosine = rays @ normal / np.linalg.norm(rays, axis=-1)
    found = np.degrees(incidence_rad(z, CAMERA.focal_px)[0])
    assert np.abs(found - np.degrees(np.arccos(np.clip(cosine, -1, 1)))).max() < 0.6


def test_an_edge_is_not_steep():
    z = plate(1.0, k=1)
    z[0, 20:40, 20:40] = 0.8
    found = np.degrees(incidence_rad(z, CAMERA.focal_px)[z > 0])
    assert found.max() < 13  # the ray's own angle at the edge of the plate


def test_a_straight_edge_moves_as_far_as_measured():
    """What is crossed at random is, on average, the edge's mean displacement."""
    sigma = 0.4
    z = plate(1.0, k=200)
    moved = displaced(z, z, np.full_like(z, sigma), CAMERA.focal_px, np.random.default_rng(0))
    rows = slice(16, 48)
    outside, inside = moved[:, rows, 11], moved[:, rows, 12]
    # An edge halfway, give or take half a pixel, is crossed with E[max(shift, 0)] from each side.
    expected = sigma / math.sqrt(2 * math.pi)
    assert (outside > 0).mean() == pytest.approx(expected, abs=0.01)
    assert (inside == 0).mean() == pytest.approx(expected, abs=0.01)
    assert np.array_equal(moved[:, 20:44, 20:44], z[:, 20:44, 20:44])


@pytest.mark.parametrize("seed", range(5))
def test_pixel_by_pixel_windows_and_displacements_are_the_same(seed):
    """Both are defined for each pixel alone; the module takes all at once, near surfaces only."""
    rng = np.random.default_rng(seed)
    shape, focal, width = (3, 14, 17), 40.0, 3.4
    seen = ndimage.gaussian_filter(rng.standard_normal(shape), (0, 2, 2)) > 0.05
    z = np.where(seen, 1 + 0.02 * rng.integers(0, 20, shape), 0).astype(np.float32)
    measured = np.where(rng.random(shape) < 0.8, z, 0).astype(np.float32)
    moved = displaced(measured, z, np.full_like(z, 0.9), focal, np.random.default_rng(seed))
    share = window_share(z, width, focal)
    weights, again = window_weights(width), np.random.default_rng(seed)
    shifts = []
    for _ in range(2):
        shift = np.float32(0.9) * again.standard_normal(shape, dtype=np.float32)
        shifts.append(np.floor(shift + again.random(shape, dtype=np.float32)).astype(int))
    reach = len(weights) // 2
    for image, row, column in np.ndindex(shape):
        here = z[image, row, column]
        there = (
            np.clip(row + shifts[0][image, row, column], 0, shape[1] - 1),
            np.clip(column + shifts[1][image, row, column], 0, shape[2] - 1),
        )
        apart = math.hypot(there[0] - row, there[1] - column)
        stays = same_surface(here, z[image][there], apart, focal)
        wanted = measured[image, row, column] if stays else measured[image][there]
        assert moved[image, row, column] == wanted
        own = 0.0
        for down, across in np.ndindex(len(weights), len(weights)):
            at = row + down - reach, column + across - reach
            if 0 <= at[0] < shape[1] and 0 <= at[1] < shape[2]:
                apart = math.hypot(down - reach, across - reach)
                is_same = same_surface(here, z[image][at], apart, focal)
                own += weights[down] * weights[across] * bool(is_same)
        assert share[image, row, column] == pytest.approx(own / weights.sum() ** 2, abs=1e-6)


def test_a_step_casts_its_shadow_to_the_left():
    """As wide as the difference of disparities, whatever the distance."""
    far, near, baseline = 1.0, 0.8, 0.2
    z = plane(far).copy()
    z[:, :, 30:40] = near
    hidden = is_hidden(z, CAMERA.focal_px, baseline)
    width = CAMERA.focal_px * baseline * (1 / near - 1 / far)
    columns = np.flatnonzero(hidden[0, 32])
    assert columns.max() == 29 or columns.max() == 28
    assert len(columns) == pytest.approx(min(width, 10), abs=1)
    assert (hidden == hidden[:, :1]).all()
    assert not is_hidden(plane(far), CAMERA.focal_px, baseline).any()


def test_a_surface_that_turns_away_from_the_second_eye_is_hidden():
    """Nothing of a cylinder's side is seen by the second eye behind the tangent from there."""
    side, radius, away, baseline = 256, 0.2, 1.0, 0.3
    focal = Camera(image_side=side).focal_px
    tangent = (np.arange(side) + 0.5 - side / 2) / focal
    # Where the ray (x, 1) first meets the circle around (0, away).
    root = away**2 - (1 + tangent**2) * (away**2 - radius**2)
    depth = np.where(root > 0, (away - np.sqrt(np.maximum(root, 0))) / (1 + tangent**2), 0)
    z = np.broadcast_to(depth.astype(np.float32), (1, 4, side))
    hidden = is_hidden(z, focal, baseline)[0, 0]
    eye = np.array([baseline, 0.0])
    points = np.stack([tangent * depth, depth], axis=1)
    normals = (points - [0, away]) / radius
    faces_away = ((eye - points) * normals).sum(axis=1) < 0
    seen = depth > 0
    assert (hidden != faces_away)[seen].mean() < 0.05
    assert faces_away[seen].mean() > 0.02
