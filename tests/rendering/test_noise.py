"""Sensors against the formulas that they are made of, on surfaces whose depth is known exactly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rendering_shapes import procedural

from nbv.config import load_config
from nbv.errors import UserError
from nbv.rendering import open_renderer
from nbv.rendering.camera import Camera
from nbv.rendering.depth_codes import encode_depth
from nbv.rendering.noise import (
    check_sensor,
    ideal,
    open_sensor,
    sensor_settings,
    triangulation,
)
from nbv.rendering.noise.kinect import NEAREST_PER_M, STEP_PER_M, Kinect, axial_m, lateral_px
from nbv.rendering.noise.stereo import Stereo
from nbv.rendering.render import render_objects

CONFIG = Path(__file__).parents[2] / "config"
CONFIGURED = {
    name: load_config(CONFIG, [f"sensor={name}"])["sensor"] for name in ("kinect", "stereo")
}
KINECT = Kinect(**CONFIGURED["kinect"]["parameters"])
STEREO = Stereo(**CONFIGURED["stereo"]["parameters"])
CAMERA = Camera()
DISTANCES_M = (0.45, 0.8, 1.3, 2.0, 3.0)


def plane(z_m: float, tilt_deg: float = 0.0, side: int = 64, k: int = 1):
    """Depth in metres of a plane that fills the image, turned about the vertical axis."""
    column = (np.arange(side) + 0.5 - side / 2) / Camera(image_side=side).focal_px
    depth = z_m / (1 - column * math.tan(math.radians(tilt_deg)))
    assert (depth > 0).all()
    return np.broadcast_to(depth, (k, side, side)).astype(np.float32)


def plate(z_m: float, half: int = 20, k: int = 8):
    """A square, front on, in an otherwise empty image."""
    image = np.zeros((k, 64, 64), np.float32)
    image[:, 32 - half : 32 + half, 32 - half : 32 + half] = z_m
    return image


def read(sensor, z, seed=0):
    """What is read of depth in metres (one metre to the diagonal)."""
    return sensor(z, CAMERA, 1.0, np.random.default_rng(seed))


def kinect_sigma_m(z_m):
    return 0.0012 + 0.0019 * (z_m - 0.4) ** 2


def stereo_sigma_m(z_m):
    return z_m**2 * 0.08 / (424 * 0.05)


@pytest.mark.parametrize("z_m", DISTANCES_M)
@pytest.mark.parametrize(
    ("sensor", "sigma_m"), [(KINECT, kinect_sigma_m), (STEREO, stereo_sigma_m)]
)
def test_axial_noise_has_the_published_spread(sensor, sigma_m, z_m):
    # At distances all over one step, as the noise was measured.
    factor = 1 + STEP_PER_M * z_m * np.linspace(-0.5, 0.5, 40, endpoint=False)
    z = (plane(z_m, k=40) * factor[:, None, None]).astype(np.float32)
    readings = read(sensor, z)[:, 8:-8, 8:-8]
    assert (readings > 0).all()
    errors = readings - z[:, 8:-8, 8:-8]
    assert errors.std() == pytest.approx(sigma_m(z_m), rel=0.03)
    assert abs(errors.mean()) < 0.15 * sigma_m(z_m)


def test_what_is_read_scales_with_the_object():
    depth = plane(2.5, k=2)
    small, large = (
        KINECT(depth, CAMERA, size, np.random.default_rng(0)) * size for size in (0.2, 0.4)
    )
    for readings, z_m in ((small, 0.5), (large, 1.0)):
        inner = readings[:, 8:-8, 8:-8]
        assert (inner - z_m).std() == pytest.approx(kinect_sigma_m(z_m), rel=0.06)


@pytest.mark.parametrize("z_m", DISTANCES_M)
def test_a_kinect_reads_whole_steps_of_disparity(z_m):
    readings = read(KINECT, plane(z_m, k=4)).astype(np.float64)
    level = (NEAREST_PER_M - 1 / readings[readings > 0]) / STEP_PER_M
    assert np.abs(level - np.rint(level)).max() < 0.01
    levels = np.unique(np.rint(level))
    assert len(levels) > 1
    depths = 1 / (NEAREST_PER_M - STEP_PER_M * np.arange(levels.min(), levels.max() + 1))
    assert np.diff(depths) == pytest.approx(STEP_PER_M * (depths[:-1] * depths[1:]))


def test_a_stereo_camera_reads_whole_parts_of_a_pixel():
    readings = read(STEREO, plane(1.0, k=4)).astype(np.float64)
    steps = 424 * 0.05 / readings[readings > 0] * 32
    assert np.abs(steps - np.rint(steps)).max() < 0.01


def test_nothing_is_read_out_of_range():
    assert not read(KINECT, plane(0.3)).any()
    assert not read(STEREO, plane(0.15)).any()


def test_noise_is_shared_by_neighbours_and_by_nobody_else():
    noise = triangulation.window_noise((200, 64, 64), 2.2, np.random.default_rng(0))
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
    found = np.degrees(triangulation.incidence_rad(z, CAMERA.focal_px)[0])
    assert np.abs(found - np.degrees(np.arccos(np.clip(cosine, -1, 1)))).max() < 0.6


def test_an_edge_is_not_steep():
    z = plate(1.0, k=1)
    z[0, 20:40, 20:40] = 0.8
    found = np.degrees(triangulation.incidence_rad(z, CAMERA.focal_px)[z > 0])
    assert found.max() < 13  # the ray's own angle at the edge of the plate


def test_grazing_surfaces_are_noisier_and_lost_more():
    lost, spread = [], []
    for tilt_deg in (0, 40, 55, 65, 72, 77):
        z = plane(1.0, tilt_deg, k=30)[:, :, 8:-8]
        window = np.zeros((30, 64, 64), np.float32)
        window[:, :, 8:-8] = z
        readings = read(KINECT, window)[:, 12:-12, 16:-16]
        there = window[:, 12:-12, 16:-16]
        lost.append((readings == 0).mean())
        errors = (readings - there)[readings > 0]
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


@pytest.mark.parametrize("sensor", [KINECT, STEREO])
def test_silhouettes_lose_pixels_and_thin_parts_most(sensor):
    z = plate(1.0)
    thin = np.zeros_like(z)
    thin[:, 10:54, 32] = 1.0
    lost = (read(sensor, z) == 0) & (z > 0)
    assert not lost[:, 15:-15, 15:-15].any()
    rim = z > 0
    rim[:, 13:51, 13:51] = False
    of_rim = lost[rim].mean()
    of_thin = (read(sensor, thin) == 0)[thin > 0].mean()
    assert 0.1 < of_rim < of_thin < 0.8


def test_a_straight_edge_moves_as_far_as_measured():
    """What is crossed at random is, on average, the edge's mean displacement."""
    sigma = 0.4
    z = plate(1.0, k=200)
    moved = triangulation.displaced(
        z, z, np.full_like(z, sigma), CAMERA.focal_px, np.random.default_rng(0)
    )
    rows = slice(16, 48)
    outside, inside = moved[:, rows, 11], moved[:, rows, 12]
    # An edge halfway, give or take half a pixel, is crossed with E[max(shift, 0)] from each side.
    expected = sigma / math.sqrt(2 * math.pi)
    assert (outside > 0).mean() == pytest.approx(expected, abs=0.01)
    assert (inside == 0).mean() == pytest.approx(expected, abs=0.01)
    assert np.array_equal(moved[:, 20:44, 20:44], z[:, 20:44, 20:44])


