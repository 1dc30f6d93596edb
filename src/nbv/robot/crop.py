"""From a depth frame to the crop that a network was trained on.

The network saw the object from ``camera.distance`` diagonals with ``camera.focal_px``. A frame is
taken from any distance, with any focal length, by a camera that is not directed at the object. What
stays the same is the size of a pixel on the object, ``camera.distance / camera.focal_px``
diagonals. So the frame is sampled at this step, by a camera in the same place that is directed at
the object.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth, median_depth
from nbv.errors import FrameError, UserError, check_number
from nbv.robot.depth_files import DepthImage
from nbv.robot.intrinsics import Intrinsics
from nbv.robot.masks import NEAREST_SHARE, Mask, window_of

BEHIND_SURFACE = 0.15
"""How far an object's origin lies behind the median of what is visible of it, in diagonals."""

CROPPED_DEG = 25.0
"""A frame with less field of view was cropped about its object, which may touch the border."""

NEAREST, FARTHEST = 1.5, 20.0
"""Distances that are plausible, in diagonals."""

_Axis = tuple[float, float, float]

# Diagonals: a limit of depth beyond it is none.
_NO_LIMIT = 100.0

# What mends a wrong unit, the likeliest first: millimetres, tenths and quarters of them,
# centimetres, and back.
_UNITS = (0.001, 1000.0, 0.1, 0.0001, 0.25, 0.01, 10.0, 100.0, 0.00025, 4000.0, 10000.0)


@dataclass(frozen=True)
class Crop:
    """What a network sees of a frame.

    Attributes
    ----------
    codes : (side, side) uint8
        See `nbv.data.depth_codes.encode_depth`.
    distance_m : float
        The median depth of the object, metres.
    extent_m : float
        The diagonal of the object's bounding box in the image, metres.
    centre_m : tuple of float, or None
        About where the object's origin is in the camera's optical frame (x right, y down, z
        forward), metres; None where the principal point is not known.
    doubts : tuple of str
        What may be wrong with the frame, a sentence each.
    """

    codes: NDArray[np.uint8]
    distance_m: float
    extent_m: float
    centre_m: tuple[float, float, float] | None = None
    doubts: tuple[str, ...] = ()


def pixel_step(camera: Camera) -> float:
    """Return the size of a crop's pixel on the object, in diagonals."""
    return camera.distance / camera.focal_px


def crop_frame(
    depth_m: DepthImage,
    mask: Mask,
    intrinsics: Intrinsics,
    camera: Camera,
    diagonal_m: float,
    extent_m: tuple[float, float] = (0.0, math.inf),
) -> Crop:
    """Return the crop of one object.

    Parameters
    ----------
    depth_m : (rows, columns) float32
        Metres.
    mask : (rows, columns) bool
        See `nbv.robot.masks.object_mask`.
    intrinsics : Intrinsics
    camera : Camera
        That of the training.
    diagonal_m : float
        Of the object's bounding box, metres; that of a usual object of the category.
    extent_m : (float, float)
        Between which the object's extent in the image is plausible, metres.

    Raises
    ------
    FrameError
        ``empty-mask``, ``mask-at-border``, ``other-resolution``, ``implausible-distance`` or
        ``implausible-size``.
    """
    rows, columns = depth_m.shape
    intrinsics.check_resolution(rows, columns)
    of_rows, of_columns = window = window_of(mask)
    if not of_rows.stop:
        raise FrameError("empty-mask", "the mask has no pixel")
    top, bottom = of_rows.start, of_rows.stop - 1
    left, right = of_columns.start, of_columns.stop - 1
    _check_inside(top, bottom, left, right, (rows, columns), intrinsics)
    middle = (left + right + 1) / 2, (top + bottom + 1) / 2
    axes, principal = _facing(intrinsics, *middle)
    towards = axes[2]
    distance_m = float(median_depth(depth_m[window][mask[window]])) / towards[2]
    width_m = (right - left + 1) * distance_m / intrinsics.fx
    height_m = (bottom - top + 1) * distance_m / intrinsics.fy
    extent = math.hypot(width_m, height_m)
    _check_plausible(distance_m, extent, diagonal_m, extent_m)
    # A pixel covers the same length on the object's middle as in training.
    away_m = distance_m + BEHIND_SURFACE * diagonal_m
    step = pixel_step(camera) * diagonal_m / away_m
    # From the pixels of a camera that is directed at the object to those of the frame, which has a
    # border of one pixel, in homogeneous coordinates: each of its axes becomes a column.
    column, row = principal[0] + 1.0, principal[1] + 1.0
    to_pixels = [
        (intrinsics.fx * x + column * z, intrinsics.fy * y + row * z, z) for x, y, z in axes
    ]
    homography = np.array(to_pixels).T * (step, step, 1.0)
    pixels = homography @ _middles(camera.image_side)
    # What lies outside the window has no depth, as its border here.
    measured = np.pad(np.where(mask[window], depth_m[window], np.float32(0)), 1)
    depth = measured.take(_places(pixels, of_rows, of_columns)) / (diagonal_m * pixels[2])
    images = depth.astype(np.float32).reshape(1, camera.image_side, camera.image_side)
    codes = encode_depth(images, camera)[0]
    right_m, down_m, ahead_m = (away_m * part for part in towards)
    centre_m = None if intrinsics.cx is None else (right_m, down_m, ahead_m)
    return Crop(codes, distance_m, extent, centre_m, intrinsics.doubts(rows, columns))


