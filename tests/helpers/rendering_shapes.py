"""Meshes that several tests draw."""

from typing import NamedTuple

import numpy as np
import trimesh
from numpy.typing import NDArray

from nbv.data.meshes import normalise
from nbv.data.procedural import generate


class Shape(NamedTuple):
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def shape_of(mesh: trimesh.Trimesh, centre: str = "box") -> Shape:
    mesh = normalise(mesh, "+z", "+x", 0.0, centre)
    return Shape(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def procedural(category: str = "mug", index: int = 0) -> Shape:
    return shape_of(generate(category, seed=0, index=index), "origin")


def triangle_soup(seed: int, n_faces: int) -> Shape:
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (n_faces, 1, 3)) + rng.normal(0, 0.4, (n_faces, 3, 3))
    soup = trimesh.Trimesh(
        corners.reshape(-1, 3), np.arange(3 * n_faces).reshape(-1, 3), process=False
    )
    return shape_of(soup)


def rotated(shape: Shape, rotation_deg: float) -> Shape:
    angle = np.radians(rotation_deg)
    about_z = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    return Shape(shape.vertices @ about_z.T, shape.faces)
