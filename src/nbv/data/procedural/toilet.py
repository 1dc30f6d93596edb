"""Toilets: a bowl on a foot, a seat and lid, and a cistern behind, above or in the wall.

Lengths are in metres; the sitter faces +x and the floor is z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from nbv.data.procedural.solids import (
    Points,
    Solids,
    both_sides,
    box,
    centred,
    fillet,
    join,
    loft,
    revolve,
    rotated,
    slab,
    stack_outlines,
    superellipse,
    tube,
)

_POINTS = 56
_KINDS = {"two-piece": 0.42, "one-piece": 0.2, "high cistern": 0.11, "no cistern": 0.11,
          "wall-hung": 0.11, "chest": 0.05}  # fmt: skip


@dataclass(frozen=True)
class _Bowl:
    """Rear and front end, half width and squareness of the rim's outline, and the rim's height."""

    back: float
    front: float
    half_width: float
    square: float
    rim: float

    def outline(self, grow: float = 0.0) -> Points:
        """Return the rim, (n, 2), grown outwards by `grow`: blunt behind, oval in front."""
        half = (self.front - self.back) / 2
        shape = superellipse(half + grow, self.half_width + grow, self.square, n=_POINTS)
        behind = superellipse(half + grow, self.half_width + grow, self.square + 2.5, n=_POINTS)
        middle = np.array([(self.front + self.back) / 2, 0.0])
        return middle + np.where(shape[:, :1] < 0.0, behind, shape)


def toilet(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a toilet, the front of its bowl towards +x."""
    long = rng.uniform(0.36, 0.56)
    bowl = _Bowl(
        -long / 2,
        long / 2,
        rng.uniform(0.16, 0.21),
        float(rng.choice([rng.uniform(1.9, 2.4), rng.uniform(3.0, 6.0)], p=[0.65, 0.35])),
        rng.uniform(0.34, 0.46),
    )
    kind = str(rng.choice(list(_KINDS), p=list(_KINDS.values())))
    parts = _seat(rng, bowl, has_cistern=kind not in ("no cistern", "chest"))
    parts += _chest(rng, bowl) if kind == "chest" else _pedestal(rng, bowl, kind)
    parts += _cistern(rng, bowl, kind)
    if rng.random() < 0.08:
        parts += _grab_rails(rng, bowl)
    return centred(join(parts))


def _pedestal(rng: np.random.Generator, bowl: _Bowl, kind: str) -> Solids:
    """Return the bowl, its foot and the block behind it."""
    skirted = rng.random() < 0.3
    t = np.linspace(0.0, 1.0, 17)
    if skirted:
        waist, flare = rng.uniform(0.75, 0.95), 0.0
        swell = t ** rng.uniform(1.2, 2.6)
    else:
        waist, flare = rng.uniform(0.42, 0.68), rng.uniform(0.05, 0.3)
        swell = np.clip((t - 0.25) / 0.75, 0.0, 1.0) ** rng.uniform(0.55, 1.0)
    foot = flare * np.clip(1.0 - t / 0.25, 0.0, 1.0) ** 1.5
    scale = (waist + (1.0 - waist) * swell) * (1.0 + foot)
    # The foot of a bowl that narrows downwards lies towards the back, under the sitter.
    shift = (bowl.back - bowl.front) * rng.uniform(0.05, 0.16) * (1.0 - swell)
    outside = scale[:, None, None] * bowl.outline(-0.008)
    outside[..., 0] += shift[:, None]
    # A wall-hung bowl ends in the air.
    base = rng.uniform(0.1, 0.2) if kind == "wall-hung" else 0.0
    # One skin: up the outside, over the rim, and down into the hollow, as in a mug.
    thick = rng.uniform(0.03, 0.05)
    depth = min(rng.uniform(0.12, 0.2), 0.6 * (bowl.rim - base))
    inner = bowl.outline(-rng.uniform(0.035, 0.05))
    up = base + (bowl.rim - thick - base) * t
    down = bowl.rim - np.array([0.6 * thick, 0.0, 0.0, 0.5 * depth, depth, depth + 0.005])
    # The hollow stays within the outside, which may draw in and back faster.
    room = np.minimum([0.85, 0.45, 0.2], 0.75 * np.interp(down[3:], up, scale))
    hollow = room[:, None, None] * inner
    hollow[..., 0] += np.interp(down[3:], up, shift)[:, None]
    inside = np.concatenate([[bowl.outline(), bowl.outline(), inner], hollow])
    levels = np.concatenate([up, down])
    parts = [stack_outlines(np.concatenate([outside, inside]), levels)]
    if kind in ("two-piece", "one-piece") or (kind != "wall-hung" and rng.random() < 0.5):
        low = rng.choice([0.0, rng.uniform(0.1, 0.25)])
        width = 2 * bowl.half_width * rng.uniform(0.5, 0.9)
        parts += [box((bowl.back - 0.04, 0.0, (low + bowl.rim) / 2),
                      (0.28, width, bowl.rim - low), exponent=5.0, bevel=0.02)]  # fmt: skip
    return parts