def test_a_step_casts_its_shadow_to_the_left():
    """As wide as the difference of disparities, whatever the distance."""
    far, near, baseline = 1.0, 0.8, 0.2
    z = plane(far).copy()
    z[:, :, 30:40] = near
    hidden = triangulation.is_hidden(z, CAMERA.focal_px, baseline)
    width = CAMERA.focal_px * baseline * (1 / near - 1 / far)
    columns = np.flatnonzero(hidden[0, 32])
    assert columns.max() == 29 or columns.max() == 28
    assert len(columns) == pytest.approx(min(width, 10), abs=1)
    assert (hidden == hidden[:, :1]).all()
    assert not triangulation.is_hidden(plane(far), CAMERA.focal_px, baseline).any()


def test_a_surface_that_turns_away_from_the_second_eye_is_hidden():
    """Nothing of a cylinder's side is seen by the second eye beyond the tangent from there."""
    side, radius, away, baseline = 256, 0.2, 1.0, 0.3
    focal = Camera(image_side=side).focal_px
    tangent = (np.arange(side) + 0.5 - side / 2) / focal
    # Where the ray (x, 1) first meets the circle around (0, away).
    root = away**2 - (1 + tangent**2) * (away**2 - radius**2)
    depth = np.where(root > 0, (away - np.sqrt(np.maximum(root, 0))) / (1 + tangent**2), 0)
    z = np.broadcast_to(depth.astype(np.float32), (1, 4, side))
    hidden = triangulation.is_hidden(z, focal, baseline)[0, 0]
    eye = np.array([baseline, 0.0])
    points = np.stack([tangent * depth, depth], axis=1)
    normals = (points - [0, away]) / radius
    faces_away = ((eye - points) * normals).sum(axis=1) < 0
    seen = depth > 0
    assert (hidden != faces_away)[seen].mean() < 0.05
    assert faces_away[seen].mean() > 0.02


