"""The intrinsic parameters of a pinhole camera, from the files that are in use."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nbv.errors import UserError
from nbv.frames.errors import FrameError


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths and principal point, in pixels.

    Attributes
    ----------
    fx, fy : float
    cx, cy : float, optional
        None: the middle of the image.
    width, height : int, optional
        Of the images that they are for, where that is known.

    Examples
    --------
    >>> import nbv
    >>> nbv.Intrinsics(585.0, 585.0, cx=319.5, cy=239.5, width=640, height=480).fx
    585.0
    """

    fx: float
    fy: float
    cx: float | None = None
    cy: float | None = None
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise UserError(f"intrinsics: {name}={value:g} must be above 0 (pixels)")
        for name in ("cx", "cy"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise UserError(f"intrinsics: {name}={value:g} is no number")

    def need_resolution(self, rows: int, columns: int) -> None:
        """Raise FrameError ``other-resolution`` where they are for images of another size."""
        known = self.width is not None and self.height is not None
        if known and (self.height, self.width) != (rows, columns):
            raise FrameError(
                "other-resolution",
                f"the intrinsics are for {self.width} × {self.height} pixels, the frame has "
                f"{columns} × {rows}: scale them, or give those of the depth image",
            )
        for name, value, size in (("cx", self.cx, columns), ("cy", self.cy, rows)):
            if value is not None and not -0.5 * size <= value <= 1.5 * size:
                raise FrameError(
                    "other-resolution",
                    f"the principal point {name}={value:g} lies far outside a frame of {columns} × "
                    f"{rows} pixels: are the intrinsics of another resolution?",
                )


def as_intrinsics(value: Intrinsics | float | ArrayLike) -> Intrinsics:
    """Return intrinsics from (f), (fx, fy, cx, cy), or a 3 × 3 matrix of numbers.

    Raises
    ------
    UserError
        For anything else.
    """
    if isinstance(value, Intrinsics):
        return value
    try:
        numbers = [float(number) for number in np.ravel(np.asarray(value, dtype=np.float64))]
    except (TypeError, ValueError):
        raise UserError(f"intrinsics: {value!r} are no numbers; give fx,fy,cx,cy") from None
    if len(numbers) == 1:
        return Intrinsics(numbers[0], numbers[0])
    if len(numbers) == 4:
        return Intrinsics(numbers[0], numbers[1], numbers[2], numbers[3])
    if len(numbers) == 9:
        if not np.allclose([numbers[3], *numbers[6:]], [0, 0, 0, 1]):
            raise UserError(
                "intrinsics: a 3x3 matrix is fx 0 cx, 0 fy cy, 0 0 1; is this one transposed?"
            )
        return Intrinsics(numbers[0], numbers[4], numbers[2], numbers[5])
    raise UserError(f"intrinsics: {len(numbers)} numbers; give f, or fx,fy,cx,cy, or a 3x3 matrix")


def parse_intrinsics(text: str) -> Intrinsics:
    """Return intrinsics from ``f``, ``fx,fy,cx,cy`` or the name of a camera file.

    A camera file is JSON or YAML: BOP's ``camera.json`` (``fx, fy, cx, cy, width, height``) or
    ``cam_K``, or ROS's ``CameraInfo`` (``k`` or ``K``, or ``camera_matrix.data``).

    Raises
    ------
    UserError
        Where it is neither.
    """
    parts = text.split(",")
    try:
        return as_intrinsics([float(part) for part in parts])
    except ValueError:
        pass
    path = Path(text)
    try:
        if not path.is_file():
            raise UserError(f"--intrinsics={text}: no numbers fx,fy,cx,cy and no camera file")
        return _of_mapping(_read_mapping(path), path)
    except UserError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{path} cannot be read ({reason})") from error


def _read_mapping(path: Path) -> Mapping[str, Any]:
    text = path.read_text(encoding="utf-8")
    if path.suffix.lower() == ".json":
        values = json.loads(text)
    else:
        import yaml

        # `ros2 topic echo --once` ends with the mark of a further document.
        values = next(iter(yaml.safe_load_all(text)), None)
    if not isinstance(values, Mapping):
        raise UserError(f"{path} holds no camera: no names with values")
    return values


def _of_mapping(values: Mapping[str, Any], path: Path) -> Intrinsics:
    size = (
        values.get("width", values.get("image_width")),
        values.get("height", values.get("image_height")),
    )
    matrix = next((values[key] for key in ("cam_K", "k", "K") if key in values), None)
    if matrix is None and isinstance(values.get("camera_matrix"), Mapping):
        matrix = values["camera_matrix"].get("data")
    if matrix is None:
        absent = [name for name in ("fx", "fy", "cx", "cy") if name not in values]
        if absent:
            raise UserError(f"{path} holds no {absent[0]}, and no cam_K, K or camera_matrix")
        matrix = [values[name] for name in ("fx", "fy", "cx", "cy")]
    found = as_intrinsics(matrix)
    width, height = (int(side) if isinstance(side, int | float) else None for side in size)
    return Intrinsics(found.fx, found.fy, found.cx, found.cy, width, height)
