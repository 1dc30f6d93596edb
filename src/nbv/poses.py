"""Poses as people have them: matrices, quaternions, and messages of BOP and ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv import numbers
from nbv.errors import UserError
from nbv.files import missing, read_given_json, read_numbers, read_text, readable
from nbv.numbers import Array, as_finite

Pose = NDArray[np.float64]
"""A 4 × 4 matrix that maps points from the camera's frame to the base frame, in metres."""

Source = str | Path | Sequence[float]
"""A file, or the numbers of an option."""

FORMS = (
    "give a 3 × 3 or 4 × 4 matrix row by row, a position with quaternion_xyzw or quaternion_wxyz, "
    "BOP's cam_R_m2c and cam_t_m2c, or a PoseStamped"
)
IN_JSON = "JSON with position and quaternion_xyzw or quaternion_wxyz"
_ORDER = (
    "7 numbers are a position and a quaternion: give its order, `quaternion` xyzw or wxyz, or "
    f"{IN_JSON}"
)

_SIZES = (7, 9, 16)
_ROTATIONS = ("R", "cam_R_m2c", "orientation", "quaternion_xyzw", "quaternion_wxyz", "pose")
_UNITS_MM = {"t": 1.0, "cam_t_m2c": 1.0, "position": 1000.0}
_OTHERS = ("header", "covariance", "obj_id", "score", "camera_pose")
"""Keys of a mapping that holds a pose; the name of a position says its unit."""


