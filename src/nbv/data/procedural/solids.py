"""Closed solids from rings of points, and their transforms and unions.

Every solid is a watertight :class:`trimesh.Trimesh` with outward faces, made by :func:`loft`, which
joins a stack of rings with equal numbers of points. No function changes its arguments.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]
Axis = Literal["x", "y", "z"]
Solids = list[trimesh.Trimesh]

# Cyclic permutations keep a right-handed frame right-handed.
FROM_Z: dict[str, list[int]] = {"x": [2, 0, 1], "y": [1, 2, 0], "z": [0, 1, 2]}


def loft(rings: ArrayLike, *, closed: bool = False) -> trimesh.Trimesh:
    """Join m consecutive rings of k points, (m, k, 3), by a skin.

    Point j of one ring is joined to point j of the next. If `closed`, the last ring is joined to
    the first, as in a torus. Otherwise a fan about the ring's centroid closes each end, so end
    rings must be star-shaped from there. The mesh is watertight, of positive volume.
    """
    stack = np.asarray(rings, dtype=np.float64)
    m, k, _ = stack.shape
    index = np.arange(m * k).reshape(m, k)
    near = index if closed else index[:-1]
    far = np.roll(index, -1, axis=0) if closed else index[1:]
    near_next, far_next = np.roll(near, -1, axis=1), np.roll(far, -1, axis=1)
    faces = [np.stack([near, near_next, far_next], -1), np.stack([near, far_next, far], -1)]
    vertices = stack.reshape(-1, 3)
    if not closed:
        first, last = index[0], index[-1]
        hub = np.full(k, m * k)
        faces += [np.stack([hub, np.roll(first, -1), first], -1)]
        faces += [np.stack([hub + 1, last, np.roll(last, -1)], -1)]
        vertices = np.concatenate([vertices, stack[[0, -1]].mean(axis=1)])
    return _outward(vertices, np.concatenate([part.reshape(-1, 3) for part in faces]))


def _outward(vertices: Points, faces: NDArray[np.intp]) -> trimesh.Trimesh:
    """Flip all faces if the enclosed volume is negative."""
    corners = vertices[faces]
    six_volumes = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return trimesh.Trimesh(vertices, faces if six_volumes > 0 else faces[:, ::-1], process=False)


def superellipse(
    half_width: float, half_height: float, exponent: float = 2.0, n: int = 24
) -> Points:
    """Return an oval (n, 2) with two semi-axes > 0, counter-clockwise.

    The exponent 2 is an ellipse, 4 to 8 a rectangle with rounded corners. A number of points that
    is a multiple of 4 keeps both mirror symmetries.
    """
    angle = 2 * np.pi * np.arange(n) / n
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    rounded = np.sign(unit) * np.abs(unit) ** (2.0 / exponent)
    return np.asarray(np.where(np.abs(unit) < 1e-12, 0.0, rounded) * (half_width, half_height))


def stack_outlines(outlines: ArrayLike, heights: ArrayLike, axis: Axis = "z") -> trimesh.Trimesh:
    """Loft plane outlines (m, k, 2), or one (k, 2), placed at heights (m,) along an axis.

    In-plane coordinates are (x, y) for axis z, (y, z) for axis x and (z, x) for axis y. Heights are
    strictly monotonic where neighbouring outlines are equal.
    """
    level = np.asarray(heights, dtype=np.float64)
    outline = np.asarray(outlines, dtype=np.float64)
    outline = np.broadcast_to(outline, (len(level), *outline.shape[-2:]))
    rings = np.concatenate(
        [outline, np.broadcast_to(level[:, None, None], (*outline.shape[:2], 1))], axis=-1
    )
    return loft(rings[..., FROM_Z[axis]])


def slab(outline: ArrayLike, low: float, high: float, *, bevel: float = 0.0) -> trimesh.Trimesh:
    """Return an upright prism over an outline (k, 2) that is star-shaped from its centroid.

    `bevel` is the depth of its bevelled edges; the end outlines shrink by about as much.
    """
    flat = np.asarray(outline, dtype=np.float64)
    if bevel <= 0.0:
        return stack_outlines(flat, [low, high])
    centre = flat.mean(axis=0)
    shrink = 1.0 - bevel / np.abs(flat - centre).max(axis=0)
    small = centre + (flat - centre) * np.clip(shrink, 0.3, 1.0)
    return stack_outlines([small, flat, flat, small], [low, low + bevel, high - bevel, high])


def box(
    centre: ArrayLike, extents: ArrayLike, *, exponent: float = 8.0, bevel: float = 0.0
) -> trimesh.Trimesh:
    """Return an upright box with rounded vertical edges; centre and extents are (3,) each.

    `exponent` is the roundness in plan (:func:`superellipse`), `bevel` that of :func:`slab`.
    """
    x, y, z = np.asarray(centre, dtype=np.float64)
    width, depth, height = np.asarray(extents, dtype=np.float64)
    outline = superellipse(width / 2, depth / 2, exponent, n=40) + np.array([x, y])
    return slab(outline, z - height / 2, z + height / 2, bevel=bevel)


def revolve(
    profile: ArrayLike, *, n: int = 32, axis: Axis = "z", centre: ArrayLike = (0.0, 0.0, 0.0)
) -> trimesh.Trimesh:
    """Return a solid of revolution about an axis, with n points around.

    The profile (m, 2) is (radius > 0, height along the axis); discs close both ends. `centre` (3,)
    is the point of height 0 on the axis.
    """
    curve = np.asarray(profile, dtype=np.float64)
    outlines = curve[:, :1, None] * superellipse(1.0, 1.0, n=n)
    solid = stack_outlines(outlines, curve[:, 1], axis)
    solid.vertices += np.asarray(centre, dtype=np.float64)
    return solid


def fillet(corners: ArrayLike, radius: float, n: int = 5) -> Points:
    """Round the inner corners of a polyline (m, 3) by quadratic Bézier arcs of n points.

    Neighbouring corners are distinct. `radius` is the distance from a corner to the start of its
    arc, at most 0.45 of the shorter adjoining edge. The result is (2 + n (m - 2), 3), the ends
    unmoved.
    """
    points = np.asarray(corners, dtype=np.float64)
    edges = np.diff(points, axis=0)
    lengths = np.linalg.norm(edges, axis=1, keepdims=True)
    reach = np.minimum(radius, 0.45 * np.minimum(lengths[:-1], lengths[1:]))
    begin = points[1:-1] - edges[:-1] / lengths[:-1] * reach
    end = points[1:-1] + edges[1:] / lengths[1:] * reach
    t = np.linspace(0.0, 1.0, n)[:, None, None]
    arcs = (1 - t) ** 2 * begin + 2 * t * (1 - t) * points[1:-1] + t**2 * end
    return np.concatenate([points[:1], arcs.swapaxes(0, 1).reshape(-1, 3), points[-1:]])


def sweep(
    path: ArrayLike, outline: ArrayLike, normal: ArrayLike, *, scale: ArrayLike = 1.0
) -> trimesh.Trimesh:
    """Carry an outline (k, 2) along a path (m, 3) of distinct neighbours, and close its ends.

    The outline's first coordinate is along `normal` (3,), nowhere parallel to the path, the second
    across both. `scale`, a number or (m,), is the outline's size along the path.
    """
    points, flat = np.asarray(path, dtype=np.float64), np.asarray(outline, dtype=np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    # A ring lies in the plane that bisects its two edges, so straight runs keep their thickness.
    tangents = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    upright = np.asarray(normal, dtype=np.float64)
    first = upright - tangents * (tangents * upright).sum(axis=1, keepdims=True)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangents, first)
    size = np.broadcast_to(np.asarray(scale, dtype=np.float64), len(points))[:, None, None]
    across = flat[None, :, :1] * first[:, None] + flat[None, :, 1:] * second[:, None]
    return loft(points[:, None] + size * across)


def tube(path: ArrayLike, radius: float, *, n: int = 12, taper: float = 1.0) -> trimesh.Trimesh:
    """Return a closed round tube along a path (m, 3) that bends in one plane or not at all.

    It has n points around. `radius` is that at the start, `taper` the end's divided by it.
    """
    points = np.asarray(path, dtype=np.float64)
    # From the edges by hand: for a straight path a decomposition would return a normal that depends
    # on the rounding of the linear algebra library.
    edges = np.diff(points, axis=0)
    bends = np.cross(edges[:1], edges)
    sharpest = bends[np.argmax(np.abs(bends).max(axis=1))]
    straight = np.abs(sharpest).max() < 1e-9 * np.abs(edges).max() ** 2
    upright = np.abs(edges[0, 2]) > np.abs(edges[0, :2]).max()
    across = np.cross(edges[0], (1.0, 0.0, 0.0) if upright else (0.0, 0.0, 1.0))
    normal = across if straight else sharpest
    scale = np.linspace(1.0, taper, len(points))
    return sweep(points, superellipse(radius, radius, n=n), normal, scale=scale)


def mirrored(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the solid reflected in the plane y = 0, with outward faces."""
    vertices = np.asarray(solid.vertices) * (1.0, -1.0, 1.0)
    return trimesh.Trimesh(vertices, np.asarray(solid.faces)[:, ::-1], process=False)


