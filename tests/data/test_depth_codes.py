"""Depth as bytes and back."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from nbv.data.camera import Camera
from nbv.data.depth_codes import STEP, decode_depth, encode_depth

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
