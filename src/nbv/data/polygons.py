"""Split the polygons of a mesh into triangles, concave ones too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# As a share of a polygon's area: a smaller dent is rounding.
_NO_DENT = 1e-6
# As a share of a polygon's squared size: a smaller triangle is a line.
_NO_AREA = 1e-12


def triangulate(vertices: Floats, polygons: Sequence[Sequence[int]]) -> Indices:
    """Split polygons into triangles that cover the same surface.

    A polygon becomes the fan of its first corner where the whole fan lies inside it. Otherwise ears
    are clipped in the plane that fits the polygon.

    Parameters
    ----------
    vertices : (n, 3) float
    polygons : sequence of sequence of int
        The corners of each polygon, at least 3: valid indices of `vertices`, in either direction.
        A cut to a hole may pass a corner twice.

    Returns
    -------
    (m, 3) int
        In the order of the polygons.

    Raises
    ------
    ValueError
        If a polygon crosses itself.
    """
    sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    ends = np.cumsum(sizes - 2)
    triangles = np.zeros((ends[-1] if len(ends) else 0, 3), dtype=np.int64)
    for n in np.unique(sizes):
        places = np.flatnonzero(sizes == n)
        corners = np.array([polygons[int(place)] for place in places], dtype=np.int64)
        rows = (ends[places] - (n - 2))[:, None] + np.arange(n - 2)
        triangles[rows] = corners[:, [(0, i, i + 1) for i in range(1, n - 1)]]
        for k in np.flatnonzero(~_holds_fan(vertices[corners])) if n > 3 else ():
            triangles[rows[k]] = corners[k][_ears(vertices[corners[k]])]
    return triangles


def _holds_fan(points: Floats) -> NDArray[np.bool_]:
    """Return whether each polygon (m, n, 3) holds the fan of its first corner."""
    spokes = points[:, 1:] - points[:, :1]
    # A vertex that is not finite is refused later, by its number.
    with np.errstate(all="ignore"):
        normals = np.cross(spokes[:, :-1], spokes[:, 1:])
        sums, sizes = normals.sum(axis=1), np.linalg.norm(normals, axis=2).sum(axis=1)
        length = np.linalg.norm(sums, axis=1)
        areas = np.einsum("mij,mj->mi", normals, sums) / length[:, None]
        angles = np.arctan2(areas, (spokes[:, :-1] * spokes[:, 1:]).sum(axis=2))
        has_no_dent = (areas >= -_NO_DENT * sizes[:, None]).all(axis=1)
        is_simple = (angles.sum(axis=1) < 2 * np.pi) & (length > _NO_DENT * sizes)
        is_line = sizes <= _NO_AREA * (spokes**2).sum(axis=(1, 2))
        return np.asarray((has_no_dent & is_simple) | is_line | ~np.isfinite(sizes))


def _ears(points: Floats) -> list[tuple[int, int, int]]:
    """Return the n - 2 triangles of a polygon (n, 3); raise ValueError if it crosses itself."""
    offsets = points - points[0]
    normal = np.cross(offsets, np.roll(offsets, -1, axis=0)).sum(axis=0)
    # Seen along the axis nearest to the normal, counter-clockwise, as complex numbers.
    axis = int(np.abs(normal).argmax())
    plane = offsets[:, axis - 2] + 1j * np.sign(normal[axis]) * offsets[:, axis - 1]
    plane /= np.abs(plane).max()
    sides = _side(plane[:, None], np.roll(plane, -1)[:, None], plane)
    straddled = sides * np.roll(sides, -1, axis=1) < 0
    if (straddled & straddled.T).any() or (sides <= 0).all():
        raise ValueError("a face crosses itself; triangulate the faces on export")
    left, ears = list(range(len(plane))), []
    while len(left) > 2:
        b = plane[left]
        a, c = np.roll(b, 1), np.roll(b, -1)
        areas = _side(a, b, c)
        # Only these may lie in an ear.
        others = b[areas <= 0]
        blocked = np.ones((len(b), len(others)), dtype=bool)
        for start, end in ((a, b), (b, c), (c, a)):
            blocked &= _side(start[:, None], end[:, None], others) >= 0
            blocked &= others != start[:, None]
        areas[blocked.any(axis=1)] = -1.0
        i = int(areas.argmax())
        if areas[i] < 0:
            raise ValueError("a face overlaps itself; triangulate the faces on export")
        ears.append((left[i - 1], left[i], left[(i + 1) % len(left)]))
        del left[i]
    return ears


def _side(start: Any, end: Any, point: Any) -> Any:
    """Return twice the area of triangles, positive where `point` is left of the edge."""
    area = ((end - start).conjugate() * (point - start)).imag
    return np.where(np.abs(area) < _NO_AREA, 0.0, area)
