"""Depth codes: a byte per pixel, in steps of 0.5 % of the object's diagonal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nbv.data.camera import Camera
from nbv.data.depth_images import Codes

Depths = NDArray[np.float32]

STEP = 0.005
"""Depth per code, object diagonals."""

ZERO_CODE = 128
"""The code of the reference depth itself."""


def encode_depth(depth: Depths, camera: Camera) -> Codes:
    """Encode depth images: 0 is background, nearer is larger.

    Parameters
    ----------
    depth : (k, side, side) float32
        Object diagonals, 0 for background.
    camera : Camera
        With ``framing="silhouette"`` the reference depth is the median of the visible pixels, which
        a detector's crop provides; with ``framing="axis"``, or without a visible pixel, the
        camera's distance.

    Returns
    -------
    (k, side, side) uint8
        ``round((reference - depth) / STEP) + 128``, kept within 1..255: offsets saturate at −0.635
        and 0.635 diagonals.
    """
    codes = np.zeros(depth.shape, dtype=np.uint8)
    # Image by image and in place, to stay within the processor's cache.
    for image, code in zip(depth, codes, strict=True):
        seen = image > 0
        visible = image[seen]
        by_median = camera.framing == "silhouette" and len(visible)
        steps = np.float32(np.median(visible) if by_median else camera.distance) - visible
        steps *= np.float32(1.0 / STEP)
        np.rint(steps, out=steps)
        steps += np.float32(ZERO_CODE)
        np.maximum(steps, np.float32(1), out=steps)
        code[seen] = np.minimum(steps, np.float32(255), out=steps)
    return codes


def decode_depth(codes: Codes) -> Depths:
    """Return the offset of each pixel of `encode_depth` from its image's reference depth.

    In object diagonals, positive towards the camera, NaN for background. The error is at most half
    a step, unless the code saturated.
    """
    offsets = (codes.astype(np.float32) - ZERO_CODE) * np.float32(STEP)
    return np.where(codes > 0, offsets, np.float32(np.nan))


def sensor_camera(camera: Camera) -> Camera:
    """Return the camera for images that a sensor measures before the crop.

    Its pixels do not depend on the framing, so the true outline does not affect the crop. The whole
    object may need half a pixel more room than with `camera`.
    """
    return replace(camera, whole_pixels=True)


def crop_measured(depth: Depths, camera: Camera) -> Depths:
    """Centre measured images (k, side, side) on their measured pixels, which are not 0.

    Their bounding box is in the middle, or half a pixel to the left of (above) it if the number of
    free columns (rows) is odd. With ``framing="axis"`` the images stay as they are.
    """
    if camera.framing == "axis":
        return depth
    # Its import takes longer than all others of this module, which most commands import.
    from scipy import ndimage

    cropped = np.zeros_like(depth)
    for image, out in zip(depth, cropped, strict=True):
        for box in ndimage.find_objects((image > 0).astype(np.uint8)):
            measured = image[box]
            top, left = (np.array(image.shape) - measured.shape) // 2
            out[top : top + measured.shape[0], left : left + measured.shape[1]] = measured
    return cropped
