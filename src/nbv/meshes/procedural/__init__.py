"""Generated objects of five categories: the data set without a download.

An object is a pure function of (seed, category, index). Its frame is the object frame: z up,
front +x, turning axis x = y = 0, a mug's handle at azimuth 270 degrees. Its scale is arbitrary.
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


def generate(category: str, seed: int, index: int, *, handle_reach: float = 0.0) -> trimesh.Trimesh:
    """Return object number `index` of a category.

    Parameters
    ----------
    category : str
        A key of :data:`CATEGORIES`.
    seed : int
        Seed of the whole data set, >= 0.
    index : int
        Number of the object, >= 0. An object does not depend on other objects or their order.
    handle_reach : float
        Least reach of a mug's handle, in widths of the body, 0 to 0.5
        (`nbv.meshes.procedural.mug.handle_reach`). Other categories do not heed it.

    Returns
    -------
    trimesh.Trimesh
        A concatenation of watertight parts with outward faces, 1,000 to 20,000 faces in all.

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
    # crc32, not hash(): Python's hash of a string differs between processes.
    rng = np.random.default_rng([seed, zlib.crc32(category.encode()), index])
    if category == "mug":
        return mug.mug(rng, handle_reach)
    return CATEGORIES[category](rng)
