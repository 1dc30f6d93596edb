"""The configured sensors, and surfaces whose depth is known exactly."""

import math
from pathlib import Path

import numpy as np

from nbv.data.camera import Camera
from nbv.data.sensors.triangulation import Kinect, Stereo
from nbv.experiment.config import load_config

CONFIG = Path(__file__).parents[2] / "config"
CONFIGURED = {
    name: load_config(CONFIG, [f"sensor={name}"])["sensor"] for name in ("kinect", "stereo")
}
KINECT = Kinect(**CONFIGURED["kinect"]["parameters"])
STEREO = Stereo(**CONFIGURED["stereo"]["parameters"])
CAMERA = Camera()
DISTANCES_M = (0.45, 0.8, 1.3, 2.0, 3.0)


def plane(z_m: float, tilt_deg: float = 0.0, side: int = 64, k: int = 1):
    """Depth in metres of a plane that fills the image, rotated about the vertical axis."""
    column = (np.arange(side) + 0.5 - side / 2) / Camera(image_side=side).focal_px
    depth = z_m / (1 - column * math.tan(math.radians(tilt_deg)))
    assert (depth > 0).all()
    return np.broadcast_to(depth, (k, side, side)).astype(np.float32)


def plate(z_m: float, half: int = 20, k: int = 8):
    """A square, front on, in an otherwise empty image."""
    image = np.zeros((k, 64, 64), np.float32)
    image[:, 32 - half : 32 + half, 32 - half : 32 + half] = z_m
    return image


def measured(sensor, z, seed=0):
    """Measured depth in metres (one metre to the diagonal)."""
    return sensor(z, CAMERA, 1.0, np.random.default_rng(seed))


def kinect_sigma_m(z_m):
    return 0.0012 + 0.0019 * (z_m - 0.4) ** 2


def stereo_sigma_m(z_m):
    return z_m**2 * 0.08 / (424 * 0.05)
