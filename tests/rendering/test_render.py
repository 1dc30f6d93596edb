"""Many objects."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from rendering_shapes import procedural, shape_of

from nbv.errors import UserError
from nbv.rendering import open_renderer
from nbv.rendering.camera import Camera
from nbv.rendering.depth_codes import decode_depth
from nbv.rendering.render import render_objects

CAMERA = Camera(image_side=16)


@pytest.fixture(scope="module")
def embree():
    return open_renderer("embree")


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
