"""The object frame: z up, front +x, unit bounding-box diagonal.

Data sets disagree about which way is up and which way is forward. The configuration names both as
axes of the file ("+y", "-z") or as vectors ("0,0,1"), and the rotation follows from them. It is
always proper: no mesh is ever mirrored.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError, nearest

if TYPE_CHECKING:
    import trimesh

Centre = Literal["box", "origin"]
CENTRES = ("box", "origin")
AXES = ("+x", "-x", "+y", "-y", "+z", "-z")

# Vectors may be rounded numbers; 0.02 is about one degree.
_PERPENDICULAR_WITHIN = 0.02

# In units of the file. Beyond them squares of lengths overflow or vanish in single precision, in
# which most formats keep their numbers: such a length is damage, not a size.
_EXTENTS = (1e-18, 1e18)
# In squares of the object's diagonal: below it an area is rounding.
_LEAST_AREA = 1e-12


def direction(axis: str, key: str) -> NDArray[np.float64]:
    """Return the unit vector of an axis of the file.

    Parameters
    ----------
    axis : str
        One of ±x, ±y, ±z (a missing sign is +), or three numbers with commas, as in "0,-1,0".
        Backslashes before the commas, which ShapeNetSem's metadata has, are ignored.
    key : str
        Name of the setting, for the error.

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


def frame_rotation(up: str, front: str, turn_deg: float) -> NDArray[np.float64]:
    """Return the rotation from a file's frame into the object frame.

    Parameters
    ----------
    up, front : str
        Axes of the file that become +z and, before the turn, +x; see `direction`.
    turn_deg : float
        Turn about +z after that, counter-clockwise: the final azimuth of `front`.

    Returns
    -------
    (3, 3) float
        Proper (determinant 1); it multiplies column vectors.

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
    turn = np.radians(turn_deg)
    cos, sin = np.cos(turn), np.sin(turn)
    about_z = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    rotation: NDArray[np.float64] = about_z @ np.stack([x, np.cross(z, x), z])
    return rotation


def check_mesh(mesh: trimesh.Trimesh, origin: str) -> None:
    """Check that a mesh can be rendered.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    origin : str
        Its place of origin, for the error.

    Raises
    ------
    UserError
        If it has no face, a face index out of range, a used vertex that is not finite, no extent
        or an absurd one, or no area.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    if len(faces) == 0:
        raise UserError(f"{origin}: the mesh has no faces; at least 1 triangle expected")
    lowest, highest = int(faces.min()), int(faces.max())
    if lowest < 0 or highest >= len(vertices):
        wrong = lowest if lowest < 0 else highest
        raise UserError(f"{origin}: a face refers to vertex {wrong}, of {len(vertices)} vertices")
    used = np.unique(faces)
    broken = used[~np.isfinite(vertices[used]).all(axis=1)]
    if len(broken):
        raise UserError(
            f"{origin}: vertex {broken[0]} is not finite, {len(broken)} of {len(used)} in all; "
            "numbers expected"
        )
    low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
    # Halved, for the difference of two finite numbers may not be finite.
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
    mesh: trimesh.Trimesh, up: str, front: str, turn_deg: float, centre: Centre
) -> trimesh.Trimesh:
    """Return a mesh in the object frame, with unit size.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        `check_mesh` accepts it.
    up, front, turn_deg
        See `frame_rotation`.
    centre : {"box", "origin"}
        The turning axis x = y = 0 passes through the middle of the bounding box, or through the
        file's own origin. The height is always centred on the box.

    Returns
    -------
    trimesh.Trimesh
        The faces, and the vertices that they use, in their old order. The diagonal of the
        axis-aligned bounding box has length 1.

    Raises
    ------
    UserError
        If an axis or `centre` is not valid.
    """
    import trimesh

    if centre not in CENTRES:
        raise UserError(f"centre={centre}: no such centre; {nearest(centre, CENTRES)}")
    used, faces = np.unique(np.asarray(mesh.faces), return_inverse=True)
    rotation = frame_rotation(up, front, turn_deg)
    # Without BLAS, whose kernels round differently: the same mesh everywhere.
    vertices = np.einsum("nj,ij->ni", np.asarray(mesh.vertices, dtype=np.float64)[used], rotation)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middle = (low + high) / 2.0
    if centre == "origin":
        middle[:2] = 0.0
    vertices = (vertices - middle) / math.hypot(*(high - low))
    return trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)
