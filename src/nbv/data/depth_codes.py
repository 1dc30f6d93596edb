"""Depth images as bytes: one byte a pixel, in steps of 0.5 % of the object's size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from nbv.data.camera import Camera
from nbv.data.depth_images import Codes

Depths = NDArray[np.float32]

STEP = 0.005
"""Depth per code, in object diagonals."""

ZERO_CODE = 128
"""The code of the reference depth itself."""


def reference_depth(depth: Depths, camera: Camera) -> NDArray[np.float32]:
    """Return the depth that code 128 stands for, one for each image.

    With ``framing="silhouette"`` it is the median of the visible pixels: a detector's crop knows
    no more. With ``framing="axis"`` it is the distance of the object's origin, which is then known.

    Parameters
    ----------
    depth : (k, side, side) float32
        Object diagonals, 0 where there is nothing.
    camera : Camera

    Returns
    -------
    (k,) float32
        Object diagonals. Images without a visible pixel get the camera's distance.
    """
    return np.array([_reference(image[image > 0], camera) for image in depth], dtype=np.float32)


def _reference(visible: Depths, camera: Camera) -> np.float32:
    if camera.framing != "silhouette" or not len(visible):
        return np.float32(camera.distance)
    return median_depth(visible)


def median_depth(visible: Depths) -> np.float32:
    """Return the median of depths (n,): that of numpy.median, in less than a third of its time."""
    middle = len(visible) // 2
    ordered = visible.copy()
    ordered.partition(middle)
    # Of an even number there are two in the middle; the lower one is the largest of those before.
    lower = ordered[middle] if len(visible) % 2 else ordered[:middle].max()
    return np.float32((lower + ordered[middle]) / 2)


def encode_depth(depth: Depths, camera: Camera) -> Codes:
    """Return depth images as bytes: 0 is background, nearer is larger.

    Parameters
    ----------
    depth : (k, side, side) float32
        Object diagonals, 0 where there is nothing.
    camera : Camera
        Its framing decides the reference depth (see `reference_depth`).

    Returns
    -------
    (k, side, side) uint8
        ``round((reference - depth) / STEP) + 128``, kept within 1..255: offsets saturate at −0.635
        and 0.635 diagonals.
    """
    codes = np.zeros(depth.shape, dtype=np.uint8)
    # One image at a time and in place, so that its pixels stay in the processor's cache.
    for image, code in zip(depth, codes, strict=True):
        seen = image > 0
        visible = image[seen]
        steps = _reference(visible, camera) - visible
        steps *= np.float32(1.0 / STEP)
        np.rint(steps, out=steps)
        steps += np.float32(ZERO_CODE)
        np.maximum(steps, np.float32(1), out=steps)
        code[seen] = np.minimum(steps, np.float32(255), out=steps)
    return codes


def decode_depth(codes: Codes) -> Depths:
    """Return the offset of each pixel from its image's reference depth.

    Parameters
    ----------
    codes : (...) uint8
        As written by `encode_depth`.

    Returns
    -------
    (...) float32
        Object diagonals, positive towards the camera, NaN for background. It differs from what
        was encoded by at most half a step, unless that saturated.
    """
    offsets = (codes.astype(np.float32) - ZERO_CODE) * np.float32(STEP)
    return np.where(codes > 0, offsets, np.float32(np.nan))


def sensor_camera(camera: Camera) -> Camera:
    """Return the camera that draws what a sensor measures before the crop.

    Its image holds the whole object, for which it may need half a pixel more room than `camera`.
    Its pixels lie where they lie without framing, so the true outline does not enter the crop.
    """
    return replace(camera, whole_pixels=True)


def crop_measured(depth: Depths, camera: Camera) -> Depths:
    """Return measured images with the measured pixels in the middle.

    Parameters
    ----------
    depth : (k, side, side) float32
        As the sensor measures it; 0 where nothing is measured.
    camera : Camera
        With ``framing="axis"`` the images stay as they are.

    Returns
    -------
    (k, side, side) float32
        The same values. The bounding box of the nonzero pixels lies in the middle, or half a pixel
        to the left of (above) it where the number of free columns (rows) is odd. An image without
        a measurement stays empty.
    """
    if camera.framing == "axis":
        return depth
    cropped = np.zeros_like(depth)
    for image, out in zip(depth, cropped, strict=True):
        for box in ndimage.find_objects((image > 0).astype(np.uint8)):
            measured = image[box]
            top, left = (np.array(image.shape) - measured.shape) // 2
            out[top : top + measured.shape[0], left : left + measured.shape[1]] = measured
    return cropped
