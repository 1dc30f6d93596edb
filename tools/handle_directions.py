"""Print where the handles of a run's mugs are: handle_directions.py results/<run>/meshes/mug.npz.

Of each mug, the azimuth of what stands out of its body, less the 270 degrees of a handle; nothing
where no single part stands out.
"""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import NDArray

from nbv.core.angles import signed_difference_deg
from nbv.data.meshes import Mesh, load_meshes

N_POINTS, N_SLICES, N_DIRECTIONS, LEAST_POINTS = 40_000, 12, 36, 200
# Distances from the body's axis, in its radii: a wall is nearer, and a handle farther.
WALL, HANDLE = 1.1, 1.12

Points = NDArray[np.float64]


def outside(points: Points) -> Points:
    """Return what lies outside the body in a slice (n, 2), from its axis, in radii."""
    centre = np.array([(points[:, 0].min() + points[:, 0].max()) / 2, 0.0])
    direction = np.radians((np.arange(N_DIRECTIONS) + 0.5) * 360 / N_DIRECTIONS)
    for _ in range(3):
        x, y = (points - centre).T
        place = (np.degrees(np.arctan2(y, x)) % 360 * N_DIRECTIONS / 360).astype(int)
        outline = np.full(N_DIRECTIONS, -np.inf)
        np.maximum.at(outline, place, np.hypot(x, y))
        is_wall = np.isfinite(outline)
        is_wall &= outline < WALL * np.median(outline[is_wall])
        columns = [np.cos(direction), np.sin(direction), np.ones(N_DIRECTIONS)]
        (right, up, radius), *_ = np.linalg.lstsq(
            np.stack(columns, axis=1)[is_wall], outline[is_wall], rcond=None
        )
        centre += right, up
    away = (points - centre) / radius
    return away[np.hypot(*away.T) > HANDLE]


def handle_deg(mesh: Mesh) -> float:
    """Return where a mug's handle is, degrees from where it should be; NaN where there is none."""
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points, _ = trimesh.sample.sample_surface(surface, N_POINTS, seed=0)
    height = points[:, 2]
    edges = np.linspace(*np.quantile(height, (0.02, 0.98)), N_SLICES + 1)
    slices = [points[(low <= height) & (height < high), :2] for low, high in pairwise(edges)]
    found = np.concatenate([outside(each) for each in slices if len(each) >= LEAST_POINTS])
    x, y = found.sum(axis=0)
    # Several parts, such as the corners of a square body, cancel each other.
    is_single = np.hypot(x, y) >= len(found)
    azimuth_deg = np.degrees(np.arctan2(y, x))
    return float(signed_difference_deg(azimuth_deg, 270.0)) if is_single else np.nan


def main() -> None:
    """Print a table of all mugs of a file of meshes."""
    lines = ["object_id,handle_deg"]
    for object_id, mesh in sorted(load_meshes(sys.argv[1]).items()):
        found = handle_deg(mesh)
        lines.append(f"{object_id}," + ("" if np.isnan(found) else f"{found:.1f}"))
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
