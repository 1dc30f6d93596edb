"""The crop of a sensor's image: it follows what the sensor measures, not the true object.

A renderer can frame an object by its true outline. A detector cannot: it sees only the measured
pixels. So the renderer first draws the image of the sensor (`sensor_camera`), the sensor measures
it, and `crop_measured` moves the bounding box of the measured pixels to the middle. Where the
sensor loses a mug's handle, the crop is centred on the cup.

A crop moves pixels, it does not change their number or size. One pixel of the image therefore
covers the same angle before and after, and so the same number of the sensor's own pixels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage

from nbv.data.camera import Camera
from nbv.data.depth_codes import Depths


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