@cache
def _middles(side: int) -> NDArray[np.float64]:
    """Return the middles of a crop's pixels, from the middle of the crop, pixels.

    They are homogeneous coordinates (3, side²): columns, rows and ones.
    """
    along = np.arange(side, dtype=np.float64) + 0.5 - side / 2
    middles = np.stack([np.tile(along, side), np.repeat(along, side), np.ones(side**2)])
    middles.flags.writeable = False
    return middles


def _places(pixels: NDArray[np.float64], rows: slice, columns: slice) -> NDArray[np.intp]:
    """Return indices (n,) into a bordered window, row by row.

    Parameters
    ----------
    pixels : ndarray (3, n)
        Homogeneous coordinates in the frame, which has a border of one pixel.
    rows, columns : slice
        The window. What lies outside is in its border.
    """
    positions = pixels[:2] / pixels[2]
    np.maximum(positions, [[columns.start], [rows.start]], out=positions)
    np.minimum(positions, [[columns.stop + 1], [rows.stop + 1]], out=positions)
    column, row = positions.astype(np.intp)
    width = columns.stop - columns.start + 2
    return np.asarray((row - rows.start) * width + column - columns.start)


def _facing(
    intrinsics: Intrinsics, column: float, row: float
) -> tuple[tuple[_Axis, _Axis, _Axis], tuple[float, float]]:
    """Return the axes of a camera directed at a place of the image, and the principal point.

    The axes are right, down and ahead, in the camera's own frame. It is turned by the shortest
    rotation. Where the principal point is not known, the camera is taken to be directed there.
    """
    if intrinsics.cx is None or intrinsics.cy is None:
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (column, row)
    # In files, whole numbers are the middles of pixels.
    principal = intrinsics.cx + 0.5, intrinsics.cy + 0.5
    x, y = (column - principal[0]) / intrinsics.fx, (row - principal[1]) / intrinsics.fy
    ahead = 1.0 / math.sqrt(x**2 + y**2 + 1.0)
    right, down = x * ahead, y * ahead
    # Rodrigues' formula for the shortest rotation from (0, 0, 1) to (right, down, ahead).
    share = 1.0 / (1.0 + ahead)
    axes = (
        (1.0 - right**2 * share, -right * down * share, -right),
        (-right * down * share, 1.0 - down**2 * share, -down),
        (right, down, ahead),
    )
    return axes, principal