@dataclass(frozen=True)
class GivenPose:
    """A pose as it was given, and what messages call it.

    The translation (3,) has `unit_mm` millimetres per unit, None where the form does not say it.
    `frame_id` is that of a ROS message. `is_rounded` says whether the rotation (3, 3) is the
    nearest one to a matrix of few decimals.
    """

    name: str
    rotation: Array
    translation: Array | None = None
    unit_mm: float | None = None
    frame_id: str | None = None
    is_rounded: bool = False

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to say of the pose of an object in the camera."""
        frame = (
            f"frame_id {self.frame_id!r} does not name an optical frame: a pose is from the object "
            "to the camera's optical frame (x right, y down, z forward)"
        )
        is_odd = self.frame_id is not None and "optical" not in self.frame_id
        return (numbers.ROUNDED,) * self.is_rounded + (frame,) * is_odd

    @property
    def position_mm(self) -> Array | None:
        """The position (3,) of an object in the camera, if it is known.

        A unit that the form does not say is millimetres if the object is farther than `FARTHEST_M`
        in metres, and metres if it is nearer than `LEAST_MM` in millimetres; else it is asked for.
        """
        if self.translation is None:
            return None
        distance, unit_mm = math.hypot(*self.translation), self.unit_mm
        if unit_mm is None and not numbers.LEAST_MM <= distance <= numbers.FARTHEST_M:
            unit_mm = 1000.0 if distance < numbers.LEAST_MM else 1.0
        if unit_mm is None or (unit_mm == 1000.0 and distance > numbers.FARTHEST_M):
            what = f"the object is {distance:g} away, in metres or millimetres?"
            raise UserError(f"{self.name}: {what} give JSON with R and t (mm)")
        return numbers.as_position(unit_mm * self.translation, f"{self.name}: the position")

    @property
    def camera_pose(self) -> Pose:
        """The pose (4, 4) of a camera in the base frame."""
        if self.translation is None or self.unit_mm == 1.0:
            what = "has no position" if self.translation is None else "has millimetres"
            raise UserError(f"{self.name} {what}: give a 4 × 4 matrix in metres, or a PoseStamped")
        pose = np.eye(4)
        pose[:3, :3] = self.rotation
        pose[:3, 3] = numbers.as_point(self.translation, f"{self.name}: the translation")
        return pose


AnyPose = ArrayLike | Mapping[str, Any] | GivenPose
"""What `as_given` takes."""


def as_given(given: AnyPose, name: str, quaternion: str | None = None) -> GivenPose:
    """Return one pose of any form.

    It is a 3 × 3 or 4 × 4 matrix, or its numbers row by row, or a position and a quaternion, in the
    order xyzw or wxyz that `quaternion` names. Or it is a mapping of R, quaternion_xyzw or
    quaternion_wxyz and perhaps t (mm) or position (m), BOP's entry, ROS's Pose or PoseStamped, or
    one of all these as pose. Raise UserError if it is no rotation with a translation.
    """
    if isinstance(given, GivenPose):
        return given
    if isinstance(given, Mapping):
        return _of_mapping(given, name, quaternion)
    if (size := np.size(_as_array(given, name))) == 7:
        values = as_finite(given, name, 7)
        rotation = _of_quaternion(values[3:], quaternion, name)
        return replace(rotation, translation=values[:3])
    if size == 9:
        return _of_matrix(as_finite(given, name, 9).reshape(3, 3), name)
    pose = as_finite(given, name, 16, f"; {FORMS}").reshape(4, 4)
    if (np.abs(pose[3] - [0, 0, 0, 1]) > [1e-9, 1e-9, 1e-9, 1e-5]).any():
        row = " ".join(f"{number:g}" for number in pose[3])
        raise UserError(
            f"{name}: the last row is {row}, but a pose has 0 0 0 1; is it transposed or scaled?"
        )
    return replace(_of_matrix(pose[:3, :3], name), translation=pose[:3, 3])


def _of_matrix(matrix: Array, name: str) -> GivenPose:
    rotation = numbers.as_orientations(matrix, f"{name}: the 3 × 3 matrix")
    return GivenPose(name, rotation, is_rounded=not np.array_equal(rotation, matrix))


def _of_quaternion(values: Array, order: str | None, name: str) -> GivenPose:
    if order not in ("xyzw", "wxyz"):
        raise UserError(f"{name}: {_ORDER}")
    if abs((length := math.hypot(*values)) - 1) > 0.01:
        raise UserError(f"{name}: a quaternion of length {length:g}; that of a rotation has 1")
    x, y, z, w = (values if order == "xyzw" else np.roll(values, -1)) / length
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return GivenPose(name, np.eye(3) + 2 * w * across + 2 * across @ across)


def _of_mapping(given: Mapping[str, Any], name: str, quaternion: str | None) -> GivenPose:
    given = {key: value for key, value in given.items() if value is not None}
    keys = [key for key in _ROTATIONS if key in given]
    units = [key for key in _UNITS_MM if key in given]
    odd = set(map(str, given)) - {*keys, *units, *_OTHERS}
    if odd or len(keys) != 1 or len(units) > 1 or name.endswith("pose: pose: pose"):
        what = repr(min(odd)) if odd else " and ".join(keys and [*keys, *units]) or "no R"
        raise UserError(f"{name} has {what}; give R, t (mm), score, camera_pose; or {FORMS[5:]}")
    key, label = keys[0], f"{name}: {keys[0]}"
    if key == "pose":
        pose = as_given(given[key], label, quaternion)
    elif key in ("R", "cam_R_m2c"):
        pose = _of_matrix(as_finite(given[key], label, 9).reshape(3, 3), label)
    else:
        is_message = key == "orientation" and isinstance(given[key], Mapping)
        order = "xyzw" if is_message else key[-4:]
        values = as_finite(_by_name(given[key], order), label, 4)
        pose = _of_quaternion(values, order, label)
    for key in units:
        at = as_finite(_by_name(given[key], "xyz"), f"{name}: {key}", 3)
        pose = replace(pose, translation=at, unit_mm=_UNITS_MM[key])
    header = given.get("header")
    frame_id = header.get("frame_id") if isinstance(header, Mapping) else None
    return replace(pose, name=name, frame_id=str(frame_id) if frame_id else pose.frame_id)


def _by_name(values: Any, names: str) -> Any:
    """Return the values of a ROS message in order, or what is no message."""
    return [values.get(name) for name in names] if isinstance(values, Mapping) else values


def as_pose(given: AnyPose, name: str = "camera pose") -> Pose:
    """Return a camera's pose (4, 4), metres, from any form of `as_given`, whose errors it has."""
    return as_given(given, name).camera_pose


