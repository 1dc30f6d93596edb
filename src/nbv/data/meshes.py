"""Meshes: the object frame, into which they are normalised, and their file.

The object frame has z up, front +x, and a unit diagonal of the bounding box. Data sets disagree
about the directions of up and front, so the configuration names both as axes of the file ("+y",
"-z") or as vectors ("0,0,1"). The rotation that follows from them is proper: no mesh is mirrored.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError
from nbv.files import damaged, read_arrays, write_arrays

if TYPE_CHECKING:
    import trimesh

Centre = Literal["box", "origin"]
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")

# Vectors may be rounded; 0.02 is about one degree.
_PERPENDICULAR_WITHIN = 0.02

# Limits of a mesh's size in units of the file. Beyond them, squares of lengths overflow or vanish
# in single precision, the precision of most formats, so the file must be damaged.
_EXTENTS = (1e-18, 1e18)
# In squares of the object's diagonal: a smaller area is rounding.
_LEAST_AREA = 1e-12


def direction(axis: str, key: str) -> NDArray[np.float64]:
    """Return the unit vector of an axis of the file, the value of the setting `key`.

    It is one of ±x, ±y, ±z (a missing sign is +), or three numbers such as "0,-1,0". Backslashes
    before the commas, which occur in ShapeNetSem's metadata, are ignored.

    Raises
    ------
    UserError
        If the text is neither.
    """
    text = axis.strip().replace("\\", "").lower()
    signed = text if text[:1] in ("+", "-") else f"+{text}"
    if signed in AXES:
        vector = np.zeros(3)
        vector["xyz".index(signed[1])] = 1.0 if signed[0] == "+" else -1.0
        return vector
    try:
        vector = np.array([float(part) for part in text.split(",")])
    except ValueError:
        vector = np.zeros(0)
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not np.isfinite(length) or length == 0:
        raise UserError(f"{key}={axis}: not an axis; give one of {', '.join(AXES)}, or x,y,z")
    return vector / length


def frame_rotation(up: str, front: str, azimuth_deg: float) -> NDArray[np.float64]:
    """Return the rotation (3, 3) from a file's frame into the object frame, for column vectors.

    `up` and `front` are axes of the file (`direction`), which become +z and, at azimuth 0, +x.
    `azimuth_deg` is that of `front` in the object frame, counter-clockwise about +z. The rotation
    is proper (determinant 1).

    Raises
    ------
    UserError
        If up and front are not perpendicular.
    """
    z = direction(up, "up")
    x = direction(front, "front")
    if abs(float(x @ z)) > _PERPENDICULAR_WITHIN:
        raise UserError(f"up={up}, front={front}: the two must be perpendicular")
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    azimuth = np.radians(azimuth_deg)
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    about_z = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation: NDArray[np.float64] = about_z @ np.stack([x, np.cross(z, x), z])
    return rotation


def check_mesh(mesh: trimesh.Trimesh, origin: str) -> None:
    """Check that a mesh with valid indices can be rendered; `origin` is its source, for the error.

    Raises
    ------
    UserError
        If it has no face, a used vertex that is not finite, an implausible extent, or no area.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if len(faces) == 0:
        raise UserError(f"{origin}: the mesh has no faces; at least 1 triangle expected")
    used = np.unique(faces)
    broken = used[~np.isfinite(vertices[used]).all(axis=1)]
    if len(broken):
        raise UserError(
            f"{origin}: vertex {broken[0]} is not finite, {len(broken)} of {len(used)} in all; "
            "numbers expected"
        )
    low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
    # Halved, because the difference of two finite numbers may overflow.
    extent = 2.0 * math.hypot(*(high / 2.0 - low / 2.0))
    if extent == 0.0:
        raise UserError(f"{origin}: all faces lie in one point; a non-zero extent expected")
    if not _EXTENTS[0] <= extent <= _EXTENTS[1]:
        farthest = used[np.abs(vertices[used]).max(axis=1).argmax()]
        raise UserError(
            f"{origin}: the mesh extends over {extent:.3g}, vertex {farthest} is the farthest; "
            f"{_EXTENTS[0]:g} to {_EXTENTS[1]:g} expected"
        )
    corners = (vertices[faces] - low) / extent
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if float(np.linalg.norm(normals, axis=1).sum()) / 2.0 < _LEAST_AREA:
        raise UserError(f"{origin}: the faces have no area; a surface expected")


def normalise(
    mesh: trimesh.Trimesh, up: str, front: str, azimuth_deg: float, centre: Centre
) -> trimesh.Trimesh:
    """Return a mesh that passes `check_mesh` in the object frame, with a unit diagonal.

    It has the faces and the vertices that they use, in the same order. Axes, azimuth and errors are
    those of `frame_rotation`. The vertical axis x = y = 0 passes through the middle of the bounding
    box, or for the centre ``origin`` through the file's origin. The height is always centred on the
    box.
    """
    import trimesh

    used, faces = np.unique(np.asarray(mesh.faces), return_inverse=True)
    rotation = frame_rotation(up, front, azimuth_deg)
    # The rounding of BLAS depends on the machine.
    vertices = np.einsum("nj,ij->ni", np.asarray(mesh.vertices, dtype=np.float64)[used], rotation)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2.0
    if centre == "origin":
        middle[:2] = 0.0
    vertices = (vertices - middle) / math.hypot(*(high - low))
    return trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)


# The kind and shape of each array in a file; None is any length.
_FORMS: Mapping[str, tuple[str, tuple[int | None, ...]]] = {
    "ids": ("U", (None,)),
    "vertices": ("f", (None, 3)),
    "faces": ("i", (None, 3)),
    "vertex_offsets": ("i", (None,)),
    "face_offsets": ("i", (None,)),
}
_ROWS = {"vertex": "vertices", "face": "faces"}
# Far above the rounding of single precision.
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
    """A normalised triangle mesh in the types of the file.

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
    """Convert a mesh to the types of the file."""
    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float32).reshape(-1, 3)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int32).reshape(-1, 3)
    return Mesh(vertices, faces)


def save_meshes(path: str | Path, meshes: Mapping[str, Surface]) -> None:
    """Write meshes to an `.npz`; the same meshes give the same bytes.

    Its arrays are `ids` (n,) str; the concatenated `vertices` float32 and `faces` int32, whose
    indices are relative to their own mesh; and `vertex_offsets` and `face_offsets` (n + 1,) int64:
    mesh i has the rows offsets[i] to offsets[i + 1].
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


def load_meshes(path: str | Path) -> dict[str, Mesh]:
    """Read the meshes of `save_meshes`.

    Raises
    ------
    UserError
        If the file is damaged: an array is missing or malformed, an id is duplicate, or a mesh has
        no faces, an invalid index, or a diagonal other than 1.
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
    """Return why a file's arrays are invalid, or an empty text."""
    for name, (kind, shape) in _FORMS.items():
        array = arrays.get(name)
        if array is None:
            return f"holds no array {name!r}"
        # numpy returns bytes if the first bytes of a member are damaged.
        if not isinstance(array, np.ndarray):
            return f"array {name!r} is damaged"
        if array.dtype.kind != kind or array.ndim != len(shape) or array.shape[1:] != shape[1:]:
            return f"array {name!r} has another form"
    ids = arrays["ids"]
    if len(np.unique(ids)) != len(ids):
        return "an id is duplicate"
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
    # In double precision, because the square of a damaged number may overflow.
    extent = np.ptp(vertices.astype(np.float64), axis=0)
    return abs(float(np.linalg.norm(extent)) - 1.0) < _EXTENT_TOLERANCE
