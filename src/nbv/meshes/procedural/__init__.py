"""The data set that needs no download: five categories of generated objects.

An object is a pure function of (seed, category, index). Its frame is the project's: z up,
front +x, turning axis x = y = 0, and a mug's handle at azimuth 270 degrees. Scale is free.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
import trimesh

from nbv.errors import UserError, nearest
from nbv.meshes.procedural import airplane, car, chair, mug, toilet

__all__ = ["CATEGORIES", "generate"]

CATEGORIES: dict[str, Callable[[np.random.Generator], trimesh.Trimesh]] = {
    "airplane": airplane.airplane,
    "car": car.car,
    "chair": chair.chair,
    "mug": mug.mug,
    "toilet": toilet.toilet,
}


def generate(category: str, seed: int, index: int) -> trimesh.Trimesh:
    """Return object number `index` of a category.

    Parameters
    ----------
    category : str
        A key of :data:`CATEGORIES`.
    seed : int
        Of the whole data set, >= 0.
    index : int
        Of the object, >= 0. Objects do not depend on how many others are generated, or when.

    Returns
    -------
    trimesh.Trimesh
        A concatenation of watertight parts with outward faces, 1,000 to 20,000 of them in all.

    Raises
    ------
    UserError
        If the category is unknown, or seed or index is negative.
    """
    if category not in CATEGORIES:
        message = f"no procedural category {category!r}: {nearest(category, CATEGORIES)}"
        raise UserError(message)
    if seed < 0 or index < 0:
        message = f"procedural {category}: seed {seed} and index {index} must not be negative"
        raise UserError(message)
    # crc32, not hash(): Python's hash of a string differs from one process to the next.
    rng = np.random.default_rng([seed, zlib.crc32(category.encode()), index])
    return CATEGORIES[category](rng)
