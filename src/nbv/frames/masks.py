"""Segment the object in a depth image."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from nbv.errors import FrameError, UserError
from nbv.frames.depth_files import DepthImage, as_mask

Mask = NDArray[np.bool_]

LEAST_MEASURED = 0.5
"""Least share of a mask's pixels with a depth.

When half of the depth of 60 drawn mugs was removed in patches, 19 were rejected as two objects, and
a third of the other estimates were off by more than 45°.
"""

ISLAND = 0.02
"""A part smaller than this share of the largest part is dropped as noise."""

SECOND_OBJECT = 0.5
"""A part of at least this share of the largest part is another object."""

NEAREST_SHARE = 0.02
"""Share of the nearest depths that may be noise in front of the object."""

_LEAST_PIXELS = 30
_EIGHT = np.ones((3, 3), dtype=bool)


def window_of(mask: Mask) -> tuple[slice, slice]:
    """Return the rows and columns of the bounding box of a mask; empty without a pixel."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return slice(0, 0), slice(0, 0)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def object_mask(
    depth_m: DepthImage,
    reach_m: float,
    mask: ArrayLike | None = None,
    near_m: float | None = None,
    far_m: float | None = None,
) -> Mask:
    """Return the pixels (rows, columns) of the object where depth was measured, without islands.

    `depth_m` (rows, columns) is 0 where nothing was measured. The mask is one that
    `nbv.frames.depth_files.as_mask` takes. Without it and `far_m`, the object is the surface
    nearest to the camera, and reaches `reach_m` behind its nearest point.

    Raises
    ------
    FrameError
        ``empty-mask``, ``little-depth`` or ``two-objects``.
    UserError
        Where the mask is not one of one object, it has another size than the frame, or the limits
        are not a range.
    """
    inside = depth_m > 0
    if not np.count_nonzero(inside):
        raise FrameError(
            "empty-mask",
            "the frame has no depth at all, no number above 0: is the sensor covered or too close?",
        )
    if mask is not None:
        given = as_mask(mask)
        if given.shape != depth_m.shape:
            raise UserError(
                f"the mask has {_size(given.shape)} pixels and the frame {_size(depth_m.shape)}: "
                "give a mask of the same size"
            )
        if not (n_given := np.count_nonzero(given)):
            raise FrameError("empty-mask", "the mask has no pixel; mark the object")
        inside &= given
        if (share := np.count_nonzero(inside) / n_given) < LEAST_MEASURED:
            raise FrameError(
                "little-depth",
                f"only {100 * share:.0f} % of the mask's pixels have a depth; need 50 %: mask only "
                "the object, or move the camera",
            )
    near = 0.0 if near_m is None else near_m
    far = np.inf if far_m is None else far_m
    if not 0 <= near < far:
        raise UserError(f"`near_m`={near:g} and `far_m`={far:g}: 0 ≤ near < far (metres)")
    if near_m is not None or far_m is not None:
        inside &= (depth_m >= near) & (depth_m <= far)
    if mask is None and far_m is None and inside.any():
        inside &= depth_m < np.quantile(depth_m[inside], NEAREST_SHARE) + reach_m
    if np.count_nonzero(inside) < _LEAST_PIXELS:
        limits, measured = "", depth_m[depth_m > 0]
        if near_m is not None or far_m is not None:
            limits = (
                f" between `near_m`={near:g} and `far_m`={far:g}, of {measured.min():.2f} to "
                f"{measured.max():.2f} m in the frame"
            )
        raise FrameError(
            "empty-mask",
            f"{np.count_nonzero(inside)} pixels of the object have a depth{limits}; need 30",
        )
    # Only the window, because most of a frame is background.
    window = window_of(inside)
    inside[window] = _without_islands(inside[window])
    return inside


def _without_islands(inside: Mask) -> Mask:
    parts, n_parts = ndimage.label(inside, _EIGHT)
    if n_parts == 1:
        return inside
    sizes = np.bincount(parts.ravel())[1:]
    second, largest = np.sort(sizes)[-2:]
    if second >= SECOND_OBJECT * largest:
        raise FrameError(
            "two-objects",
            f"two separate parts of {largest} and {second} pixels: mask one of them",
        )
    return np.asarray(np.append(False, sizes >= ISLAND * largest)[parts])


def _size(shape: tuple[int, ...]) -> str:
    return " × ".join(map(str, reversed(shape)))
