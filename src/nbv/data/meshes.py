"""Meshes of a run on disk, and how they are made from a source."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError
from nbv.files import damaged, read_arrays, write_arrays

if TYPE_CHECKING:
    from nbv.data.sources import MeshSource


# Of each array in a file: the kind of its numbers, and its shape, None for any length.
_FORMS: Mapping[str, tuple[str, tuple[int | None, ...]]] = {
    "ids": ("U", (None,)),
    "vertices": ("f", (None, 3)),
    "faces": ("i", (None, 3)),
    "vertex_offsets": ("i", (None,)),
    "face_offsets": ("i", (None,)),
}
_ROWS = {"vertex": "vertices", "face": "faces"}
# Single precision keeps a diagonal of 1 to far less.
_EXTENT_TOLERANCE = 1e-4


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
    """Return the ids in a file of `save_meshes`, in its order; errors as of `load_meshes`."""
    return list(load_meshes(path))


def load_meshes(path: str | Path) -> dict[str, Mesh]:
    """Return the meshes in a file of `save_meshes`, in its order.

    Raises
    ------
    UserError
        Where the file is damaged: an array is missing or of another form, an id is there twice, or
        a mesh has no faces, a face beyond its vertices or another size than one diagonal.
    """
    arrays = read_arrays(path)
    if wrong := _wrong(arrays):
        raise damaged(path, wrong)
    vertex_at, face_at = arrays["vertex_offsets"], arrays["face_offsets"]
    meshes: dict[str, Mesh] = {}
    for i, object_id in enumerate(arrays["ids"]):
        vertices = arrays["vertices"][vertex_at[i] : vertex_at[i + 1]]
        meshes[str(object_id)] = Mesh(vertices, arrays["faces"][face_at[i] : face_at[i + 1]])
        if not _is_sound(meshes[str(object_id)]):
            raise damaged(path, f"the mesh of {str(object_id)!a} is not sound")
    return meshes


def _wrong(arrays: Mapping[str, Any]) -> str:
    """Return what is wrong with the arrays of a file as a whole, or nothing."""
    for name, (kind, shape) in _FORMS.items():
        array = arrays.get(name)
        if array is None:
            return f"holds no array {name!r}"
        # A member whose first bytes are damaged comes as bytes.
        if not isinstance(array, np.ndarray):
            return f"array {name!r} is damaged"
        if array.dtype.kind != kind or array.ndim != len(shape) or array.shape[1:] != shape[1:]:
            return f"array {name!r} has another form"
    ids = arrays["ids"]
    if len(np.unique(ids)) != len(ids):
        return "an id is there twice"
    for name in ("vertex", "face"):
        offsets, rows = arrays[f"{name}_offsets"], len(arrays[_ROWS[name]])
        ends = (offsets[0], offsets[-1]) if len(offsets) == len(ids) + 1 else None
        if ends != (0, rows) or (np.diff(offsets) < 1).any():
            return f"array '{name}_offsets' does not fit the others"
    return ""


def _is_sound(mesh: Mesh) -> bool:
    vertices, faces = mesh
    if not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        return False
    # In double precision, for damage may have made a number whose square overflows.
    extent = np.ptp(vertices.astype(np.float64), axis=0)
    return abs(float(np.linalg.norm(extent)) - 1.0) < _EXTENT_TOLERANCE


logger = logging.getLogger(__name__)

_SECONDS_BETWEEN_LINES = 5.0


def prepare_meshes(source: MeshSource, category: str, object_ids: Sequence[str]) -> dict[str, Mesh]:
    """Load, check and normalise meshes.

    Parameters
    ----------
    source : MeshSource
    category : str
    object_ids : sequence of str

    Returns
    -------
    dict of str to Mesh
        In the order of `object_ids`.

    Raises
    ------
    UserError
        After all meshes are tried. It names the first bad one and the number of others; the log
        has an error for each.
    """
    prepared: dict[str, Mesh] = {}
    bad: list[str] = []
    start = last = time.monotonic()
    for done, object_id in enumerate(object_ids, 1):
        try:
            prepared[object_id] = as_mesh(source.load(category, object_id))
        except UserError as error:
            # The loop goes on, so that one run names every file to mend.
            logger.error("%s", error)
            bad.append(str(error))
        now = time.monotonic()
        if now - last >= _SECONDS_BETWEEN_LINES:
            last = now
            left = (now - start) / done * (len(object_ids) - done)
            logger.info("%s: mesh %d of %d, %.0f s left", category, done, len(object_ids), left)
    if bad:
        more = f" (and {len(bad) - 1} more, logged above)" if len(bad) > 1 else ""
        raise UserError(f"{bad[0]}{more}: mend the file or list its id in dataset.exclude")
    seconds = time.monotonic() - start
    logger.info("%s: %d meshes prepared in %.1f s", category, len(prepared), seconds)
    return prepared