def _seat(rng: np.random.Generator, bowl: _Bowl, *, has_cistern: bool) -> Solids:
    """Return seat and lid: both down, the lid up, or both up."""
    thick, grow = rng.uniform(0.015, 0.028), rng.uniform(0.0, 0.014)
    z, hinge = bowl.rim + 0.004, bowl.back + 0.035
    outer, inner = bowl.outline(grow), bowl.outline(-rng.uniform(0.05, 0.065))
    outer, inner = np.maximum(outer, (hinge, -1.0)), np.maximum(inner, (hinge + 0.05, -1.0))
    levels = (z, z + thick, z + thick, z)
    rings = np.stack([np.column_stack([ring, np.full(_POINTS, level)]) for ring, level in
                      zip((outer, outer, inner, inner), levels, strict=True)])  # fmt: skip
    seat = loft(rings, closed=True)
    lid = slab(outer, z + thick + 0.003, z + 2 * thick, bevel=0.006)
    pivot = (hinge, 0.0, z + thick)
    up = -rng.uniform(92.0, 104.0)
    # Without a cistern, an open lid shows that this is a toilet.
    shares = [0.45, 0.3, 0.1, 0.15] if has_cistern else [0.2, 0.5, 0.2, 0.1]
    state = rng.choice(["down", "lid up", "both up", "none"], p=shares)
    pins = both_sides([tube([(hinge, 0.05, z + thick / 2), (hinge, 0.1, z + thick / 2)], 0.014)])
    if state == "none":
        return [seat, *pins]
    if state == "both up":
        seat = rotated(seat, up + 3.0, "y", pivot)
    if state != "down":
        lid = rotated(lid, up, "y", pivot)
    return [seat, lid, *pins]


def _flush(rng: np.random.Generator, front: float, half_width: float, top: float) -> Solids:
    """Return a lever on the cistern's front or a button on its lid."""
    if rng.random() < 0.5:
        return [revolve([[0.028, -0.01], [0.028, 0.006], [0.022, 0.012]], n=20,
                        centre=(front - 0.09, 0.0, top))]  # fmt: skip
    y, z = half_width * rng.uniform(0.5, 0.75), top - 0.085
    axle = tube([(front - 0.02, y, z), (front + 0.018, y, z)], 0.012)
    lever = tube([(front + 0.016, y + 0.01, z), (front + 0.016, y - 0.07, z - 0.012)], 0.009)
    return [axle, lever]


def _tank(
    rng: np.random.Generator, front: float, low: float, high: float, half_width: float
) -> Solids:
    """Return a cistern, its lid overhanging, and the flush."""
    depth, exponent = rng.uniform(0.15, 0.21), rng.uniform(3.5, 9.0)
    unit = superellipse(1.0, 1.0, exponent, n=32)
    draw = rng.uniform(0.78, 1.0)
    t = np.array([0.0, 0.06, 0.5, 1.0])
    size = (draw + (1.0 - draw) * t) * np.array([0.93, 1.0, 1.0, 1.0])
    outlines = size[:, None, None] * unit * (depth / 2, half_width)
    outlines[..., 0] += front - size[:, None] * depth / 2
    over = rng.uniform(0.003, 0.015)
    lid = unit * (depth / 2 + over, half_width + over) + (front - depth / 2, 0.0)
    thick = rng.uniform(0.02, 0.04)
    return [
        stack_outlines(outlines, low + (high - low) * t),
        slab(lid, high - 0.002, high + thick, bevel=0.4 * thick),
        *_flush(rng, front, half_width, high + thick),
    ]


