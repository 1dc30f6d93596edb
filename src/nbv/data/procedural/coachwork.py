"""Parts of road vehicles: hull, cabin, wheels, bed walls and small fittings.

Lengths are in metres; the road is z = 0, the front is +x, and x = 0 is the middle.
"""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.assembly import both_sides, turned
from nbv.data.procedural.solids import Solids, box, revolve, stack_outlines, superellipse

Range = tuple[float, float]


def hull(
    rng: np.random.Generator,
    line: ArrayLike,
    half_width: float,
    clearance: float,
    axles: tuple[float, ...],
    wheel: float,
) -> trimesh.Trimesh:
    """Return the body below the windows, cut away over the wheels.

    Parameters
    ----------
    rng : numpy.random.Generator
        For the roundness of the ends.
    line : array_like
        (m, 2) of (x, height) along the upper edge, from the rear end at -x to the front at x.
    half_width, clearance : float
        Half the body's width, and its height above the road.
    axles : tuple of float
        Places of the wheels along x.
    wheel : float
        Radius of the wheels.
    """
    edge = np.asarray(line, dtype=np.float64)
    front = edge[-1, 0]
    # Sections crowd towards the ends, which are round.
    x = front * np.sin(np.linspace(-np.pi / 2, np.pi / 2, 61))
    top = np.interp(x, edge[:, 0], edge[:, 1])
    arch = sum(np.sqrt(np.clip((1.14 * wheel) ** 2 - (x - axle) ** 2, 0.0, None)) for axle in axles)
    bottom = np.maximum(clearance, np.where(arch > 0.0, wheel + arch, 0.0))
    bottom = np.minimum(bottom, top - 0.08)
    end = np.abs(x) / front
    width = half_width * (1.0 - rng.uniform(0.04, 0.2) * end ** rng.uniform(5.0, 12.0))
    draw = rng.uniform(0.1, 0.3, 2)[(x > 0).astype(int)] * end ** rng.uniform(14.0, 40.0)
    middle, half = (top + bottom) / 2, (top - bottom) / 2 * (1.0 - draw)
    oval = superellipse(1.0, 1.0, rng.uniform(4.0, 8.0), n=28)
    across = width[:, None] * oval[:, 0]
    up = middle[:, None] + half[:, None] * oval[:, 1]
    return stack_outlines(np.stack([across, up], axis=-1), x, axis="x")


def cabin(
    rng: np.random.Generator, feet: Range, tops: Range, heights: Range, half_width: float
) -> trimesh.Trimesh:
    """Return the part with the windows, from the belt line to the roof.

    Parameters
    ----------
    rng : numpy.random.Generator
        For the lean of the walls and the roundness of the edges.
    feet, tops : (float, float)
        Rear and front end along x, at the belt line and at the roof.
    heights : (float, float)
        Heights of belt line and roof.
    half_width : float
        Half the body's width.
    """
    level = np.array([-0.12, 0.0, 0.5, 0.86, 0.96, 1.0])
    lean = np.clip(level, 0.0, None)
    run = np.asarray(tops) - np.asarray(feet)
    ends = np.asarray(feet) + run * lean[:, None] ** rng.uniform(1.0, 1.35)
    inset = np.array([0.0, 0.0, 0.0, 0.0, 0.03, 0.12]) * rng.uniform(0.5, 1.5)
    ends += inset[:, None] * (1.0, -1.0)
    width = half_width * (0.97 - rng.uniform(0.08, 0.24) * lean) - inset
    unit = superellipse(1.0, 1.0, rng.uniform(4.0, 9.0), n=32)
    plan = unit * np.stack([(ends[:, 1] - ends[:, 0]) / 2, width], axis=-1)[:, None]
    plan[..., 0] += ends.mean(axis=1)[:, None]
    return stack_outlines(plan, heights[0] + (heights[1] - heights[0]) * level)


def wheels(axles: tuple[float, ...], wheel: float, side: float) -> Solids:
    """Return wheels with dished rims, their outer faces at y = ±`side`."""
    tread = 0.62 * wheel
    profile = np.array([
        [0.5 * wheel, -tread], [0.94 * wheel, -tread], [wheel, -0.85 * tread],
        [wheel, -0.15 * tread], [0.94 * wheel, 0.0], [0.66 * wheel, 0.0],
        [0.6 * wheel, -0.1 * tread], [0.25 * wheel, -0.06 * tread],
    ])  # fmt: skip
    return both_sides(
        revolve(profile, n=28, axis="y", centre=(axle, side, wheel)) for axle in axles
    )


def mirrors(rng: np.random.Generator, x: float, half_width: float, z: float) -> Solids:
    """Return the pair of wing mirrors."""
    size = rng.uniform(0.6, 1.2)
    centre = (x, half_width + 0.04, z)
    extents = (0.12 * size, 0.2 * size + 0.06, 0.14 * size)
    return both_sides([box(centre, extents, exponent=4.0, bevel=0.03)])


def bumper(rng: np.random.Generator, x: float, half_width: float, clearance: float) -> Solids:
    """Return a bar across one end."""
    bar = rng.uniform(0.14, 0.26)
    z = clearance + rng.uniform(0.1, 0.2) + bar / 2
    extents = (0.2, 1.75 * half_width, bar)
    return [box((0.985 * x, 0.0, z), extents, exponent=4.0, bevel=0.04)]


def spare_wheel(rng: np.random.Generator, x: float, z: float) -> trimesh.Trimesh:
    """Return a wheel facing along x."""
    size = rng.uniform(0.3, 0.38)
    profile = np.array([[0.6, -0.3], [1.0, -0.25], [1.0, 0.25], [0.6, 0.3]]) * size
    return revolve(profile, n=28, axis="x", centre=(x, 0.0, z))


def spoiler(x: float, z: float, half_width: float) -> Solids:
    """Return a wing across the car on two posts."""
    wing = box((x, 0.0, z), (0.26, 1.6 * half_width, 0.05), bevel=0.015)
    post = box((x, 0.5 * half_width, z - 0.15), (0.12, 0.06, 0.3), bevel=0.01)
    return [turned(wing, 6.0, "y", (x, 0.0, z)), *both_sides([post])]


def bed_walls(back: float, front: float, half_width: float, heights: Range) -> Solids:
    """Return the two sides and the tailgate of an open bed."""
    low, high = heights
    middle, level = (back + front) / 2, (low + high) / 2
    extents = (front - back, 0.08, high - low)
    side = box((middle, 0.93 * half_width, level), extents, bevel=0.02)
    gate = box((back + 0.06, 0.0, level), (0.08, 1.85 * half_width, high - low))
    return [*both_sides([side]), gate]
