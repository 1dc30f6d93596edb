"""Crop a depth frame to what a network was trained on.

The network was trained on images taken from ``camera.distance`` diagonals with
``camera.focal_px``. A frame comes from any distance, with any focal length, from a camera that need
not point at the object. The crop keeps the size of a pixel on the object,
``camera.distance / camera.focal_px`` diagonals: the frame is sampled at this step by a virtual
camera at the same position that points at the object.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nbv.data.camera import Camera
from nbv.data.depth_codes import encode_depth
from nbv.errors import FrameError, UserError, check_number
from nbv.frames.depth_files import DepthImage
from nbv.frames.intrinsics import Intrinsics
from nbv.frames.masks import NEAREST_SHARE, Mask, window_of

BEHIND_SURFACE = 0.15
"""Distance of an object's origin behind the median of its visible surface, diagonals."""

CROPPED_DEG = 25.0
"""A frame with a smaller field of view is a cut-out, whose object may touch the border."""

NEAREST, FARTHEST = 1.5, 20.0
"""Plausible distances, diagonals."""

FAR_UNITS = 5.0
"""Ratio of units of depth whose objects differ in size by more than those of a category."""

# Difference of the logarithms of two sizes to the usual one.
_MORE_USUAL = 0.2

_Axis = tuple[float, float, float]

# A depth limit, diagonals, beyond which it excludes nothing.
_NO_LIMIT = 100.0

# Units of depth, millimetres: metres, centimetres, 1 mm, 1/4 mm (L515), 1/5000 m (TUM), 1/6553.5 m
# (Replica), 1/8 mm (SR300, R200), 1/10 mm (D405).
_UNITS_MM = (1000.0, 10.0, 1.0, 0.25, 0.2, 1 / 6.5535, 0.125, 0.1)

# Factors of depth when a unit is mistaken for millimetres or metres, and their inverses.
_FACTORS = sorted(
    {factor for u in _UNITS_MM for factor in (u, u / 1000, 1 / u, 1000 / u)} - {1.0}, reverse=True
)


@dataclass(frozen=True)
class Crop:
    """A network's input, and the measurements made on the way to it.

    Attributes
    ----------
    codes : (side, side) uint8
        See `nbv.data.depth_codes.encode_depth`.
    distance_m : float
        The median depth of the object, metres.
    extent_m : float
        The diagonal of the object's bounding box in the image, metres.
    centre_m : tuple of float, or None
        Approximate position of the object's origin in the camera's optical frame (x right, y
        down, z forward), metres; None where the principal point is unknown.
    doubts : tuple of str
        Likely mistakes in the frame, a sentence each.
    """

    codes: NDArray[np.uint8]
    distance_m: float
    extent_m: float
    centre_m: tuple[float, float, float] | None = None
    doubts: tuple[str, ...] = ()


_FULL_BORDER = 0.95
"""Share of a crop's border; an object alone leaves its corners free."""


def pixel_step(camera: Camera) -> float:
    """Return the size of a crop's pixel on the object, diagonals."""
    return camera.distance / camera.focal_px


