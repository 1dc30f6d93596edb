"""Camera poses in the robot's base frame, and rotations around the object.

Poses are 4 × 4 matrices that map points from the camera's frame to the base frame. The camera's
frame is the optical frame: z forward, x right, y down (ROS REP 103). The object's axis points up. A
positive rotation is counter-clockwise seen from above and moves the camera to larger azimuths.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.core.circle.angles import is_angle
from nbv.errors import FrameError, UserError
from nbv.files import read_numbers
from nbv.numbers import as_finite, as_point
from nbv.poses import Pose, as_pose

ROLL_LIMIT_DEG = 10.0
"""Roll of a camera at which two opposite views have a 50 % larger error."""

MOST_ROLL_DEG = 45.0
LEAST_ELEVATION_DEG, MOST_ELEVATION_DEG = -30.0, 80.0
"""Far beyond the elevations of a bundle's training, so that only mistakes are outside."""

UPSIDE_DOWN = 0.1
"""Share of the direction down that may point up in the image.

If a camera points straight down, the vertical component in the image is small and has a random
sign.
"""


def rotation_about(point: ArrayLike, direction: ArrayLike, angle_deg: float) -> Pose:
    """Return the rigid motion (4, 4) that rotates points about an axis (Rodrigues' formula).

    Parameters and errors are those of `moved_camera`.
    """
    origin, (x, y, z) = _as_axis(point, direction)
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(as_finite(angle_deg, "rotation", 1, "; give degrees").item())
    rotation = np.eye(3) + math.sin(angle) * across + (1 - math.cos(angle)) * across @ across
    motion = np.eye(4)
    motion[:3, :3] = rotation
    motion[:3, 3] = origin - rotation @ origin
    return motion


