"""Synthetic depth frames of a mesh, to try things without a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nbv.core.circle.angles import is_angle
from nbv.data.camera import Camera
from nbv.data.mesh_reader import MeshReader
from nbv.data.meshes import Mesh, as_mesh, check_mesh, normalise
from nbv.data.render import open_renderer
from nbv.data.sensors import Sensor
from nbv.data.sensors.triangulation import Kinect, Stereo
from nbv.data.sources.files import EXTENSIONS
from nbv.errors import UserError, check_number, nearest
from nbv.frames.crop import FARTHEST, NEAREST
from nbv.frames.depth_files import DepthImage
from nbv.frames.intrinsics import Intrinsics

WIDTH, HEIGHT = 640, 480

# The first Kinect (Nguyen et al. 2012; Konolige and Mihelich), and a RealSense D435
# (Grunnet-Jepsen et al. 2019; Keselman et al. 2017).
_KINECT = Kinect(focal_px=585.0, baseline_m=0.075, window_px=9.0)
_STEREO = Stereo(focal_px=424.0, baseline_m=0.05, disparity_noise_px=0.08, window_px=7.0)


@dataclass(frozen=True)
class _DepthCamera:
    measure: Sensor | None
    focal_px: float
    width: int


CAMERAS = {
    "kinect": _DepthCamera(_KINECT, _KINECT.focal_px, WIDTH),
    "stereo": _DepthCamera(_STEREO, _STEREO.focal_px, 848),
    "none": _DepthCamera(None, _KINECT.focal_px, WIDTH),
}
"""Depth cameras of `draw_frame`, by name; all images have `HEIGHT` rows."""


@dataclass(frozen=True)
class Frame:
    """A depth frame and its ground truth.

    Depth (480, columns) is in metres, 0 where nothing was measured. The mask (480, columns) has the
    pixels of the object with a depth. The angles are the camera's position around the object.
    """

    depth_m: DepthImage
    mask: NDArray[np.bool_]
    intrinsics: Intrinsics
    azimuth_deg: float
    elevation_deg: float


def draw_frame(
    mesh: Mesh,
    azimuth_deg: float,
    elevation_deg: float,
    distance_m: float,
    diagonal_m: float,
    seed: int = 0,
    *,
    sensor: str = "kinect",
) -> Frame:
    """Return a frame that a depth camera would take of a mesh.

    Raise UserError where an angle is invalid, the distance is implausible or below the sensor's
    range, the sensor is unknown, or the seed is negative.

    The mesh has a unit diagonal, and `diagonal_m` is that of the object's bounding box. The camera
    points at the object; the sensor is one of `CAMERAS`, where ``none`` gives the true depth in the
    Kinect's image. The seed is that of the noise.
    """
    _check_view(azimuth_deg, elevation_deg, distance_m, diagonal_m)
    if sensor not in CAMERAS:
        raise UserError(f"`sensor`={sensor}: {nearest(sensor, CAMERAS)}")
    if seed < 0:
        raise UserError(f"`seed`={seed}: give 0 or more")
    taken_by = CAMERAS[sensor]
    focal_px, width = taken_by.focal_px, taken_by.width
    fov_deg = math.degrees(2 * math.atan(width / 2 / focal_px))
    camera = Camera(distance_m / diagonal_m, fov_deg, width, framing="axis")
    depth = open_renderer("embree").render(
        mesh.vertices, mesh.faces, elevation_deg, [azimuth_deg], camera
    )
    if taken_by.measure is not None:
        if distance_m < (nearest_m := taken_by.measure.nearest_m):
            raise UserError(
                f"`distance_m`={distance_m:g}: {sensor} measures only from {nearest_m:.2g} m on; "
                "move the camera away"
            )
        depth = taken_by.measure(depth, camera, diagonal_m, np.random.default_rng(seed))
    above = (width - HEIGHT) // 2
    depth_m = (depth[0, above : above + HEIGHT] * np.float32(diagonal_m)).astype(np.float32)
    if not depth_m.any():
        raise UserError("no pixel of the object is visible in this frame: move the camera closer")
    intrinsics = Intrinsics(
        focal_px, focal_px, width / 2 - 0.5, HEIGHT / 2 - 0.5, width=width, height=HEIGHT
    )
    return Frame(depth_m, depth_m > 0, intrinsics, azimuth_deg, elevation_deg)


def _check_view(
    azimuth_deg: float, elevation_deg: float, distance_m: float, diagonal_m: float
) -> None:
    check_number("`azimuth_deg`", azimuth_deg)
    check_number("`elevation_deg`", elevation_deg)
    if not is_angle(azimuth_deg):
        raise UserError(f"`azimuth_deg`={azimuth_deg:g}: give degrees, at most 1e6")
    if not -90 <= elevation_deg <= 90:
        raise UserError(f"`elevation_deg`={elevation_deg:g}: give -90 to 90 degrees")
    if not (math.isfinite(diagonal_m) and diagonal_m > 0):
        raise UserError(f"`diagonal_m`={diagonal_m:g}: give metres above 0")
    if not NEAREST * diagonal_m <= distance_m <= FARTHEST * diagonal_m:
        raise UserError(
            f"`distance_m`={distance_m:g} from an object with `diagonal_m`={diagonal_m:g}: "
            f"{NEAREST * diagonal_m:.3g} to {FARTHEST * diagonal_m:.3g} m are plausible; change "
            "one of them, both are in metres"
        )


def example_frame(azimuth_deg: float = 75.0, elevation_deg: float = 15.0) -> Frame:
    """Return a frame of a procedural mug, 0.8 m away. From 75° its handle is hidden.

    Examples
    --------
    >>> import nbv
    >>> nbv.example_frame().depth_m.shape
    (480, 640)
    """
    return draw_frame(example_mesh(), azimuth_deg, elevation_deg, 0.8, 0.17)


def example_mesh() -> Mesh:
    """Return a procedural mug of unit diagonal."""
    from nbv.data.procedural import generate

    return as_mesh(normalise(generate("mug", seed=0, index=0), "+z", "+x", 0.0, "origin"))


def read_mesh(path: str | Path, up: str = "+z", front: str = "+x") -> Mesh:
    """Read a mesh file and scale it to unit diagonal; `up` and `front` name axes of the file.

    Raise UserError where the suffix is not one of `EXTENSIONS`, the file cannot be read, or it has
    no surface.
    """
    if Path(path).suffix.lower() not in EXTENSIONS:
        raise UserError(f"{path}: unknown kind of mesh file; give {', '.join(EXTENSIONS)}")
    mesh = MeshReader().read(Path(path))
    check_mesh(mesh, str(path))
    return as_mesh(normalise(mesh, up, front, 0.0, "box"))
