"""Intrinsic parameters of a pinhole camera, from numbers or from BOP and ROS files."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nbv.errors import FrameError, UserError, check_number, reason_of
from nbv.files import missing, read_numbers, read_text
from nbv.frames.depth_files import MILLIMETRE

OFF_CENTRE = 0.2
"""Offset of a principal point from the image centre that is suspicious, as a share of the side."""

_SAME_SCALE = 0.03
"""Relative tolerance between the horizontal and the vertical scale of an image."""

# Names of the coefficients in ROS's, OpenCV's and other files.
_DISTORTION = re.compile(
    r"d|[kp]\d|cam_d|coeffs|dist(ortion)?(_?(coeffs?|coefficients?|params|parameters))?", re.I
)

# Scales of images to others, and how far a principal point may be off the centre of such an image.
_SCALES = (0.25, 1 / 3, 0.5, 2 / 3, 1.5, 2.0, 3.0, 4.0)
_USUAL_SCALE = 0.1
# Scales along one axis: 1280 × 720 and 848 × 480 pixels have another shape than 640 × 480.
_SCALES_OF_AXES = (*_SCALES, 0.75, 0.8, 1.0, 1.25, 4 / 3)

# Of numbers in the right order, how far the principal point is off the centre, as a share of the
# side, and the relative difference of the focal lengths.
_CENTRAL, _SQUARE = 0.1, 0.1

_LEAST_SCALE = 0.2
"""Below it a principal point is near a corner and cannot be the centre of a scaled image."""


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths and principal point, in pixels.

    Attributes
    ----------
    fx, fy : float
    cx, cy : float, optional
        None: the centre of the object, as if the camera pointed at it.
    width, height : int, optional
        Size of the images that they belong to, if known.
    reduced : Intrinsics, optional
        Those of images of another size that are binned or cut out of these (ROS: `binning`, `roi`).

    Examples
    --------
    >>> import nbv
    >>> camera = nbv.Intrinsics(585.0, 585.0, cx=319.5, cy=239.5)
    >>> camera.check_resolution(rows=480, columns=640)
    >>> try:
    ...     camera.check_resolution(rows=240, columns=320)
    ... except nbv.FrameError as error:
    ...     error.name
    'other-resolution'
    """

    fx: float
    fy: float
    cx: float | None = None
    cy: float | None = None
    width: int | None = None
    height: int | None = None
    reduced: Intrinsics | None = None

    def __post_init__(self) -> None:
        for name in ("fx", "fy", "cx", "cy", "width", "height"):
            value = getattr(self, name)
            if value is None and name not in ("fx", "fy"):
                continue
            check_number(f"intrinsics: {name}", value)
            if name in ("cx", "cy") and not math.isfinite(value):
                raise UserError(f"intrinsics: {name}={value:g} is not a number")
            if name in ("fx", "fy") and not (math.isfinite(value) and value > 0):
                raise UserError(f"intrinsics: {name}={value:g} must be above 0 (pixels)")
            if name in ("width", "height") and not value > 0:
                raise UserError(
                    f"intrinsics: {name}={value:g} must be above 0 (pixels); give the size of the "
                    "depth image, or leave out width and height"
                )
        if (self.cx is None) != (self.cy is None):
            known, missing = ("cy", "cx") if self.cx is None else ("cx", "cy")
            raise UserError(f"intrinsics: {known} without {missing}; give both, or neither")

    def of_size(self, rows: int, columns: int) -> Intrinsics:
        """Return the reduced intrinsics if they are those of images of a size, else these."""
        reduced = self.reduced or self
        return reduced if (reduced.height, reduced.width) == (rows, columns) else self

    def check_resolution(self, rows: int, columns: int) -> None:
        """Check that the intrinsics belong to images of a size.

        Raises
        ------
        FrameError
            ``other-resolution``.
        """
        known = self.width is not None and self.height is not None
        if known and (self.height, self.width) != (rows, columns):
            raise FrameError(
                "other-resolution",
                f"the intrinsics are for {self.width} × {self.height} pixels, the frame has "
                f"{columns} × {rows}: scale them, or give those of the depth image",
            )
        if not known and self.cx is not None:
            self._check_order(rows, columns)
        for name, value, size in (("cx", self.cx, columns), ("cy", self.cy, rows)):
            if value is not None and not (-0.5 * size if known else 0) < value <= 1.5 * size:
                raise FrameError(
                    "other-resolution",
                    f"the principal point {name}={value:g} cannot be that of {columns} × "
                    f"{rows} pixels: give the intrinsics of this resolution; for a frame cut out "
                    "of a larger one, only the focal length, or also its own width and height",
                )
        if known or self.cx is None or self.cy is None:
            return
        # A cut-out frame is unlikely to have the same scale in both directions, or a usual one.
        scale, other = scales = (2 * self.cx + 1) / columns, (2 * self.cy + 1) / rows
        is_whole = scale > _LEAST_SCALE and abs(scale - other) < _SAME_SCALE * scale
        is_usual = any(max(abs(scale / s - 1), abs(other / s - 1)) < _USUAL_SCALE for s in _SCALES)
        is_of_axes = max(abs(s - 1) for s in scales) > _SAME_SCALE and all(
            min(abs(s / usual - 1) for usual in _SCALES_OF_AXES) < _SAME_SCALE for s in scales
        )
        if is_usual or is_of_axes or (is_whole and abs(scale - 1) > OFF_CENTRE):
            raise FrameError(
                "other-resolution",
                f"the principal point ({self.cx:g}, {self.cy:g}) is the centre of an image of "
                f"{scale * columns:.0f} × {other * rows:.0f} pixels, and the frame has {columns} × "
                f"{rows}: give the intrinsics of this resolution; for a frame cut out of a larger "
                "one, only the focal length, or also its own width and height",
            )

    def _check_order(self, rows: int, columns: int) -> None:
        """Raise FrameError if the numbers fit a frame in another usual order, but not in theirs."""

        def fits(fx: float, fy: float, cx: float, cy: float) -> bool:
            off = max(abs(cx / columns - 0.5), abs(cy / rows - 0.5))
            return off < _CENTRAL and abs(fx - fy) < _SQUARE * fy

        a, b, c, d = given = self.fx, self.fy, self.cx or 0.0, self.cy or 0.0
        for order, numbers in (
            ("fx,cx,fy,cy", (a, c, b, d)),
            ("cx,cy,fx,fy", (c, d, a, b)),
            ("fx,fy,cy,cx", (a, b, d, c)),
        ):
            if fits(*numbers) and not fits(*given):
                raise FrameError(
                    "other-resolution",
                    f"{a:g},{b:g},{c:g},{d:g} as fx,fy,cx,cy do not fit {columns} × {rows} pixels, "
                    f"as {order} they do: give {','.join(f'{number:g}' for number in numbers)}",
                )

    def doubts(self, rows: int, columns: int) -> tuple[str, ...]:
        """Return a sentence if the intrinsics may belong to an image of another size, else ()."""
        off = [
            value is not None and abs(value - (size - 1) / 2) > OFF_CENTRE * size
            for value, size in ((self.cx, columns), (self.cy, rows))
        ]
        if not any(off):
            return ()
        return (
            f"the principal point ({self.cx:g}, {self.cy:g}) is far from the centre of {columns} × "
            f"{rows} pixels: is the frame cut out of a larger one, or do the intrinsics belong to "
            "another camera or resolution?",
        )