@pytest.mark.parametrize("sensor", [KINECT, STEREO])
def test_an_empty_image_stays_empty_and_can_be_encoded(sensor):
    z = np.zeros((3, 64, 64), np.float32)
    z[1, 30, 30] = 0.8
    readings = read(sensor, z)
    assert not readings[[0, 2]].any()
    assert encode_depth(readings, CAMERA).shape == z.shape


def measure(name, category="mug", seed=0, elevation=0):
    settings = sensor_settings(CONFIGURED[name], category, seed)
    return open_sensor(settings, CAMERA, category, elevation)


def test_ideal_is_the_identity():
    depth = np.random.default_rng(0).uniform(2, 3, (2, 4, 4)).astype(np.float32)
    settings = sensor_settings(load_config(CONFIG)["sensor"], "mug", 7)
    assert settings == {"name": "ideal"}
    assert open_sensor(settings, CAMERA, "mug", 0) is ideal
    assert ideal(depth, "any") is depth


@pytest.mark.parametrize("name", ["kinect", "stereo"])
def test_noise_depends_on_what_is_seen_and_on_no_order(name):
    meshes = {f"mug-{i}": procedural("mug") for i in range(3)}
    renderer = open_renderer("embree")

    def images(chosen, **settings):
        seen = {key: meshes[key] for key in chosen}
        codes = render_objects(seen, 0.0, CAMERA, renderer, measure(name, **settings), 4)
        return dict(zip(chosen, codes, strict=True))

    forwards, backwards = images(list(meshes)), images(list(meshes)[::-1])
    for key in meshes:
        assert np.array_equal(forwards[key], backwards[key])
    assert not np.array_equal(forwards["mug-0"], forwards["mug-1"])
    others = [images(["mug-0"], **one) for one in ({"seed": 1}, {"elevation": 15})]
    for other in others:
        assert not np.array_equal(other["mug-0"], forwards["mug-0"])
    clean = next(render_objects(meshes, 0.0, CAMERA, renderer, n_azimuths=4))
    kept = (forwards["mug-0"] > 0) & (clean > 0)
    assert 0.75 < kept.sum() / (clean > 0).sum() < 0.99


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": {"baslin_m": 0.1}}, "sensor.parameters.baslin_m: kinect has no such"),
        ({"parameters": {"focal_px": 585}}, "sensor.parameters.baseline_m: kinect needs it"),
        ({"parameters": {"focal_px": -1}}, "sensor.parameters.focal_px=-1 is out of range"),
        ({"diagonal_m": {}}, "sensor.diagonal_m.mug: sensor=kinect needs the size"),
        ({"name": "kinct"}, "sensor=kinct is unknown: did you mean 'kinect'?"),
    ],
)
def test_a_mistake_is_one_line(change, message):
    with pytest.raises(UserError) as caught:
        check_sensor({**CONFIGURED["kinect"], **change}, ["mug"])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_object_too_near_to_be_read():
    settings = sensor_settings(CONFIGURED["kinect"], "mug", 0) | {"diagonal_m": 0.1}
    with pytest.raises(UserError, match=r"sensor.diagonal_m=0.1 puts the camera 0.25 m"):
        open_sensor(settings, CAMERA, "mug", 0)


@pytest.mark.parametrize("name", ["kinect", "stereo"])
def test_every_category_has_a_size_at_which_it_is_read(name):
    categories = load_config(CONFIG)["categories"]
    check_sensor(CONFIGURED[name], categories)
    for category in categories:
        measure(name, category)