def both_sides(solids: Iterable[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Return the solids followed by their reflections in the plane y = 0."""
    originals = list(solids)
    return originals + [mirrored(solid) for solid in originals]


def moved(solid: trimesh.Trimesh, offset: ArrayLike) -> trimesh.Trimesh:
    """Return the solid shifted by `offset`, (3,)."""
    vertices = np.asarray(solid.vertices) + np.asarray(offset, dtype=np.float64)
    return trimesh.Trimesh(vertices, solid.faces, process=False)


def rotated(
    solid: trimesh.Trimesh, angle_deg: float, axis: Axis, centre: ArrayLike = (0.0, 0.0, 0.0)
) -> trimesh.Trimesh:
    """Return the solid rotated about an axis through `centre`, counter-clockwise."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rotation = about_z[np.ix_(FROM_Z[axis], FROM_Z[axis])]
    pivot = np.asarray(centre, dtype=np.float64)
    arm = np.asarray(solid.vertices) - pivot
    vertices = np.einsum("nj,ij->ni", arm, rotation) + pivot
    return trimesh.Trimesh(vertices, solid.faces, process=False)


def join(solids: Iterable[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Return the solids as one mesh; they may touch or pass through one another."""
    parts = list(solids)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return trimesh.Trimesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
        process=False,
    )


def centred(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the solid with its bounding box centred on the z axis, its lower face at z = 0."""
    low, high = np.asarray(solid.bounds)
    return moved(solid, [-(low[0] + high[0]) / 2, -(low[1] + high[1]) / 2, -low[2]])