def as_intrinsics(value: Intrinsics | float | ArrayLike) -> Intrinsics:
    """Return intrinsics from (f), (fx, fy, cx, cy), or a 3 × 3 matrix of numbers.

    Raise UserError where the value has none of these forms.
    """
    if isinstance(value, Intrinsics):
        return value
    if isinstance(value, str | bytes | Path):
        raise UserError(f"intrinsics: {str(value)!r} is text; give numbers: f, or (fx, fy, cx, cy)")
    try:
        numbers = [float(number) for number in np.ravel(np.asarray(value, dtype=np.float64))]
    except (TypeError, ValueError, OverflowError):
        raise UserError(f"intrinsics: {value!r:.60} are not numbers; give fx,fy,cx,cy") from None
    if len(numbers) == 1:
        return Intrinsics(numbers[0], numbers[0])
    if len(numbers) == 4:
        return Intrinsics(numbers[0], numbers[1], numbers[2], numbers[3])
    if len(numbers) == 9 and not any(numbers):
        raise UserError(
            "intrinsics: all 9 numbers of the matrix are 0: the camera is not calibrated (a ROS "
            "driver says so); calibrate it, or give fx,fy,cx,cy"
        )
    if len(numbers) == 9:
        if not np.allclose([numbers[3], *numbers[6:]], [0, 0, 0, 1]):
            raise UserError(
                "intrinsics: a 3x3 matrix is fx 0 cx, 0 fy cy, 0 0 1; is this one transposed?"
            )
        return Intrinsics(numbers[0], numbers[4], numbers[2], numbers[5])
    raise UserError(f"intrinsics: {len(numbers)} numbers; give f, or fx,fy,cx,cy, or a 3x3 matrix")