def crop_frame(
    depth_m: DepthImage,
    mask: Mask,
    intrinsics: Intrinsics,
    camera: Camera,
    diagonal_m: float,
    extent_m: tuple[float, float] = (0.0, math.inf),
    *,
    is_given: bool = False,
) -> Crop:
    """Return the crop of one object.

    Raise FrameError ``empty-mask``, ``mask-at-border``, ``other-resolution``,
    ``implausible-distance`` or ``implausible-size``.

    The mask is that of `nbv.frames.masks.object_mask`, and the camera that of the training images.
    `diagonal_m` is of the bounding box of a typical object of the category, and `extent_m` the
    plausible range of its extent in the image. Messages doubt first a mask that `is_given`, and was
    not found in the frame.
    """
    rows, columns = depth_m.shape
    published, intrinsics = intrinsics, intrinsics.of_size(rows, columns)
    intrinsics.check_resolution(rows, columns)
    window_rows, window_columns = window = window_of(mask)
    if not window_rows.stop:
        raise FrameError("empty-mask", "the mask has no pixel")
    _check_inside(window, mask, intrinsics, is_given)
    top, bottom = window_rows.start, window_rows.stop
    left, right = window_columns.start, window_columns.stop
    axes, principal = _facing(intrinsics, (left + right) / 2, (top + bottom) / 2)
    towards = axes[2]
    distance_m = float(np.median(depth_m[window][mask[window]])) / towards[2]
    width_m = (right - left) * distance_m / intrinsics.fx
    height_m = (bottom - top) * distance_m / intrinsics.fy
    extent = math.hypot(width_m, height_m)
    _check_plausible(distance_m, extent, diagonal_m, extent_m, is_given)
    # A pixel covers the same length at the object's centre as in training.
    away_m = distance_m + BEHIND_SURFACE * diagonal_m
    step = pixel_step(camera) * diagonal_m / away_m
    # The homography maps pixels of the virtual camera to pixels of the frame with a border of one
    # pixel, in homogeneous coordinates: each axis of the camera becomes a column.
    column, row = principal[0] + 1.0, principal[1] + 1.0
    to_pixels = [
        (intrinsics.fx * x + column * z, intrinsics.fy * y + row * z, z) for x, y, z in axes
    ]
    homography = np.array(to_pixels).T * (step, step, 1.0)
    pixels = homography @ _pixel_centres(camera.image_side)
    # Pixels outside the window have no depth; they read its border.
    measured = np.pad(np.where(mask[window], depth_m[window], np.float32(0)), 1)
    depth = measured.take(_window_indices(pixels, window_rows, window_columns)) / (
        diagonal_m * pixels[2]
    )
    images = depth.astype(np.float32).reshape(1, camera.image_side, camera.image_side)
    codes = encode_depth(images, camera)[0]
    right_m, down_m, ahead_m = (away_m * part for part in towards)
    centre_m = None if intrinsics.cx is None else (right_m, down_m, ahead_m)
    doubts = (
        *(intrinsics.doubts(rows, columns) if intrinsics is published else ()),
        *_size_doubts(extent, extent_m),
        *_border_doubts(codes),
    )
    return Crop(codes, distance_m, extent, centre_m, doubts)


def _size_doubts(extent: float, extent_m: tuple[float, float]) -> tuple[str, ...]:
    """Return a sentence if a plausible size is within a factor of 1.4 from its limits."""
    least, most = extent_m[0] * 1.4, extent_m[1] / 1.4
    if least <= extent <= most or least > most:
        return ()
    return (
        f"the object would be {extent:.2g} m across in the image; {least:.2g} to {most:.2g} m are "
        "usual: check the unit of depth, the intrinsics and the mask",
    )


def unit_doubts(
    found: Crop,
    crop_at: Callable[[float], Crop],
    diagonal_m: float,
    extent_m: tuple[float, float],
) -> tuple[str, ...]:
    """Return a sentence if the object has a more usual size with depths in a far other unit.

    `crop_at` returns the crop where depths are larger by a factor, or raises FrameError.
    """
    sizes_m = {1.0: found.extent_m}
    for factor in _FACTORS:
        is_far = not 1 / FAR_UNITS < factor < FAR_UNITS
        if is_far and _is_near(factor * found.distance_m, diagonal_m):
            with suppress(FrameError):
                sizes_m[factor] = crop_at(factor).extent_m
    usual_m = math.sqrt(extent_m[0] * extent_m[1])
    unusual = {factor: abs(math.log(size_m / usual_m)) for factor, size_m in sizes_m.items()}
    factor = min(unusual, key=unusual.__getitem__)
    if unusual[1.0] - unusual[factor] < _MORE_USUAL:
        return ()
    return (
        f"the object is {found.extent_m:.2g} m across in the image; with depths {factor:.4g} times "
        f"as large it would be {sizes_m[factor]:.2g} m, which is more usual: check their unit",
    )


def _border_doubts(codes: NDArray[np.uint8]) -> tuple[str, ...]:
    """Return a sentence if nearly the whole border of a crop is object."""
    border = np.concatenate([codes[[0, -1]].ravel(), codes[1:-1, [0, -1]].ravel()])
    if np.count_nonzero(border) < _FULL_BORDER * border.size:
        return ()
    return (
        "the object fills the image up to its border: check that the mask, or the depth between "
        "`near_m` and `far_m`, holds the object alone and not what it stands on",
    )


def _pixel_centres(side: int) -> NDArray[np.float64]:
    """Return the centres of a crop's pixels relative to the centre of the crop, pixels.

    The result holds homogeneous coordinates (3, side²): columns, rows and ones.
    """
    along = np.arange(side, dtype=np.float64) + 0.5 - side / 2
    return np.stack([np.tile(along, side), np.repeat(along, side), np.ones(side**2)])


