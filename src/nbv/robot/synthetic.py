"""Depth frames that a sensor would take of a mesh: to try things without a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nbv.data.camera import Camera
from nbv.data.mesh_reader import MeshReader
from nbv.data.meshes import Mesh, as_mesh
from nbv.data.normalisation import check_mesh, normalise
from nbv.data.renderers import open_renderer
from nbv.data.sensors import Sensor
from nbv.data.sensors.triangulation import Kinect, Stereo
from nbv.data.sources.files import EXTENSIONS
from nbv.errors import UserError, check_number, nearest
from nbv.robot.crop import FARTHEST, NEAREST
from nbv.robot.depth_files import DepthImage
from nbv.robot.intrinsics import Intrinsics

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
"""What `draw_frame` can be taken with, by name; all have `HEIGHT` rows."""


@dataclass(frozen=True)
class Frame:
    """A depth frame, and what is known of it.

    Attributes
    ----------
    depth_m : (480, columns) float32
        Metres; 0 where nothing was measured.
    mask : (480, columns) bool
        The pixels of the object where depth was measured.
    intrinsics : Intrinsics
    azimuth_deg, elevation_deg : float
        Of the camera.
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
    """Return what a depth camera measures of an object in front of it.

    Parameters
    ----------
    mesh : Mesh
        Of unit diagonal.
    azimuth_deg, elevation_deg : float
        Of the camera about the object, which it is directed at.
    distance_m : float
    diagonal_m : float
        Of the object's bounding box.
    seed : int
        Of the noise.
    sensor : str
        A name in `CAMERAS`. ``none`` is the Kinect's camera with the true depth.

    Raises
    ------
    UserError
        Where an angle is none, the object would be nearer or farther than is plausible or than the
        sensor measures, the sensor is unknown, or the seed is negative.
    """
    _check_view(azimuth_deg, elevation_deg, distance_m, diagonal_m)
    if sensor not in CAMERAS:
        raise UserError(f"sensor={sensor}: {nearest(sensor, CAMERAS)}")
    if seed < 0:
        raise UserError(f"seed={seed}: must be 0 or more")
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
                f"a distance of {distance_m:g} m: {sensor} measures nothing nearer than "
                f"{nearest_m:.2g} m"
            )
        depth = taken_by.measure(depth, camera, diagonal_m, np.random.default_rng(seed))
    above = (width - HEIGHT) // 2
    depth_m = (depth[0, above : above + HEIGHT] * np.float32(diagonal_m)).astype(np.float32)
    if not depth_m.any():
        raise UserError("no pixel of the object is seen in this frame: bring the camera nearer")
    intrinsics = Intrinsics(
        focal_px, focal_px, width / 2 - 0.5, HEIGHT / 2 - 0.5, width=width, height=HEIGHT
    )
    return Frame(depth_m, depth_m > 0, intrinsics, azimuth_deg, elevation_deg)


def _check_view(
    azimuth_deg: float, elevation_deg: float, distance_m: float, diagonal_m: float
) -> None:
    check_number("azimuth", azimuth_deg)
    check_number("elevation", elevation_deg)
    if not math.isfinite(azimuth_deg):
        raise UserError(f"an azimuth of {azimuth_deg:g}°: give a number of degrees")
    if not -90 <= elevation_deg <= 90:
        raise UserError(f"an elevation of {elevation_deg:g}°: it lies from -90 to 90")
    if not (math.isfinite(diagonal_m) and diagonal_m > 0):
        raise UserError(f"a diagonal of {diagonal_m:g} m: it must be above 0")
    if not NEAREST * diagonal_m <= distance_m <= FARTHEST * diagonal_m:
        raise UserError(
            f"a distance of {distance_m:g} m from an object of {diagonal_m:g} m: "
            f"{NEAREST * diagonal_m:.3g} to {FARTHEST * diagonal_m:.3g} m are plausible; change "
            "the distance or the object's diagonal, both in metres"
        )


def example_frame(azimuth_deg: float = 75.0, elevation_deg: float = 15.0) -> Frame:
    """Return a frame of a generated mug, 0.8 m away. From 75° its handle is hidden.

    Examples
    --------
    >>> import nbv
    >>> nbv.example_frame().depth_m.shape
    (480, 640)
    """
    return draw_frame(example_mesh(), azimuth_deg, elevation_deg, 0.8, 0.17)


def example_mesh() -> Mesh:
    """Return a generated mug of unit diagonal."""
    from nbv.data.procedural import generate

    return as_mesh(normalise(generate("mug", seed=0, index=0), "+z", "+x", 0.0, "origin"))


def read_mesh(path: str | Path, up: str = "+z", front: str = "+x") -> Mesh:
    """Read a mesh file and bring it to unit diagonal, its axes as of `dataset.up` and `front`.

    Raises
    ------
    UserError
        Where it is of no kind in `EXTENSIONS`, cannot be read, or has no surface.
    """
    if Path(path).suffix.lower() not in EXTENSIONS:
        raise UserError(f"{path}: no known kind of mesh file; give {', '.join(EXTENSIONS)}")
    mesh = MeshReader().read(Path(path))
    check_mesh(mesh, str(path))
    return as_mesh(normalise(mesh, up, front, 0.0, "box"))
