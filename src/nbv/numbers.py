"""Numbers and orientations from users: as arguments, and in columns of CSV files.

An orientation is a rotation matrix, object to camera.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

ORIENTATION_TOLERANCE = 1e-3
"""Most that an entry of R Rᵀ may differ from the identity: files have six digits."""

ROUNDED_DEG = 0.2
"""A matrix nearer to a rotation is that rotation, printed with three decimals or so."""

ROUNDED = "rotations have few decimals: the nearest ones are taken"

LARGEST_M = 1e6
"""Largest coordinate of a pose or an axis in the base frame; a larger one is in another unit."""

LEAST_MM = 10.0
"""No camera sees an object from nearer: such distances are metres."""

FARTHEST_M = 50.0
"""No arm looks at an object from farther: such distances are millimetres."""


def as_finite(values: ArrayLike, name: str, n: int, hint: str = "") -> Array:
    """Return n finite numbers (n,), from an array of any shape or from texts.

    Raise UserError if there are not n numbers, or one is not finite; `hint` ends the message.
    """
    try:
        given = np.asarray(values)
        numbers = np.empty(0) if np.iscomplexobj(given) else given.astype(np.float64).ravel()
    except (TypeError, ValueError, OverflowError):
        numbers = np.empty(0)
    if len(numbers) != n or not np.isfinite(numbers).all():
        what = "a finite number" if n == 1 else f"{n} finite numbers"
        raise UserError(f"{name} is not {what}{hint}")
    return numbers


def as_point(values: ArrayLike, name: str) -> Array:
    """Return a point (3,) of the base frame, metres; raise UserError unless it is one."""
    point = as_finite(values, name, 3, "; give x,y,z")
    if (largest := float(np.abs(point).max())) > LARGEST_M:
        raise UserError(f"{name}: {largest:g} m away; give metres")
    return point


def as_position(values: ArrayLike, name: str) -> Array:
    """Return the position (3,) of an object in the camera's frame, millimetres.

    Raise UserError if the camera cannot see an object there.
    """
    position = as_finite(values, name, 3)
    if position[2] <= 0:
        raise UserError(
            f"{name} is behind the camera (z = {position[2]:g}): give the pose object to camera, "
            "not camera to object"
        )
    if (distance := math.hypot(*position)) < LEAST_MM:
        raise UserError(f"{name} is {distance:g} mm away; give mm, not metres")
    if distance > 1000 * LARGEST_M:
        raise UserError(f"{name} is {distance:g} mm away; give mm")
    return position


def as_orientations(values: ArrayLike, name: str) -> Array:
    """Return rotation matrices (..., 3, 3).

    A matrix that is a rotation within `ORIENTATION_TOLERANCE` stays as it is. Others are replaced
    by the nearest rotation if it is within `ROUNDED_DEG`: ‖R - R₀‖ / √2, Frobenius norm. A
    UserError names the first matrix that is not a rotation, and why.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise UserError(f"{name} has an entry that is not a number") from None
    if array.shape[-2:] != (3, 3):
        raise UserError(f"{name} is {array.shape} instead of (..., 3, 3)")
    # Products of larger entries may overflow.
    flat = np.clip(array.reshape(-1, 3, 3), -2.0, 2.0)
    skewed = np.abs(flat @ flat.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    skewed = np.asarray(~(skewed <= ORIENTATION_TOLERANCE))
    if skewed.any():
        u, _, vt = np.linalg.svd(np.nan_to_num(flat))
        apart = np.linalg.norm(u @ vt - flat, axis=(1, 2)) / np.sqrt(2)
        is_rounded = skewed & (apart <= np.radians(ROUNDED_DEG))
        flat = np.where(is_rounded[:, None, None], u @ vt, flat)
        array = np.where(
            is_rounded.reshape((*array.shape[:-2], 1, 1)), flat.reshape(array.shape), array
        )
        skewed &= ~is_rounded
    reflected = ~skewed & (np.linalg.det(np.where(skewed[:, None, None], 0, flat)) < 0)
    for bad, reason in (
        (skewed, "not a rotation: its rows are not perpendicular unit vectors"),
        (reflected, "a reflection: its determinant is -1; give right-handed axes"),
    ):
        if bad.any():
            row = f"[{np.argmax(bad)}]" if array.ndim > 2 else ""
            raise UserError(f"{name}{row} is {reason}")
    return array


def column(
    path: Path,
    rows: pd.DataFrame,
    name: str,
    n: int = 1,
    *,
    limit: float = np.inf,
    is_optional: bool = False,
) -> Array:
    """Return the numbers in the cells of a column of a file: (rows,), or (rows, n) where n > 1.

    The rows are texts, and their index counts the rows of the file from 0. A cell has n numbers,
    separated by spaces, of a magnitude up to `limit`; if it `is_optional`, it may be empty, which
    gives NaN. A UserError names the row of a cell with something else.
    """
    numbers = np.full((len(rows), n), np.nan)
    for i, (row, text) in enumerate(zip(rows.index, rows[name], strict=True)):
        if is_optional and text.strip().lower() in ("", "nan"):
            continue
        cell = f"{path}, row {row + 2}: {name} {text!r}"
        hint = "; write 0.5 and not 0,5" if "," in text else ""
        numbers[i] = as_finite(text.split(), cell, n, hint)
        if np.abs(numbers[i]).max() > limit:
            raise UserError(f"{cell} is not between {-limit:.9g} and {limit:.9g}")
    return numbers[:, 0] if n == 1 else numbers


def orientation_column(path: Path, rows: pd.DataFrame, name: str) -> Array:
    """Return the rotation matrices (rows, 3, 3) of a column with 9 numbers; see `column`."""
    matrices = column(path, rows, name, 9).reshape(-1, 3, 3)
    try:
        return as_orientations(matrices, name)
    except UserError:
        for row, matrix in zip(rows.index, matrices, strict=True):
            as_orientations(matrix, f"{path}, row {row + 2}: {name}")
        raise


def position_column(path: Path, rows: pd.DataFrame, name: str) -> Array:
    """Return the positions (rows, 3) of `as_position` in a column; see `column`."""
    positions = column(path, rows, name, 3)
    for row, position in zip(rows.index, positions, strict=True):
        as_position(position, f"{path}, row {row + 2}: {name}")
    return positions
