"""One file for the normalised meshes of a category, without pickle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.files import read_arrays, write_arrays


class Surface(Protocol):
    """A triangle mesh: `Mesh` or `trimesh.Trimesh`."""

    @property
    def vertices(self) -> ArrayLike:
        """Coordinates, (n, 3) float."""

    @property
    def faces(self) -> ArrayLike:
        """Indices of vertices, (m, 3) int."""


class Mesh(NamedTuple):
    """A triangle mesh in the types of the file.

    Attributes
    ----------
    vertices : (n, 3) float32
        Object frame, in object diagonals.
    faces : (m, 3) int32
        Indices into `vertices`.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]


def as_mesh(surface: Surface) -> Mesh:
    """Return a mesh in the types of the file."""
    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float32).reshape(-1, 3)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int32).reshape(-1, 3)
    return Mesh(vertices, faces)


def save_meshes(path: str | Path, meshes: Mapping[str, Surface]) -> None:
    """Write meshes to an `.npz`; the same meshes make the same bytes.

    Its arrays are `ids` (n,) str, `vertices` (sum of n, 3) float32 and `faces` (sum of m, 3) int32
    one mesh after the other, faces counting from their own mesh's first vertex, and
    `vertex_offsets`, `face_offsets` (n + 1,) int64: mesh i takes rows offsets[i] to offsets[i + 1].
    """
    stored = [as_mesh(mesh) for mesh in meshes.values()]
    vertex_counts = [len(mesh.vertices) for mesh in stored]
    face_counts = [len(mesh.faces) for mesh in stored]
    arrays = {
        "ids": np.array(list(meshes), dtype=np.str_),
        "vertices": np.concatenate([mesh.vertices for mesh in stored]),
        "faces": np.concatenate([mesh.faces for mesh in stored]),
        "vertex_offsets": np.concatenate([[0], np.cumsum(vertex_counts)]).astype(np.int64),
        "face_offsets": np.concatenate([[0], np.cumsum(face_counts)]).astype(np.int64),
    }
    write_arrays(path, arrays)


def stored_ids(path: str | Path) -> list[str]:
    """Return the ids in a file of `save_meshes`, in its order, without loading the meshes."""
    with np.load(path, allow_pickle=False) as stored:
        return [str(object_id) for object_id in stored["ids"]]


def load_meshes(path: str | Path) -> dict[str, Mesh]:
    """Return the meshes in a file of `save_meshes`, in its order."""
    arrays = read_arrays(path)
    vertex_at, face_at = arrays["vertex_offsets"], arrays["face_offsets"]
    meshes: dict[str, Mesh] = {}
    for i, object_id in enumerate(arrays["ids"]):
        vertices = arrays["vertices"][vertex_at[i] : vertex_at[i + 1]]
        meshes[str(object_id)] = Mesh(vertices, arrays["faces"][face_at[i] : face_at[i + 1]])
    return meshes
