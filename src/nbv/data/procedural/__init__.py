"""Procedural objects of five categories: a data set without a download.

An object is a pure function of seed, category, index and, for mugs, the least reach of handles and
the share of square bodies. Its frame is the object frame: z up, front +x, vertical axis x = y = 0,
a mug's handle at azimuth 270 degrees. Its scale is arbitrary.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
import trimesh

from nbv.data.procedural import airplane, car, chair, mug, toilet

__all__ = ["CATEGORIES", "generate"]

CATEGORIES: dict[str, Callable[[np.random.Generator], trimesh.Trimesh]] = {
    "airplane": airplane.airplane,
    "car": car.car,
    "chair": chair.chair,
    "mug": mug.mug,
    "toilet": toilet.toilet,
}


def generate(
    category: str, seed: int, index: int, *, least_reach: float = 0.0, square_share: float = 0.0
) -> trimesh.Trimesh:
    """Return object number `index` of a category.

    Parameters
    ----------
    seed : int
        Seed of the whole data set, >= 0.
    least_reach : float
        Least reach of a mug's handle, in widths of the body, 0 to 0.5
        (`nbv.data.procedural.mug.handle_reach`); ignored for other categories. About every eighth
        mug has a reach of 0.5; a larger one would need many draws.
    square_share : float
        The probability that a mug has a square body, 0 to 1; ignored for other categories.

    Returns
    -------
    trimesh.Trimesh
        A concatenation of watertight parts with outward faces, 1,000 to 20,000 faces in all.
    """
    # crc32, not hash(): Python's hash of a string differs between processes.
    rng = np.random.default_rng([seed, zlib.crc32(category.encode()), index])
    if category == "mug":
        return mug.mug(rng, least_reach, square_share)
    return CATEGORIES[category](rng)