@dataclass(frozen=True)
class DepthCamera:
    """Intrinsics and depth unit of the camera that took a frame.

    Attributes
    ----------
    unit_m : float
        Metres per unit of integer depth.
    warnings : tuple of str
        Content of the camera file that has no effect, a sentence each.
    """

    intrinsics: Intrinsics | None = None
    unit_m: float = MILLIMETRE
    warnings: tuple[str, ...] = ()


def camera_of(text: str | None, frame: str | Path = "") -> DepthCamera:
    """Return the camera of a frame, from ``f``, ``fx,fy,cx,cy`` or the name of a camera file.

    A camera file is JSON or YAML: BOP's ``camera.json`` (``fx, fy, cx, cy, width, height``) or
    ``cam_K``, each with or without ``depth_scale``; BOP's ``scene_camera.json``, with a camera for
    each image; ROS's ``CameraInfo`` (``k`` or ``K``); Open3D's ``intrinsic_matrix``; or
    ``camera_matrix`` of ROS or of OpenCV's ``FileStorage``, with its numbers in ``data`` or nested.
    A text or an ``.npy`` file of numbers alone is a 3 × 3 matrix, or fx fy cx cy.
    Raise UserError where the text has none of these forms, or the file has no camera for the frame.

    Parameters
    ----------
    text : str or None
        None if the camera is unknown.
    frame : path
        The number at the end of its stem selects the image in a ``scene_camera.json``, as BOP
        names images. The name does not matter if all images have the same camera.
    """
    if text is None:
        return DepthCamera()
    if (numbers := _numbers_in(text)) is not None:
        return DepthCamera(as_intrinsics(numbers))
    path = Path(text)
    try:
        if not path.is_file():
            raise UserError(f"`intrinsics`={text}: {_what_is_missing(path)}")
        values = _read_mapping(path)
        return camera_of_values(_image_entry(values, path, Path(frame)), path)
    except UserError:
        raise
    except Exception as error:
        raise UserError(f"{path} cannot be read ({reason_of(error)})") from error


def _numbers_in(text: str) -> list[float] | None:
    """Return the numbers of a text that holds nothing else, else None."""
    try:
        return [float(part) for part in text.replace(",", " ").split()]
    except ValueError:
        return None


def _what_is_missing(path: Path) -> str:
    if path.is_dir():
        return "it is a folder; name a camera file in it, or give fx,fy,cx,cy"
    if path.exists() or path.suffix or len(path.parts) > 1:
        return f"the file {missing(path)}; name a camera file, or give fx,fy,cx,cy"
    return "neither numbers nor a file; give fx,fy,cx,cy or a camera file"


def _image_entry(values: Mapping[str, Any], path: Path, frame: Path) -> Mapping[str, Any]:
    """Return the camera of a frame: its image's if each image has its own, else the file's."""
    by_image: dict[int, Mapping[str, Any]] = {
        int(key): value for key, value in values.items() if str(key).isdecimal()
    }
    if not by_image or len(by_image) < len(values):
        return values
    cameras = list(by_image.values())
    if not all(isinstance(camera, Mapping) for camera in cameras):
        raise UserError(f"{path} has images without a camera; give fx,fy,cx,cy")
    known = [{key: camera.get(key) for key in ("cam_K", "depth_scale")} for camera in cameras]
    if all(camera == known[0] for camera in known):
        return known[0]
    number = re.search(r"\d+$", frame.stem)
    if number is None or int(number[0]) not in by_image:
        raise UserError(
            f"{path} has cameras for images {min(by_image)} to {max(by_image)} but not for "
            f"{frame.name}: name the frame after its image, such as 000012.png, or give fx,fy,cx,cy"
        )
    return by_image[int(number[0])]


def _read_mapping(path: Path) -> Mapping[str, Any]:
    if path.suffix.lower() == ".npy":
        return {"K": read_numbers(path)}
    text = read_text(path)
    if (numbers := _numbers_in(text)) and len(numbers) > 1:
        return {"K": numbers}
    if path.suffix.lower() == ".json":
        values = json.loads(text)
    else:
        import yaml

        # OpenCV's own directive and type are no YAML of others. `ros2 topic echo --once` ends with
        # a separator of documents.
        text = re.sub(r"^%YAML:.*|!!opencv-\w+", "", text)
        values = next(iter(yaml.safe_load_all(text)), None)
    if not isinstance(values, Mapping):
        raise UserError(f"{path} is not a camera file; give names with values, or fx,fy,cx,cy")
    return values


