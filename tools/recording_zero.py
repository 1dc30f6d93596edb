"""Print where the real mug's handle is in its frames: recording_zero.py MANIFEST > zero.csv.

Depth says where the handle points, without any network. A circle of the mug's radius is fitted to
the body, seen along the mug's axis; what is farther from its middle is the handle. The zero of a
recording is what must be added to its azimuths so that the handle points at the camera at 270°; the
frames with the handle in front of the body say it. The same is measured in frames of a mug of this
shape that are drawn from there. See docs/reference/bundles/README.md.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from same_shape import RADIUS, VIEWS, the_mug
from scipy.optimize import least_squares
from scipy.stats import theilslopes

from nbv.core.angles import signed_difference_deg, wrap_deg
from nbv.robot.depth_files import read_depth
from nbv.robot.masks import object_mask, window_of
from nbv.robot.recordings import Recording, read_manifest
from nbv.robot.synthetic import draw_frame

IN_FRONT_DEG = 54.0
"""The handle is seen in front of the body where the camera is at most so far from it."""

HANDLE_M, LEAST_PIXELS = (0.008, 0.035), 15
"""How far from the body's wall the handle is, metres, and how many pixels are enough."""

FOCAL_PX = 585.0
REACH_M = 0.09
"""How far the mug reaches behind its nearest point, metres."""

WALL_M, NOISE_M = 0.005, 0.002
"""How far from the circle the wall's points may be, and usually are, metres."""

Points = NDArray[np.float64]


def seen_from_the_axis(depth_m: NDArray[np.float32], elevation_deg: float) -> Points:
    """Return the points (n, 2) of the middle of the mug: to the right, and away from the camera."""
    rows, columns = np.nonzero(object_mask(depth_m, REACH_M))
    away = depth_m[rows, columns].astype(np.float64)
    # The frame is taken to be centred on the mug: what it is off by turns all points alike.
    right = (columns + 0.5 - depth_m.shape[1] / 2) * away / FOCAL_PX
    down = (rows + 0.5 - depth_m.shape[0] / 2) * away / FOCAL_PX
    sine, cosine = np.sin(np.radians(elevation_deg)), np.cos(np.radians(elevation_deg))
    below = away * sine + down * cosine
    low, high = np.quantile(below, (0.3, 0.85))
    points = np.stack([right, away * cosine - down * sine], axis=1)
    return points[(below >= low) & (below <= high)]


def body_axis(points: Points) -> Points:
    """Return the middle (2,) of the circle of `RADIUS` on whose near side most points lie."""
    right, away = points.T
    middle = np.array([(right.min() + right.max()) / 2, np.quantile(away, 0.6) + 0.6 * RADIUS])
    nearest_m = 2 * WALL_M
    for _ in range(10):
        wall = np.abs(np.hypot(*(points - middle).T) - RADIUS) < nearest_m
        on_wall = points[wall & (away < middle[1])]
        middle = least_squares(
            lambda place, wall=on_wall: np.hypot(*(wall - place).T) - RADIUS,
            middle,
            loss="soft_l1",
            f_scale=NOISE_M,
        ).x
        nearest_m = WALL_M
    return middle


def handle_deg(depth_m: NDArray[np.float32], elevation_deg: float) -> float:
    """Return where the handle points, degrees from the direction to the camera; NaN if unseen.

    Positive where the camera has to move counter-clockwise, seen from above, to face it.
    """
    points = seen_from_the_axis(depth_m, elevation_deg)
    middle = body_axis(points)
    beyond = np.hypot(*(points - middle).T) - RADIUS
    near, far = HANDLE_M
    handle = points[(beyond > near) & (beyond < far)]
    if len(handle) < LEAST_PIXELS:
        return np.nan
    right, away = handle.mean(axis=0) - middle
    to_camera, to_handle = np.arctan2(-middle[0], middle[1]), np.arctan2(right, -away)
    return float(np.degrees(to_handle - to_camera))


def zero_deg(azimuth_deg: NDArray[np.float64], of_handle_deg: NDArray[np.float64]) -> float:
    """Return what must be added to azimuths (n,) so that the handle points at the camera at 270°.

    From a straight line of medians (Theil and Sen): a frame with a wrong azimuth hardly moves it.
    """
    from_front = signed_difference_deg(azimuth_deg, 270.0)
    slope, at_270_deg, *_ = theilslopes(of_handle_deg, from_front, method="joint")
    return float(at_270_deg / slope)


def handles(recording: Recording, elevation_deg: float, distance_m: float) -> pd.DataFrame:
    """Return where the handle points in each frame, and in drawn ones, with the zero."""
    azimuth_deg = recording.azimuth_deg
    found = [handle_deg(read_depth(path), elevation_deg) for path in recording.frames["path"]]
    is_in_front = np.abs(signed_difference_deg(azimuth_deg, 270.0)) <= IN_FRONT_DEG
    zero = zero_deg(azimuth_deg[is_in_front], np.array(found)[is_in_front])
    mug, _, diagonal_m = the_mug()
    drawn = []
    for place, at_deg in enumerate(wrap_deg(azimuth_deg + zero).tolist()):
        view = at_deg, elevation_deg, distance_m, diagonal_m
        frame = draw_frame(mug, *view, place, sensor="kinect")
        drawn.append(handle_deg(frame.depth_m[window_of(frame.mask)[1]], elevation_deg))
    table = {
        "sequence": recording.sequence,
        "elevation_deg": elevation_deg,
        "zero_deg": zero,
        "azimuth_deg": azimuth_deg,
        "handle_deg": found,
        "drawn_handle_deg": drawn,
    }
    return pd.DataFrame(table)


def main() -> None:
    """Print a table of the frames of all recordings."""
    tables = [
        handles(recording, *view)
        for recording in read_manifest(sys.argv[1])
        for view in VIEWS[recording.sequence]
    ]
    pd.concat(tables).to_csv(sys.stdout, index=False, float_format="%.2f")


if __name__ == "__main__":
    main()
