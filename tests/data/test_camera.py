"""Where things fall in the image, told from projective geometry alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nbv.data.camera import Camera, hull_vertices, object_views, viewpoint_frames
from nbv.errors import UserError

AZIMUTHS = np.arange(0.0, 360.0, 7.5)


@st.composite
def unit_objects(draw):
    """Vertices of a box-centred object with a unit diagonal, and faces that use them all."""
    n = draw(st.integers(3, 12))
    vertices = draw(arrays(np.float64, (n, 3), elements=st.floats(-1, 1, width=32)))
    extent = np.ptp(vertices, axis=0)
    if np.linalg.norm(extent) < 1e-3:
        vertices[0] += 1.0
        extent = np.ptp(vertices, axis=0)
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    faces = np.stack([np.arange(n), (np.arange(n) + 1) % n, (np.arange(n) + 2) % n], axis=1)
    return (vertices - middle) / np.linalg.norm(extent), faces


def pixels(views, points):
    """Project points into each view by its axes and principal point: column, row."""
    relative = np.asarray(points)[None] - views.position[:, None]
    x = np.einsum("knd,kd->kn", relative, views.right)
    y = np.einsum("knd,kd->kn", relative, views.up)
    depth = np.einsum("knd,kd->kn", relative, views.forward)
    focal = views.camera.focal_px
    column, row = views.principal_px.T[:, :, None]
    return column + focal * x / depth, row - focal * y / depth


@given(elevation=st.floats(-90, 90))
def test_frames_are_right_handed_and_directed_at_the_origin(elevation):
    right, up, forward = viewpoint_frames(elevation, AZIMUTHS)
    frames = np.stack([right, up, -forward], axis=1)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(frames), 1.0)
    towards_camera = -forward
    assert np.allclose(towards_camera[:, 2], np.sin(np.radians(elevation)))
    if abs(elevation) < 89:
        azimuth = np.degrees(np.arctan2(towards_camera[:, 1], towards_camera[:, 0])) % 360
        assert np.allclose((azimuth - AZIMUTHS + 180) % 360, 180)


@pytest.mark.parametrize(
    ("azimuth", "point", "side"),
    [
        (0, (0, 0.3, 0), "right"),
        (90, (0.3, 0, 0), "left"),
        (0, (0, 0, 0.3), "top"),
        (90, (0, 0, -0.3), "bottom"),
    ],
)
def test_nothing_is_mirrored(azimuth, point, side):
    triangle = np.array([[0, 0, 0], point, [0.01, 0.01, 0.01]])
    camera = Camera(framing="axis")
    views = object_views(triangle, [[0, 1, 2]], 0.0, azimuth, camera)
    column, row = (values[0, 0] for values in pixels(views, [point]))
    assert {
        "left": column < 31,
        "right": column > 33,
        "top": row < 31,
        "bottom": row > 33,
    }[side]


@given(
    shape=unit_objects(),
    elevation=st.floats(0, 90),
    framing=st.sampled_from(["silhouette", "axis"]),
)
def test_the_default_camera_contains_every_unit_object(shape, elevation, framing):
    vertices, faces = shape
    views = object_views(vertices, faces, elevation, AZIMUTHS, Camera(framing=framing))
    column, row = pixels(views, vertices)
    assert min(column.min(), row.min()) >= 0
    assert max(column.max(), row.max()) <= 64


@given(shape=unit_objects(), elevation=st.floats(0, 90))
def test_silhouette_framing_centres_the_bounding_box_of_what_is_projected(shape, elevation):
    vertices, faces = shape
    views = object_views(vertices, faces, elevation, AZIMUTHS, Camera())
    for position in pixels(views, vertices):
        assert np.allclose(position.min(axis=1) + position.max(axis=1), 64.0, atol=1e-8)
    column, row = pixels(views, vertices)
    bounds = [column.min(1), column.max(1), row.min(1), row.max(1)]
    assert np.allclose(views.outline_px, np.stack(bounds, axis=1), atol=1e-8)


@given(shape=unit_objects())
def test_axis_framing_puts_the_origin_in_the_middle(shape):
    views = object_views(*shape, 20.0, AZIMUTHS, Camera(framing="axis"))
    assert np.allclose(pixels(views, [[0.0, 0.0, 0.0]]), 32.0)


def test_framing_neither_scales_nor_turns():
    rng = np.random.default_rng(0)
    vertices = rng.uniform(-0.25, 0.25, (20, 3)) + np.array([0.05, 0.02, 0.0])
    faces = np.arange(18).reshape(-1, 3)
    framed, plain = (
        object_views(vertices, faces, 30.0, AZIMUTHS, Camera(framing=framing))
        for framing in ("silhouette", "axis")
    )
    shift = np.array(pixels(framed, vertices)) - np.array(pixels(plain, vertices))
    assert np.allclose(shift, shift[:, :, :1])
    assert np.abs(shift).max() > 1


def test_the_hull_outlines_like_all_vertices_and_leaves_the_unused_out():
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(500, 3)) * 0.1
    faces = np.arange(498).reshape(-1, 3)
    vertices[499] = 100.0
    hull = hull_vertices(vertices, faces)
    assert len(hull) < 200
    directions = rng.normal(size=(50, 3))
    assert np.allclose((hull @ directions.T).max(0), (vertices[:498] @ directions.T).max(0))


def test_a_flat_object_has_an_outline():
    rng = np.random.default_rng(2)
    vertices = np.column_stack([rng.uniform(-0.3, 0.3, (200, 2)), np.zeros(200)])
    faces = np.arange(198).reshape(-1, 3)
    assert len(hull_vertices(vertices, faces)) == 198
    object_views(vertices, faces, 0.0, AZIMUTHS, Camera())


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"framing": "silouette"}, "did you mean 'silhouette'"),
        ({"distance": 0.0}, "distance=0.0"),
        ({"fov_deg": 180.0}, "fov_deg=180.0"),
        ({"image_side": 0}, "image_side=0"),
    ],
)
def test_a_camera_without_sense_is_refused(settings, named):
    with pytest.raises(UserError, match=named) as caught:
        Camera(**settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("camera", "named"),
    [
        (Camera(fov_deg=10.0), r"leaves the image by .* raise fov_deg=10 or distance=2\.5"),
        (Camera(distance=0.4), r"behind the camera at azimuth .* distance=0\.4"),
    ],
)
def test_an_object_out_of_sight_is_refused(camera, named):
    vertices = np.array([[-0.45, 0, 0], [0.45, 0, 0], [0, 0.1, 0.1]])
    with pytest.raises(UserError, match=named) as caught:
        object_views(vertices, [[0, 1, 2]], 0.0, AZIMUTHS, camera)
    assert "\n" not in str(caught.value)