def _window_indices(pixels: NDArray[np.float64], rows: slice, columns: slice) -> NDArray[np.intp]:
    """Return indices (n,) into the flattened window with its border.

    `pixels` (3, n) are homogeneous coordinates in the frame with a border of one pixel. Pixels
    outside the window are moved to its border.
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
    """Return the axes of a virtual camera that points at a pixel, and the principal point.

    The axes are right, down and ahead in the frame of the real camera, from which the virtual one
    differs by the shortest rotation. If the principal point is unknown, it is taken to be the
    pixel.
    """
    if intrinsics.cx is None or intrinsics.cy is None:
        return ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (column, row)
    # In camera files, integers are the centres of pixels.
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
    """Check that the depth limits of an object with a diagonal are metres.

    Raise UserError where a limit is negative or not a number, excludes all plausible distances, or
    is too large to exclude anything.
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
    """Check that the nearest surface of a frame is at a plausible distance for the object.

    In another unit `reach_m` would cut the object to pieces or include everything behind it, and
    the mask would not reveal the mistake. The other parameters are those of
    `nbv.frames.masks.object_mask`, and the diagonal of the object's bounding box. Raise FrameError
    ``implausible-distance``.
    """
    measured = depth_m[depth_m > (near_m or 0.0)]
    if not measured.size:
        return
    nearest_m = float(np.quantile(measured, NEAREST_SHARE))
    is_too_near = nearest_m + reach_m < NEAREST * diagonal_m
    if is_too_near or nearest_m > FARTHEST * diagonal_m:
        fitting = [factor for factor in _FACTORS if _is_near(factor * nearest_m, diagonal_m)]
        raise _implausible_distance(nearest_m, diagonal_m, fitting)


def _is_near(distance_m: float, diagonal_m: float) -> bool:
    return NEAREST * diagonal_m <= distance_m <= FARTHEST * diagonal_m


def _implausible_distance(distance_m: float, diagonal_m: float, factors: list[float]) -> FrameError:
    return FrameError(
        "implausible-distance",
        f"the object is {distance_m:.3g} m away; {NEAREST * diagonal_m:.2g} to "
        f"{FARTHEST * diagonal_m:.2g} m are plausible; {_help(factors)}",
    )


def _help(factors: list[float], is_given: bool = False) -> str:
    if not factors:
        return (
            "mask only the object; check the intrinsics, their resolution, and the object's "
            "category and size"
        )
    listed = " or ".join(f"{float(f'{factor:.4g}'):g}" for factor in factors)
    first = "does the mask hold the object alone? if it does, " if is_given else ""
    return (
        f"{first}depths {listed} times as large would fit: look up the camera's unit, and multiply "
        "depths or `depth_scale` by its factor"
    )


def _check_inside(
    window: tuple[slice, slice], mask: Mask, intrinsics: Intrinsics, is_given: bool
) -> None:
    (rows, columns), (height, width) = window, mask.shape
    sides = {"top": rows.start == 0, "bottom": rows.stop == height}
    sides |= {"left": columns.start == 0, "right": columns.stop == width}
    cut = " and ".join(name for name, is_cut in sides.items() if is_cut)
    view = math.degrees(2 * math.atan(max(width / intrinsics.fx, height / intrinsics.fy) / 2))
    if not cut or view < CROPPED_DEG:
        return
    touches = f"touches the {cut} border of the frame"
    if is_given:
        share = np.count_nonzero(mask) / mask.size
        raise FrameError(
            "mask-at-border",
            f"the mask {touches} and covers {100 * share:.0f} % of it: mask only the object, or "
            "move the camera if it is cut off",
        )
    raise FrameError(
        "mask-at-border",
        f"the object {touches}: it is cut off, or what is behind it is taken for it, as for an "
        f"object below {100 * NEAREST_SHARE:.0f} % of the frame; move the camera, give `far_m`, or "
        "mask only the object",
    )


def _check_plausible(
    distance_m: float,
    extent: float,
    diagonal_m: float,
    extent_m: tuple[float, float],
    is_given: bool,
) -> None:
    def is_plausible(unit: float) -> bool:
        is_sized = extent_m[0] <= unit * extent <= extent_m[1]
        return is_sized and _is_near(unit * distance_m, diagonal_m)

    if is_plausible(1.0):
        return
    factors = [factor for factor in _FACTORS if is_plausible(factor)]
    if not _is_near(distance_m, diagonal_m):
        raise _implausible_distance(distance_m, diagonal_m, factors)
    raise FrameError(
        "implausible-size",
        f"the object would be {extent:.3g} m across in the image; {extent_m[0]:.2g} to "
        f"{extent_m[1]:.2g} m are plausible; {_help(factors, is_given)}",
    )