def _as_axis(
    point: ArrayLike, direction: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a point (3,) on an axis and its unit direction (3,)."""
    origin = as_point(point, "axis: the point")
    axis = as_finite(direction, "axis: the direction", 3, "; give x,y,z")
    largest = float(np.abs(axis).max())
    if largest <= 1e-9:
        raise UserError("axis: give a point and a direction that is not 0")
    # Squares of very large numbers overflow.
    axis /= largest
    return origin, axis / np.linalg.norm(axis)


def moved_camera(
    camera_pose: ArrayLike, point: ArrayLike, direction: ArrayLike, rotation_deg: float
) -> Pose:
    """Return the camera's pose (4, 4) after a rotation about the object's axis.

    Parameters
    ----------
    camera_pose : (4, 4)
        From the camera's optical frame to the base frame.
    point, direction : (3,)
        A point on the object's axis and its direction, in the base frame.
    rotation_deg : float
        Counter-clockwise seen from the direction's tip.

    Raises
    ------
    UserError
        Where the pose is not a rotation with a translation, the axis has no direction, or the
        rotation is not a finite number.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> ahead = np.array([[0, 0, 1, -1], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    >>> moved = nbv.moved_camera(ahead, point=(0, 0, 0), direction=(0, 0, 1), rotation_deg=90)
    >>> bool(np.allclose(moved[:3, 3], [0, -1, 0]))  # from x = -1 to y = -1
    True
    """
    return rotation_about(point, direction, rotation_deg) @ as_pose(camera_pose)


def check_axis(
    camera_pose: ArrayLike,
    point: ArrayLike,
    direction: ArrayLike,
    object_position_m: ArrayLike | None = None,
    diagonal_m: float | None = None,
) -> tuple[str, ...]:
    """Check that a camera pose and an axis fit the frame, before a robot moves.

    A pose may be in another unit, of another frame, inverted or rotated. The network knows only
    upright objects, so the axis has to point up in the image within `MOST_ROLL_DEG`, and the camera
    has to be at an elevation between `LEAST_ELEVATION_DEG` and `MOST_ELEVATION_DEG`.

    Parameters
    ----------
    camera_pose, point, direction
        See `moved_camera`.
    object_position_m : (3,), optional
        Position of the object in the camera's frame (`nbv.Recommendation.object_position_m`),
        which has to be near the axis.
    diagonal_m : float, optional
        Largest plausible distance from the axis, metres: the diagonal of the object's bounding
        box. Without it, or without a position, the distance is not checked.

    Returns
    -------
    tuple of str
        Warnings: a camera rolled by more than `ROLL_LIMIT_DEG`.

    Raises
    ------
    FrameError
        ``axis`` where pose and axis do not fit the frame.
    UserError
        Where the pose is not a rotation with a translation, or the axis has no direction.

    Examples
    --------
    >>> import numpy as np, nbv
    >>> ahead = np.array([[0, 0, 1, -1], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    >>> nbv.check_axis(ahead, point=(0, 0, 0), direction=(0, 0, 1))
    ()
    >>> try:
    ...     nbv.check_axis(ahead, point=(0, 0, 0), direction=(0, 0, -1))
    ... except nbv.FrameError as error:
    ...     error.name
    'axis'
    """
    if object_position_m is not None and diagonal_m is not None:
        _check_object_on_axis(camera_pose, point, direction, object_position_m, diagonal_m)
    down = down_of_axis(camera_pose, point, direction)
    elevation_deg, roll_deg = _elevation_and_roll(down)
    if not LEAST_ELEVATION_DEG <= elevation_deg <= MOST_ELEVATION_DEG:
        problem = f"the camera is at an elevation of {elevation_deg:.0f}° around this axis"
    elif abs(roll_deg) > MOST_ROLL_DEG:
        problem = f"the axis is {abs(roll_deg):.0f}° away from up in the image"
    else:
        return roll_warnings(down)
    raise FrameError(
        "axis",
        f"{problem}, but the object is upright: does the direction point up, and is the camera "
        "pose that of the optical frame (z forward, y down) in the base frame?",
    )


def _check_object_on_axis(
    camera_pose: ArrayLike,
    point: ArrayLike,
    direction: ArrayLike,
    object_position_m: ArrayLike,
    diagonal_m: float,
) -> None:
    origin, along = _as_axis(point, direction)
    position = (as_pose(camera_pose) @ np.append(np.asarray(object_position_m), 1.0))[:3]
    apart_m = float(np.linalg.norm(np.cross(position - origin, along)))
    if apart_m > diagonal_m:
        shown = ", ".join(f"{coordinate:.3g}" for coordinate in position)
        raise FrameError(
            "axis",
            f"the object is seen at {shown} in the base frame, {apart_m:.3g} m from the axis; "
            f"at most {diagonal_m:.2g} m is plausible: is the camera pose that of the optical "
            "frame (z forward) in the base frame, and are both in metres?",
        )


def down_of_axis(
    camera_pose: ArrayLike, point: ArrayLike, direction: ArrayLike
) -> NDArray[np.float64]:
    """Return the direction down (3,) in the camera's frame; parameters as in `moved_camera`."""
    _, along = _as_axis(point, direction)
    return np.asarray(-(as_pose(camera_pose)[:3, :3].T @ along))


def _elevation_and_roll(down: NDArray[np.float64]) -> tuple[float, float]:
    right, below, forward = (down / np.abs(down).max()).tolist()
    elevation_deg = math.degrees(math.atan2(forward, math.hypot(right, below)))
    return elevation_deg, math.degrees(math.atan2(right, below))


def roll_warnings(down: ArrayLike) -> tuple[str, ...]:
    """Return a sentence if a camera is rolled by more than `ROLL_LIMIT_DEG`, or looks up, else ().

    `down` (3,) is in the camera's optical frame. Roll is not defined for a camera that points
    nearly straight down or up, beyond `MOST_ELEVATION_DEG`.
    """
    elevation_deg, roll_deg = _elevation_and_roll(_as_down(down))
    if elevation_deg < -MOST_ELEVATION_DEG:
        return (
            f"gravity: z={np.asarray(down)[2]:g} says that the camera looks straight up; if it is "
            "that of an accelerometer, which reports the direction up, reverse all three signs",
        )
    if abs(roll_deg) <= ROLL_LIMIT_DEG or abs(elevation_deg) > MOST_ELEVATION_DEG:
        return ()
    side = "left" if roll_deg > 0 else "right"
    return (
        f"the camera is rolled: in the image the object leans {abs(roll_deg):.0f}° to the {side}, "
        f"and above {ROLL_LIMIT_DEG:g}° errors may grow; level the camera, or rotate the frame",
    )


def _as_down(gravity: ArrayLike) -> NDArray[np.float64]:
    down = as_finite(gravity, "gravity", 3, "; give the direction down: x,y,z")
    if not down.any():
        raise UserError("gravity: 0,0,0 is not a direction; give x,y,z")
    return down


def elevation_from_gravity(gravity: ArrayLike) -> float:
    """Return the elevation of a camera that points at the object, degrees.

    Gravity (3,) is the direction down in the camera's optical frame, of any length above 0. The
    elevation is the arcsine of the forward component of its unit vector. Raise UserError where it
    is not three finite numbers, has no length, or points up in the image: then the camera is upside
    down, or the signs are wrong.
    """
    down = _as_down(gravity)
    if down[1] < -UPSIDE_DOWN * math.hypot(*down.tolist()):
        raise UserError(
            f"gravity: y={down[1]:g} points up, but y is down in the optical frame; an "
            "accelerometer reports the direction up: reverse the sign of all three numbers; if the "
            "camera is upside down, rotate the frame by 180° and reverse x and y"
        )
    return _elevation_and_roll(down)[0]


def as_rotations(values: ArrayLike, name: str = "allowed rotations") -> NDArray[np.float64]:
    """Return rotations (m,) in degrees, from numbers or from a mask over the circle.

    Entry k of a mask (n,) selects 360 k / n degrees. Raise UserError where values are neither, one
    is not an angle, or there are none.
    """
    try:
        given = np.asarray(values)
    except ValueError:
        raise UserError(f"{name}: rows of different lengths; give one row") from None
    if given.dtype == np.bool_:
        if given.ndim != 1:
            raise UserError(
                f"{name}: a mask of {given.ndim} axes; give one axis, around the circle"
            )
        given = 360.0 * np.flatnonzero(given) / max(given.size, 1)
    elif given.dtype.kind not in "iuf":
        raise UserError(f"{name}: {given.dtype}; give degrees or booleans")
    rotations = given.astype(np.float64).ravel()
    if not rotations.size:
        raise UserError(f"{name}: none; give at least one, in degrees")
    if not is_angle(rotations).all():
        raise UserError(f"{name}: one is not finite, or beyond 1e6; give degrees")
    return rotations


def read_rotations(path: str | Path) -> NDArray[np.float64]:
    """Read rotations in degrees, or a mask of them, from ``.npy``; errors as in `as_rotations`."""
    path = Path(path)
    if path.suffix.lower() != ".npy":
        raise UserError(f"{path}: give rotations in degrees, or a .npy file")
    return as_rotations(read_numbers(path), str(path))
