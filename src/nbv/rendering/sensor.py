"""What a depth sensor keeps of an image: one byte a pixel, in steps of 0.5 % of the object's size.

A noise model is one function from depth to depth, applied before encoding; `ideal` adds none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError, nearest
from nbv.rendering.camera import Camera

Depths = NDArray[np.float32]
Codes = NDArray[np.uint8]
Sensor = Callable[[Depths], Depths]

STEP = 0.005
"""Depth per code, in object diagonals."""

ZERO_CODE = 128
"""The code of the reference depth itself."""


def ideal(depth: Depths) -> Depths:
    """Return the depth as it is."""
    return depth


SENSORS: Mapping[str, Sensor] = {"ideal": ideal}


def open_sensor(name: str) -> Sensor:
    """Return a sensor by its name in `SENSORS`.

    Raises
    ------
    UserError
        For an unknown name.
    """
    if name not in SENSORS:
        raise UserError(f"sensor={name} is unknown: {nearest(name, SENSORS)}")
    return SENSORS[name]


def reference_depth(depth: Depths, camera: Camera) -> NDArray[np.float32]:
    """Return the depth of each image that code 128 stands for.

    With ``framing="silhouette"`` it is the median of the visible pixels, which is all that a
    detector's crop can know; with ``framing="axis"`` the distance of the object's origin is known.

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
    reference = np.full(len(depth), camera.distance, dtype=np.float32)
    if camera.framing == "silhouette":
        for view, image in enumerate(depth):
            visible = image[image > 0]
            if len(visible):
                reference[view] = np.median(visible)
    return reference


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
        ``round((reference - depth) / STEP) + 128``, kept within 1..255: offsets beyond −0.635 and
        0.635 diagonals saturate.
    """
    reference = reference_depth(depth, camera)[:, None, None]
    steps = np.rint((reference - depth) * np.float32(1.0 / STEP)) + np.float32(ZERO_CODE)
    return np.where(depth > 0, np.clip(steps, 1, 255), 0).astype(np.uint8)


def decode_depth(codes: Codes) -> Depths:
    """Return the offset of each pixel from its image's reference depth.

    Parameters
    ----------
    codes : (...) uint8
        As written by `encode_depth`.

    Returns
    -------
    (...) float32
        Object diagonals, positive towards the camera, NaN for background. Within half a step of
        what was encoded, where that did not saturate.
    """
    offsets = (codes.astype(np.float32) - ZERO_CODE) * np.float32(STEP)
    return np.where(codes > 0, offsets, np.float32(np.nan))
