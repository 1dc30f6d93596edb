"""Many objects."""

import numpy as np
import pytest
import trimesh

from nbv.data.camera import Camera
from nbv.data.depth_codes import decode_depth
from nbv.data.render import render_objects
from nbv.errors import UserError
from rendering_shapes import procedural, shape_of

CAMERA = Camera(image_side=16)


@pytest.fixture(scope="module")
def meshes():
    return {"box": shape_of(trimesh.creation.box((1, 2, 3))), "mug": procedural("mug")}


def test_fewer_azimuths_are_every_so_many_of_all(embree, meshes):
    few = np.stack(list(render_objects(meshes, 0.0, CAMERA, embree, n_azimuths=8)))
    many = np.stack(list(render_objects(meshes, 0.0, CAMERA, embree, n_azimuths=24)))
    assert np.array_equal(few, many[:, ::3])


def test_a_sensor_measures_before_depth_is_encoded(embree, meshes):
    camera = Camera(image_side=16, framing="axis")

    def nearer(depth, object_id):
        assert object_id in meshes
        return np.where(depth > 0, depth - np.float32(0.1), 0)

    plain = next(render_objects(meshes, 0.0, camera, embree, n_azimuths=4))
    shifted = next(render_objects(meshes, 0.0, camera, embree, nearer, n_azimuths=4))
    seen = plain > 0
    gain = decode_depth(shifted)[seen] - decode_depth(plain)[seen]
    assert np.allclose(gain, 0.1, atol=0.0051)


def test_an_object_that_does_not_fit_is_named(embree, meshes):
    large = dict(meshes, huge=type(meshes["box"])(meshes["box"].vertices * 3, meshes["box"].faces))
    with pytest.raises(UserError, match=r"^huge: the object .*(leaves|behind)") as caught:
        list(render_objects(large, 0.0, CAMERA, embree, n_azimuths=4))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("camera", "elevation_deg"),
    [
        (Camera(image_side=16, distance=1e6), 0.0),
        (Camera(image_side=16, fov_deg=179.9), 15.0),
    ],
)
def test_an_object_too_small_to_be_seen_stops_with_its_name(embree, meshes, camera, elevation_deg):
    message = r"^box: the object covers no pixel in [1-8] of 8 views, first at azimuth .*camera\."
    with pytest.raises(UserError, match=message) as caught:
        list(render_objects(meshes, elevation_deg, camera, embree, n_azimuths=8))
    assert "\n" not in str(caught.value)


def test_a_sensor_that_measures_nothing_stops_and_a_gap_is_logged(embree, meshes, caplog):
    def blind(depth, object_id):
        return np.zeros_like(depth)

    with pytest.raises(UserError, match=r"^box: the sensor measures nothing .* in any view"):
        list(render_objects(meshes, 0.0, CAMERA, embree, blind, n_azimuths=4))

    def misses_two(depth, object_id):
        return np.concatenate([np.zeros_like(depth[:2]), depth[2:]])

    assert len(list(render_objects(meshes, 0.0, CAMERA, embree, misses_two, n_azimuths=4))) == 2
    assert "box: the sensor measures nothing in 2 of 4 views" in caplog.text


def test_a_renderer_s_own_error_names_the_object(meshes):
    class Broken:
        def render(self, *given):
            raise ValueError("no context")

    with pytest.raises(RuntimeError, match=r"^box: ValueError: no context"):
        list(render_objects(meshes, 0.0, CAMERA, Broken(), n_azimuths=4))
