"""Depth frames of generated objects, as a camera anywhere would take them."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from nbv.data.camera import Camera, viewpoint_frames
from nbv.data.depth_codes import encode_depth
from nbv.data.render import open_renderer
from nbv.frames.crop import pixel_step
from rendering_shapes import procedural

TRAINING = Camera()


@cache
def _renderer():
    return open_renderer("embree")


shape = cache(procedural)


def fov_deg(side: float, focal_px: float) -> float:
    return math.degrees(2 * math.atan(side / 2 / focal_px))


def aside(vertices, elevation, azimuth, across, up):
    """The same object, moved along the image's axes."""
    right_axis, up_axis, _ = viewpoint_frames(elevation, [azimuth])
    return vertices + across * right_axis[0] + up * up_axis[0]


def frame(
    elevation: float,
    azimuth: float,
    distance: float,
    *,
    category: str = "mug",
    index: int = 0,
    focal_px: float = 575.0,
    size: tuple[int, int] = (320, 240),
    across: float = 0.0,
    up: float = 0.0,
) -> NDArray[np.float32]:
    """The whole image of a pinhole camera, in diagonals; lengths are in diagonals too."""
    vertices, faces = shape(category, index)
    columns, rows = size
    camera = Camera(distance, fov_deg(columns, focal_px), columns, framing="axis")
    moved = aside(vertices, elevation, azimuth, across, up)
    square = _renderer().render(moved, faces, elevation, [azimuth], camera)[0]
    above = (columns - rows) // 2
    return square[above : above + rows]


def wanted_codes(
    elevation: float,
    azimuth: float,
    distance: float,
    *,
    category: str = "mug",
    index: int = 0,
    across: float = 0.0,
    up: float = 0.0,
) -> NDArray[np.uint8]:
    """What training would have shown of the object there: its pixels, drawn and not sampled."""
    vertices, faces = shape(category, index)
    side = TRAINING.image_side
    camera = Camera(distance, fov_deg(side, distance / pixel_step(TRAINING)), side)
    moved = aside(vertices, elevation, azimuth, across, up)
    depth = _renderer().render(moved, faces, elevation, [azimuth], camera)
    return encode_depth(depth, camera)[0]
