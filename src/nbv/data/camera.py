"""The pinhole camera: its poses around an object, and the object's outline in its images.

Normalised image coordinates (x, y) are tangents: a point at depth d on the ray (x, y) lies d·x to
the right of the optical axis and d·y above it. All renderers share the views of this module.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError, nearest

Floats = NDArray[np.float64]

FRAMINGS = ("silhouette", "axis")

# For fewer vertices, a convex hull costs more than it saves.
_FEW_VERTICES = 64
# Pixels by which rounding may push an outline beyond the image's edge.
_EDGE_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Camera:
    """A square perspective camera.

    Parameters
    ----------
    distance : float
        Distance from the object's origin, in object diagonals.
    fov_deg : float
        Full angle of view, in (0, 180).
    image_side : int
        Pixels along each side.
    framing : {"silhouette", "axis"}
        The middle of the image: the centre of the silhouette's bounding box, as in a detector's
        crop, or the origin of the object frame. Framing shifts the principal point without scaling
        or rotation.
    whole_pixels : bool
        Framing shifts by whole pixels, so that pixels sample the same rays as without framing.
    roll_deg : float
        Rotation about the optical axis, clockwise seen from behind the camera.
    """

    distance: float = 2.5
    fov_deg: float = 25.0
    image_side: int = 64
    framing: str = "silhouette"
    whole_pixels: bool = False
    roll_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.framing not in FRAMINGS:
            message = f"framing={self.framing}: no such framing; {nearest(self.framing, FRAMINGS)}"
            raise UserError(message)
        if not self.distance > 0:
            raise UserError(f"distance={self.distance}: must be above 0 (object diagonals)")
        if not 0 < self.fov_deg < 180:
            raise UserError(f"fov_deg={self.fov_deg}: must lie between 0 and 180 degrees")
        if self.image_side < 1:
            raise UserError(f"image_side={self.image_side}: must be at least 1 pixel")

    @property
    def focal_px(self) -> float:
        """Pixels per unit of normalised image coordinates."""
        return self.image_side / (2.0 * math.tan(math.radians(self.fov_deg) / 2.0))


@dataclass(frozen=True)
class Views:
    """Views of an object by k cameras at one elevation.

    Attributes
    ----------
    position : (k, 3) float
        Positions of the pinholes, in the object frame.
    right, up, forward : (k, 3) float
        The axes of each image, orthonormal: columns grow along `right`, rows opposite to `up`,
        depth along `forward`.
    outline : (k, 4) float
        Bounds of the projected vertices in normalised image coordinates: x_min, x_max, y_min,
        y_max.
    centre : (k, 2) float
        Normalised image coordinates (x, y) of the middle of the image.
    nearest, farthest : float
        Bounds of the object's depth in all views, in object diagonals.
    """

    camera: Camera
    position: Floats
    right: Floats
    up: Floats
    forward: Floats
    outline: Floats
    centre: Floats
    nearest: float
    farthest: float

    @cached_property
    def principal_px(self) -> Floats:
        """Column and row of the optical axis, pixels from the top left corner, (k, 2)."""
        middle, focal = self.camera.image_side / 2.0, self.camera.focal_px
        x, y = self.centre.T
        return np.stack([middle - focal * x, middle + focal * y], axis=1)

    @cached_property
    def outline_px(self) -> Floats:
        """Bounds of the projected vertices in pixels, (k, 4): left, right, top, bottom."""
        focal = self.camera.focal_px
        column, row = self.principal_px.T[:, :, None]
        across = column + focal * self.outline[:, :2]
        down = row - focal * self.outline[:, :1:-1]
        return np.concatenate([across, down], axis=1)


def viewpoint_frames(
    elevation_deg: float, azimuths_deg: ArrayLike
) -> tuple[Floats, Floats, Floats]:
    """Return the image axes right, up and forward, (k, 3) each, of cameras directed at the origin.

    Azimuths (k,) are counter-clockwise about +z, which points up, from +x. At elevations of ±90°
    the image's up is away from (towards) the azimuth. The camera is at −distance · forward.
    """
    azimuth = np.radians(np.atleast_1d(np.asarray(azimuths_deg, dtype=np.float64)))
    elevation = np.radians(elevation_deg)
    cos, sin, none = np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)
    level, rise = np.cos(elevation), np.sin(elevation)
    right = np.stack([-sin, cos, none], axis=1)
    up = np.stack([-rise * cos, -rise * sin, none + level], axis=1)
    forward = np.stack([-level * cos, -level * sin, none - rise], axis=1)
    return right, up, forward


def hull_vertices(vertices: ArrayLike, faces: ArrayLike) -> Floats:
    """Return the vertices of the convex hull, (h, 3), which determine all outlines.

    Unused vertices are left out. A flat surface keeps all others.
    """
    # Its import takes longer than what most commands do, and they need no hull.
    from scipy.spatial import ConvexHull, QhullError

    points = np.asarray(vertices, dtype=np.float64)
    is_used = np.zeros(len(points), dtype=bool)
    is_used[np.asarray(faces)] = True
    used: Floats = points[is_used]
    if len(used) > _FEW_VERTICES:
        with contextlib.suppress(QhullError):  # A flat surface has no hull.
            used = used[ConvexHull(used).vertices]
    return used


def object_views(
    vertices: ArrayLike,
    faces: ArrayLike,
    elevation_deg: float,
    azimuths_deg: ArrayLike,
    camera: Camera,
) -> Views:
    """Return the framed views of an object.

    Parameters
    ----------
    vertices : (n, 3) float
        Object frame, in object diagonals.
    faces : (m, 3) int
        Indices into `vertices`.
    elevation_deg : float
        In [-90, 90].
    azimuths_deg : (k,) float

    Raises
    ------
    UserError
        If part of the object lies behind the camera or outside the image. Every object of unit
        diagonal centred on its bounding box fits the default camera: the sphere around it subtends
        23.1° of the 25°.
    """
    azimuths = np.atleast_1d(np.asarray(azimuths_deg, dtype=np.float64))
    right, up, forward = viewpoint_frames(elevation_deg, azimuths)
    if camera.roll_deg:
        cos, sin = np.cos(np.radians(camera.roll_deg)), np.sin(np.radians(camera.roll_deg))
        right, up = cos * right - sin * up, cos * up + sin * right
    hull = hull_vertices(vertices, faces)
    depth = camera.distance + forward @ hull.T
    if (depth <= 0).any():
        behind = azimuths[(depth <= 0).any(axis=1)][0]
        raise UserError(
            f"the object reaches behind the camera at azimuth {behind:g}, elevation "
            f"{elevation_deg:g}: distance={camera.distance:g} is too short"
        )
    x = right @ hull.T / depth
    y = up @ hull.T / depth
    outline = np.stack([x.min(axis=1), x.max(axis=1), y.min(axis=1), y.max(axis=1)], axis=1)
    centre = (outline[:, 0::2] + outline[:, 1::2]) / 2.0
    if camera.framing == "axis":
        centre = np.zeros_like(centre)
    elif camera.whole_pixels:
        centre = np.rint(centre * camera.focal_px) / camera.focal_px
    position = -camera.distance * forward
    reach = float(depth.min()), float(depth.max())
    views = Views(camera, position, right, up, forward, outline, centre, *reach)
    _check_within(views, elevation_deg, azimuths)
    return views


def _check_within(views: Views, elevation_deg: float, azimuths_deg: Floats) -> None:
    side = views.camera.image_side
    bounds = views.outline_px
    excess = np.maximum(-bounds[:, 0::2].min(axis=1), bounds[:, 1::2].max(axis=1) - side)
    worst = int(excess.argmax())
    if excess[worst] > _EDGE_TOLERANCE:
        raise UserError(
            f"the object leaves the image by {excess[worst]:.2g} pixels at azimuth "
            f"{azimuths_deg[worst]:g}, elevation {elevation_deg:g} (framing="
            f"{views.camera.framing}): raise fov_deg={views.camera.fov_deg:g} or "
            f"distance={views.camera.distance:g}"
        )
