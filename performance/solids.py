"""Objects of the embedded data set with a stated number of faces."""

from __future__ import annotations

import numpy as np
import trimesh

from nbv.data.meshes import normalise
from nbv.data.procedural import generate


def object_with_faces(category: str, n_faces: int, index: int = 0) -> trimesh.Trimesh:
    """Return a normalised object with `n_faces` faces, or up to two fewer.

    Where the generated object has more, neighbouring vertices are merged until it has not; then
    its largest faces are divided in four until the number is reached. Its outline stays what it
    was, but for the merging.
    """
    mesh = generate(category, 0, index)
    cell = 1e-3 * mesh.scale
    coarse = mesh
    while len(coarse.faces) > n_faces:
        coarse = _merged(mesh, cell)
        cell *= 1.15
    while n_faces - len(coarse.faces) >= 3:
        coarse = _divided(coarse, (n_faces - len(coarse.faces)) // 3)
    return normalise(coarse, "+z", "+x", 0.0, "box")


def _merged(mesh: trimesh.Trimesh, cell: float) -> trimesh.Trimesh:
    """Return the mesh with all vertices of a cubic cell moved to one of them."""
    cells = np.round(mesh.vertices / cell).astype(np.int64)
    _, first, cell_of = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    faces = cell_of.reshape(-1)[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return trimesh.Trimesh(mesh.vertices[first], faces, process=False)


def _divided(mesh: trimesh.Trimesh, n_divided: int) -> trimesh.Trimesh:
    largest = np.argsort(-mesh.area_faces, kind="stable")[:n_divided]
    divided: trimesh.Trimesh = mesh.subdivide(face_index=largest)
    return divided
