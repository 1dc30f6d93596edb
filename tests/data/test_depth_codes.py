"""Depth as bytes and back."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nbv.data.camera import Camera
from nbv.data.depth_codes import STEP, crop_measured, decode_depth, encode_depth, sensor_camera
from nbv.data.render import open_renderer, render_objects
from nbv.data.sensors import open_sensor, sensor_settings
from rendering_shapes import shape_of
from sensor_images import CONFIGURED

DEPTHS = arrays(
    np.float32, (3, 6, 6), elements=st.one_of(st.just(0.0), st.floats(2.0, 3.0, width=32))
)


@given(depth=DEPTHS, framing=st.sampled_from(["silhouette", "axis"]))
def test_offsets_survive_within_half_a_step(depth, framing):
    camera = Camera(framing=framing)
    codes = encode_depth(depth, camera)
    assert codes.dtype == np.uint8
    offsets = decode_depth(codes)
    assert np.array_equal(np.isnan(offsets), depth == 0)
    assert np.array_equal(codes == 0, depth == 0)
    is_centred = framing == "silhouette"
    reference = [
        np.median(image[image > 0]) if is_centred and image.any() else camera.distance
        for image in depth
    ]
    expected = np.array(reference, dtype=np.float32)[:, None, None] - depth
    seen = (depth > 0) & (np.abs(expected) < 0.63)
    assert np.all(np.abs(offsets - expected)[seen] <= STEP / 2 + 1e-6)


@given(depth=DEPTHS)
def test_nearer_is_never_smaller(depth):
    codes = encode_depth(depth, Camera())
    for image, code in zip(depth, codes, strict=True):
        order = np.argsort(-image[image > 0], kind="stable")
        assert np.all(np.diff(code[image > 0][order].astype(int)) >= 0)


@given(depth=DEPTHS, away=st.floats(-1.0, 5.0))
def test_a_crop_does_not_tell_the_distance(depth, away):
    """Only differences of depth survive silhouette framing: up to one code's rounding."""
    moved = np.where(depth > 0, depth + np.float32(away), 0).astype(np.float32)
    before, after = (encode_depth(d, Camera()).astype(int) for d in (depth, moved))
    assert np.abs(before - after).max() <= 1


def test_the_codes_of_known_depths():
    image = np.zeros((1, 1, 8), np.float32)
    image[0, 0, :7] = [2.5, 2.495, 2.505, 2.5024, 2.4976, 1.0, 9.0]
    assert encode_depth(image, Camera(framing="axis")).ravel().tolist() == [
        *(128, 129, 127, 128, 128, 255, 1, 0)
    ]


def test_an_empty_image_is_all_background():
    assert not encode_depth(np.zeros((2, 4, 4), np.float32), Camera()).any()


def test_the_median_is_over_what_is_visible():
    image = np.zeros((1, 3, 3), np.float32)
    image[0, 0] = [2.0, 2.2, 2.9]
    assert encode_depth(image, Camera())[0, 0].tolist() == [168, 128, 1]


SIDE = 9
SPARSE_DEPTHS = arrays(
    np.float32,
    (2, SIDE, SIDE),
    elements=st.one_of(st.just(0.0), st.floats(2.0, 3.0, width=32)),
    fill=st.just(0.0),
)


def box_of(image):
    """First and last + 1 row and column of what is visible."""
    rows, columns = (np.flatnonzero((image > 0).any(axis=axis)) for axis in (1, 0))
    return rows[0], rows[-1] + 1, columns[0], columns[-1] + 1


def patch_of(image):
    top, bottom, left, right = box_of(image)
    return image[top:bottom, left:right]


@given(depth=SPARSE_DEPTHS)
def test_the_measured_box_moves_to_the_middle_with_its_values(depth):
    for image, cropped in zip(depth, crop_measured(depth, Camera(image_side=SIDE)), strict=True):
        if not image.any():
            assert not cropped.any()
            continue
        assert np.array_equal(patch_of(cropped), patch_of(image))
        assert np.count_nonzero(cropped) == np.count_nonzero(image)
        top, bottom, left, right = box_of(cropped)
        # An odd pixel of room lies below and to the right.
        assert SIDE - (top + bottom) in (0, 1)
        assert SIDE - (left + right) in (0, 1)


@given(depth=SPARSE_DEPTHS)
def test_axis_framing_keeps_the_pixels_where_they_are(depth):
    assert np.array_equal(crop_measured(depth, Camera(image_side=SIDE, framing="axis")), depth)


def test_pixels_before_the_crop_are_those_of_the_unframed_image():
    """They differ by a shift of whole pixels: the true outline is not in them."""
    shape = shape_of(trimesh.creation.cone(0.4, 1.0), "origin")
    azimuths, renderer = np.arange(0, 360, 30), open_renderer("embree")
    plain = renderer.render(*shape, 20.0, azimuths, Camera(framing="axis"))
    drawn = renderer.render(*shape, 20.0, azimuths, sensor_camera(Camera()))
    framed = renderer.render(*shape, 20.0, azimuths, Camera())
    for one, other, silhouette in zip(plain, drawn, framed, strict=True):
        assert np.array_equal(patch_of(one) > 0, patch_of(other) > 0)
        assert np.allclose(patch_of(one), patch_of(other), atol=1e-4)
        assert np.abs(np.array(box_of(other)) - box_of(silhouette)).max() <= 1


def with_thin_part():
    """A cube, and a thin bar to its side that comes nearer to the camera at azimuth 0."""
    cube = trimesh.creation.box((1.0, 1.0, 1.0))
    bar = trimesh.creation.box((0.6, 0.06, 0.06))
    bar.apply_translation((1.3, 1.1, 0.0))
    return shape_of(trimesh.util.concatenate([cube, bar]))


def lose_the_thin_part(depth, object_id):
    """A sensor that measures nothing nearer than the front of the cube."""
    return np.where(depth > 2.4, depth, np.float32(0))


def measured_image(measure, framing="silhouette"):
    images = render_objects(
        {"thin": with_thin_part()}, 0.0, Camera(framing=framing), open_renderer("embree"), measure
    )
    return next(images)[0]


def kinect_out_of_range():
    """The configured Kinect at 0.34 m, where the bar is nearer than it can measure."""
    settings = sensor_settings(CONFIGURED["kinect"], "mug", 0) | {"diagonal_m": 0.135}
    return open_sensor(settings, Camera(), "mug", 0)


@pytest.mark.parametrize(
    "measure", [lose_the_thin_part, kinect_out_of_range()], ids=["any", "kinect"]
)
def test_the_crop_follows_the_rest_where_the_sensor_loses_a_thin_part(measure):
    whole, rest = measured_image(None), measured_image(measure)
    top, bottom, left, right = box_of(rest)
    assert abs(top + bottom - 64) <= 1
    assert abs(left + right - 64) <= 1
    # Around the true object, the cube lies far from the middle.
    seen = np.flatnonzero((whole > 0).sum(axis=0) > 5)
    assert abs(seen[0] + seen[-1] + 1 - 64) > 10
    assert abs((right - left) - (seen[-1] + 1 - seen[0])) <= 2


def test_a_sensor_that_measures_everything_gives_the_crop_of_the_true_object():
    ideal, measured = measured_image(None), measured_image(lambda depth, object_id: depth)
    assert np.abs(np.array(box_of(ideal)) - box_of(measured)).max() <= 1
