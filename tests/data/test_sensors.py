"""What both sensors have in common, and how the configuration opens them."""

import math

import numpy as np
import pytest

from nbv.data.depth_codes import encode_depth
from nbv.data.render import open_renderer, render_objects
from nbv.data.sensors import check_sensor, open_sensor, sensor_settings
from nbv.data.sensors.triangulation import NEAREST_PER_M, STEP_PER_M, axial_m, lateral_px
from nbv.errors import UserError
from nbv.experiment.config import load_config
from rendering_shapes import procedural
from sensor_images import (
    CAMERA,
    CONFIG,
    CONFIGURED,
    DISTANCES_M,
    KINECT,
    STEREO,
    kinect_sigma_m,
    measured,
    plane,
    plate,
    stereo_sigma_m,
)


@pytest.mark.parametrize("z_m", DISTANCES_M)
@pytest.mark.parametrize(
    ("sensor", "sigma_m"), [(KINECT, kinect_sigma_m), (STEREO, stereo_sigma_m)]
)
def test_axial_noise_has_the_published_spread(sensor, sigma_m, z_m):
    # At distances all over one step, as the noise was measured.
    factor = 1 + STEP_PER_M * z_m * np.linspace(-0.5, 0.5, 40, endpoint=False)
    z = (plane(z_m, k=40) * factor[:, None, None]).astype(np.float32)
    values = measured(sensor, z)[:, 8:-8, 8:-8]
    assert (values > 0).all()
    errors = values - z[:, 8:-8, 8:-8]
    assert errors.std() == pytest.approx(sigma_m(z_m), rel=0.03)
    assert abs(errors.mean()) < 0.15 * sigma_m(z_m)


def test_nothing_is_measured_out_of_range():
    assert not measured(KINECT, plane(0.3)).any()
    assert not measured(STEREO, plane(0.15)).any()


@pytest.mark.parametrize("sensor", [KINECT, STEREO])
def test_silhouettes_lose_pixels_and_thin_parts_most(sensor):
    z = plate(1.0)
    thin = np.zeros_like(z)
    thin[:, 10:54, 32] = 1.0
    lost = (measured(sensor, z) == 0) & (z > 0)
    assert not lost[:, 15:-15, 15:-15].any()
    rim = z > 0
    rim[:, 13:51, 13:51] = False
    of_rim = lost[rim].mean()
    of_thin = (measured(sensor, thin) == 0)[thin > 0].mean()
    assert 0.1 < of_rim < of_thin < 0.8


@pytest.mark.parametrize("sensor", [KINECT, STEREO])
def test_an_empty_image_stays_empty_and_can_be_encoded(sensor):
    z = np.zeros((3, 64, 64), np.float32)
    z[1, 30, 30] = 0.8
    values = measured(sensor, z)
    assert not values[[0, 2]].any()
    assert encode_depth(values, CAMERA).shape == z.shape


def opened(name, category="mug", seed=0, elevation=0):
    settings = sensor_settings(CONFIGURED[name], category, seed)
    return open_sensor(settings, CAMERA, category, elevation)


def test_ideal_is_no_sensor_and_depends_on_neither_size_nor_seed():
    settings = sensor_settings(load_config(CONFIG)["sensor"], "mug", 7)
    assert settings == {"name": "ideal"}
    assert open_sensor(settings, CAMERA, "mug", 0) is None


@pytest.mark.parametrize("name", ["kinect", "stereo"])
def test_noise_depends_on_what_is_seen_and_on_no_order(name):
    meshes = {f"mug-{i}": procedural("mug") for i in range(3)}
    renderer = open_renderer("embree")

    def images(chosen, **settings):
        seen = {key: meshes[key] for key in chosen}
        codes = render_objects(seen, 0.0, CAMERA, renderer, opened(name, **settings), 4)
        return dict(zip(chosen, codes, strict=True))

    forwards, backwards = images(list(meshes)), images(list(meshes)[::-1])
    for key in meshes:
        assert np.array_equal(forwards[key], backwards[key])
    assert not np.array_equal(forwards["mug-0"], forwards["mug-1"])
    others = [images(["mug-0"], **one) for one in ({"seed": 1}, {"elevation": 15})]
    for other in others:
        assert not np.array_equal(other["mug-0"], forwards["mug-0"])
    clean = next(render_objects(meshes, 0.0, CAMERA, renderer, n_azimuths=4))
    assert 0.75 < (forwards["mug-0"] > 0).sum() / (clean > 0).sum() < 0.99


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameters": {"baslin_m": 0.1}}, "sensor.parameters.baslin_m: kinect has no such"),
        ({"parameters": {"focal_px": 585}}, "sensor.parameters.baseline_m: kinect needs it"),
        ({"diagonal_m": {}}, "sensor.diagonal_m.mug: sensor=kinect needs the size"),
        ({"name": "kinct"}, "sensor=kinct is unknown: did you mean 'kinect'?"),
    ],
)
def test_a_mistake_is_one_line(change, message):
    with pytest.raises(UserError) as caught:
        check_sensor({**CONFIGURED["kinect"], **change}, ["mug"])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_object_too_near_to_be_measured():
    settings = sensor_settings(CONFIGURED["kinect"], "mug", 0) | {"diagonal_m": 0.1}
    with pytest.raises(UserError, match=r"sensor.diagonal_m=0.1 puts the camera 0.25 m"):
        open_sensor(settings, CAMERA, "mug", 0)


@pytest.mark.parametrize("name", ["kinect", "stereo"])
def test_every_category_has_a_size_at_which_it_is_measured(name):
    categories = load_config(CONFIG)["categories"]
    check_sensor(CONFIGURED[name], categories)
    for category in categories:
        opened(name, category)


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


def test_a_stereo_camera_measures_whole_parts_of_a_pixel():
    values = measured(STEREO, plane(1.0, k=4)).astype(np.float64)
    steps = 424 * 0.05 / values[values > 0] * 32
    assert np.abs(steps - np.rint(steps)).max() < 0.01
