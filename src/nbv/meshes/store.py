"""One file for the normalised meshes of a category, without pickle."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.files import damaged, read_arrays, readable, write_arrays


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
    """Return the ids in a file of `save_meshes`, in its order, without loading the meshes.

    Raises
    ------
    UserError
        As of `nbv.files.readable`.
    """
    with readable(path), np.load(path, allow_pickle=False) as stored:
        return [str(object_id) for object_id in stored["ids"]]


def load_meshes(path: str | Path) -> dict[str, Mesh]:
    """Return the meshes in a file of `save_meshes`, in its order.

    Raises
    ------
    UserError
        Where the file cannot be read, or a mesh in it is no mesh.
    """
    arrays = read_arrays(path, ("ids", "vertices", "faces", "vertex_offsets", "face_offsets"))
    meshes: dict[str, Mesh] = {}
    with readable(path):
        ids = [str(object_id) for object_id in arrays["ids"]]
        parts = {
            name: [*pairwise(map(int, arrays[f"{name}_offsets"]))] for name in ("vertex", "face")
        }
        for object_id, of_vertices, of_faces in zip(
            ids, parts["vertex"], parts["face"], strict=True
        ):
            mesh = Mesh(arrays["vertices"][slice(*of_vertices)], arrays["faces"][slice(*of_faces)])
            if not _is_sound(mesh):
                raise damaged(path, f"the mesh of object {object_id!r} is not sound")
            meshes[object_id] = mesh
        if len(meshes) != len(ids):
            raise damaged(path, "two objects have the same id")
    return meshes


def _is_sound(mesh: Mesh) -> bool:
    vertices, faces = mesh
    return bool(
        vertices.shape[1:] == faces.shape[1:] == (3,)
        and len(faces)
        and np.isfinite(vertices).all()
        and faces.min() >= 0
        and faces.max() < len(vertices)
    )