def _cistern(rng: np.random.Generator, bowl: _Bowl, kind: str) -> Solids:
    """Return the cistern, or the wall that hides it."""
    front, rim = bowl.back + rng.uniform(-0.05, 0.02), bowl.rim
    if kind == "two-piece":
        low = rim + rng.uniform(-0.01, 0.03)
        return _tank(rng, front, low, low + rng.uniform(0.2, 0.42), rng.uniform(0.15, 0.26))
    if kind == "one-piece":
        low = rng.choice([0.0, 0.7 * rim])
        return _tank(rng, front, low, rim + rng.uniform(0.1, 0.38), rng.uniform(0.16, 0.2))
    if kind == "wall-hung":
        wall = (0.12, rng.uniform(0.4, 0.6), rng.uniform(0.6, 1.1))
        centre = (bowl.back - 0.04, 0.0, wall[2] / 2)
        button = box((bowl.back + 0.02, 0.0, 0.9 * wall[2]), (0.03, 0.2, 0.07), bevel=0.01)
        return [box(centre, wall, exponent=20.0), button]
    if kind == "high cistern":
        return _high_cistern(rng, bowl)
    return []


def _high_cistern(rng: np.random.Generator, bowl: _Bowl) -> Solids:
    """Return a cistern on the wall and its flush pipe."""
    low, half_width = bowl.rim + rng.uniform(0.2, 0.8), rng.uniform(0.16, 0.25)
    wall = bowl.back - rng.uniform(0.08, 0.14)
    x, z = wall + 0.07, bowl.rim - 0.1
    pipe = fillet([(x, 0.0, low + 0.02), (x, 0.0, z), (bowl.back + 0.05, 0.0, z)], 0.08, n=7)
    tank = _tank(rng, wall + 0.17, low, low + rng.uniform(0.2, 0.32), half_width)
    return [*tank, tube(pipe, rng.uniform(0.018, 0.026))]


def _chest(rng: np.random.Generator, bowl: _Bowl) -> Solids:
    """Return the box of a camping toilet or of an old earth closet, around the bowl's rim."""
    x, y = (bowl.front - bowl.back) / 2 + 0.02, bowl.half_width + rng.uniform(0.02, 0.12)
    back = rng.uniform(0.0, 0.14)
    outline = superellipse(x + back / 2, y, rng.uniform(4.0, 12.0), n=_POINTS) - (back / 2, 0.0)
    inner = bowl.outline(-0.05)
    deep = 0.6 * bowl.rim
    base = outline * rng.uniform(0.85, 1.0)
    outlines = [base, outline, outline, inner, 0.8 * inner]
    parts = [stack_outlines(outlines, [0.0, 0.3 * bowl.rim, bowl.rim, bowl.rim, deep])]
    if back > 0.08:
        ledge = (back - 0.02, 1.8 * y, rng.uniform(0.05, 0.5))
        parts += [box((bowl.back - 0.02 - back / 2, 0.0, bowl.rim + ledge[2] / 2 - 0.002), ledge,
                      bevel=0.01)]  # fmt: skip
    return parts


def _grab_rails(rng: np.random.Generator, bowl: _Bowl) -> Solids:
    """Return a rail on either side, from the wall to a foot on the floor."""
    y, z = bowl.half_width + rng.uniform(0.08, 0.15), bowl.rim + rng.uniform(0.15, 0.28)
    back, front = bowl.back - 0.1, bowl.back + rng.uniform(0.5, 0.95) * (bowl.front - bowl.back)
    corners = [(back, y, z), (front, y, z), (front, y, 0.0)]
    return both_sides([tube(fillet(corners, 0.08, n=7), rng.uniform(0.012, 0.02))])