def _as_array(given: Any, name: str) -> NDArray[Any]:
    try:
        array = np.asarray(given, dtype=None if isinstance(given, np.ndarray) else np.float64)
    except (TypeError, ValueError, OverflowError):
        raise UserError(f"{name} is not an array of numbers; {FORMS}") from None
    if array.dtype.kind not in "iuf":
        raise UserError(f"{name} holds {array.dtype}; {FORMS}")
    return array


def read_given(source: Source) -> Any:
    """Return what a file of poses holds: an array, or lists and mappings of JSON or YAML.

    A text has a pose, or a row of one, in each line, or messages as ``ros2 topic echo`` prints
    them. What follows a # is a comment.
    """
    if not isinstance(source, str | Path):
        return source
    path = Path(source)
    if path.suffix.lower() == ".npy":
        return read_numbers(path)
    if path.suffix.lower() == ".json":
        return read_given_json(path, FORMS)
    if not path.is_file():
        raise UserError(f"{path} {missing(path)}")
    with readable(path, FORMS):
        lines = [line.partition("#")[0] for line in read_text(path).splitlines()]
        if not any(":" in line for line in lines):
            texts = [re.sub(r"[][(),;]", " ", line).split() for line in lines]
            rows = [[float(text) for text in line] for line in texts if line]
            is_table = len({len(row) for row in rows}) == 1
            return np.array(rows if is_table else [number for row in rows for number in row])
        import yaml

        text = "\n".join(lines)
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, yaml.SafeLoader)):
            raise UserError(f"{path} has an alias; {FORMS}")
        return [each for each in yaml.safe_load_all(text) if each is not None]


def read_entries(
    source: Source, option: str, flat: Sequence[int] = (9, 16)
) -> list[tuple[str, Any]]:
    """Return the poses of a source, in forms of `as_given`, and what messages call them.

    Arrays are (..., 4, 4), (..., 3, 3), or rows of 7, 9 or 16 numbers; `flat` says which of these
    sizes a pose may have where several are in one row. Raise UserError if it cannot be read, has
    another shape, or one that fits several numbers of poses.
    """
    given = read_given(source)
    name = str(source) if isinstance(source, str | Path) else f"`{option}`"
    given = [given] if isinstance(given, Mapping) else given
    if isinstance(given, Sequence) and any(isinstance(each, Mapping) for each in given):
        entries = list(given)
    else:
        array = np.atleast_1d(_as_array(given, name).squeeze())
        side, sizes = array.shape[-1], [n for n in flat if array.ndim == 1 and array.size % n == 0]
        if array.ndim > 1 and side in (3, 4) and array.shape[-2] % side == 0:
            sizes = [side**2]
        elif array.ndim > 1 and side in _SIZES:
            sizes = [side]
        elif array.size in _SIZES:
            sizes = [array.size]
        if not array.size or not sizes:
            raise UserError(f"{name}: an array of shape {array.shape}; {FORMS}")
        if len(sizes) > 1:
            counts = " or ".join(f"{array.size // size} of {size} numbers" for size in sizes)
            raise UserError(f"{name}: {counts}? give each pose a row")
        entries = list(array.reshape(-1, sizes[0]))
    names = [name] if len(entries) == 1 else [f"{name}, pose {i}" for i in range(len(entries))]
    return list(zip(names, entries, strict=True))


def read_pose(source: Source, quaternion: str | None = None) -> GivenPose:
    """Read the pose of a camera, or another one of any form; errors as in `as_given`."""
    (name, given), *others = read_entries(source, "camera_pose")
    if others:
        raise UserError(f"{source}: {1 + len(others)} poses; give one")
    return as_given(given, name, quaternion)


def read_poses(source: Source, quaternion: str | None = None) -> list[Pose]:
    """Read camera poses, (4, 4) each; errors as in `as_given`."""
    entries = read_entries(source, "candidates", (16,))
    return [as_given(given, name, quaternion).camera_pose for name, given in entries]
