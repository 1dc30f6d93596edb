"""Solids whose symmetry is known exactly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from nbv.core.orientations.group import Symmetry

if TYPE_CHECKING:
    import trimesh

_POLYHEDRA: Final[Mapping[str, tuple[Literal["T", "O", "I"], tuple[float, ...]]]] = {
    "tetrahedron": ("T", (1.0, 1.0, 1.0)),
    "cube": ("O", (1.0, 1.0, 1.0)),
    "icosahedron": ("I", (0.0, 1.0, (1 + 5**0.5) / 2)),
}
# Solids with a continuous symmetry about z, and their discrete symmetries.
_ROUND: Final = {"cone": np.eye(3)[None], "cylinder": np.stack([np.eye(3), np.diag([1.0, -1, -1])])}

SOLIDS: Final = (*_POLYHEDRA, *_ROUND)


def solid(name: str) -> tuple[trimesh.Trimesh, Symmetry]:
    """Return one of `SOLIDS` and the group of its rotations.

    A polyhedron is the convex hull of a vertex under all rotations of its group.
    """
    import trimesh
    from scipy.spatial.transform import Rotation

    if name in _ROUND:
        mesh = getattr(trimesh.creation, name)(radius=0.5, height=1.0, sections=128)
        return mesh, Symmetry(_ROUND[name], np.array([0.0, 0.0, 1.0]))
    group, vertex = _POLYHEDRA[name]
    rotations = Rotation.create_group(group)
    # The identity is the first element of a symmetry.
    rotations = rotations[rotations.magnitude().argsort()]
    return trimesh.convex.convex_hull(rotations.apply(vertex)), Symmetry(rotations.as_matrix())