def check_depth_limits(near_m: float | None, far_m: float | None, diagonal_m: float) -> None:
    """Refuse limits of depth that are no metres.

    Parameters
    ----------
    near_m, far_m : float, optional
        See `nbv.robot.masks.object_mask`.
    diagonal_m : float
        Of the object's bounding box, metres.

    Raises
    ------
    UserError
        Where one is negative or no number, and where the object would lie beyond all plausible
        distances, or might lie anywhere.
    """
    limits = (("`near_m`", near_m, FARTHEST), ("`far_m`", far_m, _NO_LIMIT))
    for name, limit_m, most in limits:
        if limit_m is not None:
            check_number(name, limit_m)
        if limit_m is not None and not limit_m >= 0:
            raise UserError(f"{name}={limit_m:g}: give metres, 0 or more")
        if limit_m is not None and most * diagonal_m < limit_m < math.inf:
            raise UserError(
                f"{name}={limit_m:g}: give metres; the object is {NEAREST * diagonal_m:.2g} to "
                f"{FARTHEST * diagonal_m:.2g} m away"
            )


def check_plausible_nearest(
    depth_m: DepthImage, reach_m: float, diagonal_m: float, near_m: float | None = None
) -> None:
    """Refuse a frame in which the object cannot be what lies nearest, for its distance.

    In another unit `reach_m` would cut the object to pieces, or take in all that is behind it, and
    what is wrong could not be told from the mask.

    Parameters
    ----------
    depth_m : (rows, columns) float32
        Metres; 0 where nothing was measured.
    reach_m, near_m : float
        See `nbv.robot.masks.object_mask`.
    diagonal_m : float
        Of the object's bounding box, metres.

    Raises
    ------
    FrameError
        ``implausible-distance``.
    """
    seen = depth_m[depth_m > (near_m or 0.0)]
    if not seen.size:
        return
    nearest_m = float(np.quantile(seen, NEAREST_SHARE))
    is_too_near = nearest_m + reach_m < NEAREST * diagonal_m
    if is_too_near or nearest_m > FARTHEST * diagonal_m:
        unit = next((unit for unit in _UNITS if _is_near(unit * nearest_m, diagonal_m)), None)
        raise _implausible_distance(nearest_m, diagonal_m, unit)


def _is_near(distance_m: float, diagonal_m: float) -> bool:
    return NEAREST * diagonal_m <= distance_m <= FARTHEST * diagonal_m


def _implausible_distance(distance_m: float, diagonal_m: float, unit: float | None) -> FrameError:
    return FrameError(
        "implausible-distance",
        f"the object is {distance_m:.3g} m away; {NEAREST * diagonal_m:.2g} to "
        f"{FARTHEST * diagonal_m:.2g} m are plausible; {_help(unit)}",
    )


def _help(unit: float | None) -> str:
    if unit is None:
        return (
            "mask the object alone; are the intrinsics those of this resolution, and is it of this "
            "category and size?"
        )
    return f"depths {unit:g} times as large would fit: multiply depths or `depth_scale` by it"


def _check_inside(
    top: int, bottom: int, left: int, right: int, shape: tuple[int, ...], intrinsics: Intrinsics
) -> None:
    rows, columns = shape
    if top > 0 and left > 0 and bottom < rows - 1 and right < columns - 1:
        return
    view = math.degrees(2 * math.atan(max(columns / intrinsics.fx, rows / intrinsics.fy) / 2))
    sides = {"top": top == 0, "bottom": bottom == rows - 1}
    sides |= {"left": left == 0, "right": right == columns - 1}
    if view >= CROPPED_DEG and (cut := [name for name, is_cut in sides.items() if is_cut]):
        raise FrameError(
            "mask-at-border",
            f"the object touches the {' and '.join(cut)} border of the frame: part of it is cut "
            "off; move the camera, or mask the object alone",
        )


def _check_plausible(
    distance_m: float, extent: float, diagonal_m: float, extent_m: tuple[float, float]
) -> None:
    def is_plausible(unit: float) -> bool:
        is_sized = extent_m[0] <= unit * extent <= extent_m[1]
        return is_sized and _is_near(unit * distance_m, diagonal_m)

    if is_plausible(1.0):
        return
    unit = next((unit for unit in _UNITS if is_plausible(unit)), None)
    if not _is_near(distance_m, diagonal_m):
        raise _implausible_distance(distance_m, diagonal_m, unit)
    raise FrameError(
        "implausible-size",
        f"the object would be {extent:.3g} m across in the image; {extent_m[0]:.2g} to "
        f"{extent_m[1]:.2g} m are plausible; {_help(unit)}",
    )
