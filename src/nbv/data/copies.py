"""Objects of a data set that are copies of others, however their surfaces are triangulated."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from nbv.data.meshes import Mesh

N_SAMPLES = 40_000
"""Points on each surface; two samples of one surface are 0.1 to 0.2 % of its diagonal apart."""
SAME_SIZE = 2e-3
"""Largest difference of extents between copies, in object diagonals."""
SAME_SURFACE = 1.3
"""Samples of two surfaces are at most so many times as far apart as two samples of one.

Six pairs of copies among other people's meshes have at most 1.04, the next pair 1.8."""


def find_copies(meshes: Mapping[str, Mesh]) -> dict[str, str]:
    """Return the objects whose surface is that of an earlier one, and which one that is."""
    names = list(meshes)
    corners = [mesh.vertices[mesh.faces].reshape(-1, 3) for mesh in meshes.values()]
    extents = np.array([np.ptp(each, axis=0) for each in corners])
    found: dict[str, str] = {}
    for later, name in enumerate(names):
        alike = np.abs(extents[:later] - extents[later]).max(axis=1, initial=0.0) < SAME_SIZE
        for earlier in np.flatnonzero(alike):
            other = names[earlier]
            if other not in found and _same_surface(meshes[other], meshes[name]):
                found[name] = other
                break
    return found


def _same_surface(one: Mesh, other: Mesh) -> bool:
    sample, again, of_other = (_sampled(*each) for each in ((one, 0), (one, 1), (other, 2)))
    return _apart(sample, of_other) < SAME_SURFACE * _apart(sample, again)


def _sampled(mesh: Mesh, seed: int) -> NDArray[np.float64]:
    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points, _ = trimesh.sample.sample_surface(surface, N_SAMPLES, seed=seed)
    return np.asarray(points, dtype=np.float64)


def _apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the mean distance to the nearest point of the other sample, both ways."""
    both = cKDTree(one).query(other)[0], cKDTree(other).query(one)[0]
    return float(sum(np.asarray(distances).mean() for distances in both))
