"""Moving and joining solids; no function changes its arguments."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.solids import FROM_Z, Axis


def mirrored(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return the solid reflected in the plane y = 0, with outward faces."""
    vertices = np.asarray(solid.vertices) * (1.0, -1.0, 1.0)
    return trimesh.Trimesh(vertices, np.asarray(solid.faces)[:, ::-1], process=False)


def both_sides(solids: Iterable[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """Return the solids followed by their reflections in the plane y = 0."""
    one_side = list(solids)
    return one_side + [mirrored(solid) for solid in one_side]


def moved(solid: trimesh.Trimesh, offset: ArrayLike) -> trimesh.Trimesh:
    """Return the solid shifted by `offset`, (3,)."""
    vertices = np.asarray(solid.vertices) + np.asarray(offset, dtype=np.float64)
    return trimesh.Trimesh(vertices, solid.faces, process=False)


def turned(
    solid: trimesh.Trimesh, angle_deg: float, axis: Axis, centre: ArrayLike = (0.0, 0.0, 0.0)
) -> trimesh.Trimesh:
    """Return the solid turned about an axis through `centre`, counter-clockwise."""
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