def camera_of_values(values: Mapping[str, Any], path: str | Path) -> DepthCamera:
    """Return the camera of the names and values of a camera file, or of a ROS ``CameraInfo``.

    `path` is used in messages, which are those of `camera_of`.
    """
    if isinstance(values.get("intrinsic"), Mapping):
        values = values["intrinsic"]
    size = (
        values.get("width", values.get("image_width")),
        values.get("height", values.get("image_height")),
    )
    names = ("cam_K", "k", "K", "camera_matrix", "intrinsic_matrix")
    matrix = next((values[name] for name in names if name in values), None)
    if matrix is None:
        absent = [name for name in ("fx", "fy", "cx", "cy") if name not in values]
        if absent:
            raise UserError(
                f"{path} lacks {absent[0]}; give fx, fy, cx and cy, or cam_K, K or camera_matrix"
            )
        matrix = [values[name] for name in ("fx", "fy", "cx", "cy")]
    try:
        given = as_intrinsics(_numbers_of(matrix))
        width, height = (int(side) if isinstance(side, float) else side for side in size)
        intrinsics = replace(given, width=width, height=height)
        intrinsics = replace(intrinsics, reduced=_reduced(intrinsics, values))
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    unit_m = _unit_m(values.get("depth_scale"), path)
    return DepthCamera(intrinsics, unit_m, _distortion_warnings(values, path))


def _numbers_of(matrix: Any) -> Any:
    # ROS and OpenCV keep them with the number of rows and columns.
    numbers = matrix.get("data") if isinstance(matrix, Mapping) else matrix
    # Open3D writes a matrix column by column, so that its last row comes last in every third.
    if isinstance(numbers, list) and len(numbers) == 9 and numbers[2::3] == [0, 0, 1]:
        return [numbers[i] for column in range(3) for i in range(column, 9, 3)]
    return numbers


def _reduced(whole: Intrinsics, values: Mapping[str, Any]) -> Intrinsics | None:
    """Return the intrinsics of binned or cut-out images, which CameraInfo does not scale itself."""
    roi, binning = values.get("roi") or {}, [values.get(f"binning_{axis}") or 1 for axis in "xy"]
    names = ("x_offset", "y_offset", "width", "height")
    is_mapping = isinstance(roi, Mapping)
    window: list[Any] = [roi.get(name) or 0 for name in names] if is_mapping else [None]
    if not all(isinstance(n, int | float) and 0 <= n < math.inf for n in (*binning, *window)):
        raise UserError("binning and roi are not numbers of pixels, 0 or more; correct them there")
    (across, down), (x, y, width, height) = binning, window
    width, height = (width or whole.width or 0) // across, (height or whole.height or 0) // down
    if (
        whole.cx is None
        or whole.cy is None
        or (width, height) in ((0, 0), (whole.width, whole.height))
    ):
        return None
    cx, cy = (whole.cx - x + 0.5) / across - 0.5, (whole.cy - y + 0.5) / down - 0.5
    return Intrinsics(whole.fx / across, whole.fy / down, cx, cy, width, height)


def _distortion_warnings(values: Mapping[str, Any], path: str | Path) -> tuple[str, ...]:
    """Return a sentence for coefficients of distortion that are not 0."""
    return tuple(
        f"{path}: the lens distortion ({name}) is not corrected: give rectified depth frames (ROS: "
        "image_rect, OpenCV: undistort) and their intrinsics"
        for name, value in values.items()
        if _DISTORTION.fullmatch(str(name)) and value is not None
        if np.any(np.asarray(_numbers_of(value), dtype=object) != 0)
    )[:1]


def _unit_m(depth_scale: Any, path: str | Path) -> float:
    """Return metres per unit from BOP's millimetres per unit."""
    if depth_scale is None:
        return MILLIMETRE
    is_number = isinstance(depth_scale, int | float) and not isinstance(depth_scale, bool)
    if not (is_number and 0 < depth_scale < math.inf):
        raise UserError(f"{path}: depth_scale={depth_scale!r} must be above 0 (BOP: millimetres)")
    return float(depth_scale) * MILLIMETRE
