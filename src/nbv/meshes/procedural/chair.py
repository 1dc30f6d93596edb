"""Chairs: a base, a seat, a back and sometimes arms, each of several kinds.

Lengths are in metres; the sitter looks towards +x and the floor is z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from nbv.meshes.procedural.solids import (
    Points,
    both_sides,
    box,
    centred,
    fillet,
    join,
    loft,
    revolve,
    slab,
    superellipse,
    sweep,
    tube,
    turned,
)

Solids = list[trimesh.Trimesh]


@dataclass(frozen=True)
class _Seat:
    """Half extents of the seat, the height of its top, and its thickness."""

    half_depth: float
    half_width: float
    top: float
    thick: float

    @property
    def under(self) -> float:
        """The height of its lower face."""
        return self.top - self.thick


def chair(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a chair, its back towards -x."""
    kind = rng.choice(["dining", "office", "armchair", "stool", "tube"],
                      p=[0.45, 0.15, 0.15, 0.12, 0.13])  # fmt: skip
    if kind == "armchair":
        return centred(join(_armchair(rng)))
    stool = kind == "stool"
    seat = _Seat(
        rng.uniform(0.17, 0.24) * (0.85 if stool else 1.0),
        rng.uniform(0.18, 0.27) * (0.85 if stool else 1.0),
        rng.uniform(0.42, 0.5) * (rng.uniform(1.0, 1.55) if stool else 1.0),
        float(rng.choice([rng.uniform(0.025, 0.04), rng.uniform(0.06, 0.11)])),
    )
    round_seat = stool and rng.random() < 0.6
    exponent = 2.0 if round_seat else rng.uniform(3.0, 9.0)
    outline = superellipse(seat.half_depth, seat.half_width, exponent, n=40)
    taper = rng.uniform(-0.03, 0.18)
    outline[:, 1] *= 1.0 + taper * (outline[:, 0] / seat.half_depth - 1.0) / 2
    parts = [slab(outline, seat.under, seat.top, bevel=0.3 * seat.thick)]
    if kind == "office":
        parts += _star_base(rng, seat)
    elif kind == "tube":
        parts += _tube_base(rng, seat)
    elif stool and rng.random() < 0.3:
        parts += _pedestal(rng, seat)
    else:
        parts += _legs(rng, seat)
    parts += _back(rng, seat, kind)
    if not stool and rng.random() < (0.7 if kind == "office" else 0.3):
        parts += _arms(rng, seat)
    return centred(join(parts))


def _legs(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return four straight legs and, often, the stretchers between them."""
    thick = rng.uniform(0.013, 0.026)
    outline = superellipse(thick, thick, float(rng.choice([2.0, 8.0])), n=12)
    inset = 1.0 - 1.6 * thick / seat.half_width
    x, y = seat.half_depth * inset, seat.half_width * inset
    splay, rake = rng.uniform(0.0, 0.06, 2) * rng.choice([0.0, 1.0], 2)
    taper = rng.uniform(0.6, 1.0)
    heads = {end: np.array([end * x, 0.92 * y, seat.under + 0.005]) for end in (1, -1)}
    feet = {end: np.array([end * (x + rake), 0.92 * y + splay, 0.0]) for end in (1, -1)}
    parts = [
        sweep([heads[end], feet[end]], outline, (1.0, 0.0, 0.0), scale=[1.0, taper])
        for end in (1, -1)
    ]
    half = 0.6 * thick
    if rng.random() < 0.5:
        t = rng.uniform(0.25, 0.7)
        ends = [heads[end] + t * (feet[end] - heads[end]) for end in (1, -1)]
        parts += [tube(ends, half, n=8)]
    for end in (1, -1):
        if rng.random() < 0.35:
            t = rng.uniform(0.3, 0.75)
            tip = heads[end] + t * (feet[end] - heads[end])
            parts += [tube([tip, tip * (1.0, 0.0, 1.0)], half, n=8)]
    return both_sides(parts)


def _star_base(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return a column on a five-pointed star with castors, one point towards the front or back."""
    reach, hub = rng.uniform(0.24, 0.32), rng.uniform(0.09, 0.13)
    start = float(rng.choice([0.0, 180.0]))
    arm = tube([(0.02, 0.0, hub), (reach, 0.0, 0.075)], 0.022, taper=0.6)
    wheel = revolve([[0.02, -0.022], [0.03, -0.018], [0.03, 0.018], [0.02, 0.022]], n=16, axis="y",
                    centre=(reach, 0.0, 0.03))  # fmt: skip
    fork = tube([(reach, 0.0, 0.03), (reach, 0.0, 0.085)], 0.012, n=8)
    parts = [turned(part, start + 72.0 * k, "z") for k in range(5) for part in (arm, wheel, fork)]
    column = [[0.035, hub - 0.03], [0.035, hub + 0.06], [0.02, hub + 0.07], [0.02, seat.under]]
    plate = box((0.0, 0.0, seat.under - 0.02), (0.9 * seat.half_depth, 0.7 * seat.half_width, 0.045))
    return [*parts, revolve(column, n=16), plate]


def _pedestal(rng: np.random.Generator, seat: _Seat) -> Solids:
    foot, column = rng.uniform(0.16, 0.22), rng.uniform(0.02, 0.04)
    profile = [[foot, 0.0], [foot, 0.015], [1.5 * column, 0.05], [column, 0.12],
               [column, seat.under - 0.04], [3 * column, seat.under + 0.002]]  # fmt: skip
    return [revolve(profile, n=32)]


def _tube_base(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return a sled or a cantilever frame of bent tube."""
    radius, y = rng.uniform(0.009, 0.015), 0.9 * seat.half_width
    front, back = 0.95 * seat.half_depth, -seat.half_depth * rng.uniform(0.85, 1.15)
    top, lean = seat.under - 0.002, rng.uniform(0.0, 0.08)
    cantilever = rng.random() < 0.5
    corners = [(0.5 * back, y, top), (front, y, top), (front + lean, y, radius)]
    corners += [(back, y, radius)]
    corners += [(back, 0.0, radius)] if cantilever else [(0.8 * back, y, top)]
    if not cantilever:
        return both_sides([tube(fillet(corners, 0.09), radius)])
    side = tube(fillet(corners[:4], 0.09), radius)
    bar = tube([corners[3], np.array(corners[3]) * (1, -1, 1)], radius)
    return [*both_sides([side]), bar]


def _arc(half_width: float, bulge: float, x: float, z: float, n: int = 13) -> Points:
    """Return a level path from +y to -y whose middle lies `bulge` further back than its ends."""
    y = np.linspace(half_width, -half_width, n)
    return np.stack([x - bulge * (1 - (y / half_width) ** 2), y, np.full(n, z)], axis=-1)


def _rail(path: Points, height: float, thick: float, exponent: float = 6.0) -> trimesh.Trimesh:
    """Return a board standing on edge along a level path."""
    return sweep(path, superellipse(height / 2, thick / 2, exponent, n=16), (0.0, 0.0, 1.0))


def _back(rng: np.random.Generator, seat: _Seat, kind: str) -> Solids:
    """Return the back, reclined about the seat's rear edge."""
    x, half = -seat.half_depth + 0.01, seat.half_width * rng.uniform(0.8, 1.0)
    height = rng.uniform(0.1, 0.26) if kind == "stool" else rng.uniform(0.32, 0.62)
    bulge, thick = rng.uniform(0.0, 0.06), rng.uniform(0.012, 0.03)
    gap = float(rng.choice([0.0, rng.uniform(0.06, 0.2)])) * min(1.0, 2.5 * height)
    post = rng.uniform(0.009, 0.02)
    style = rng.choice(["panel", "ladder", "spindles", "hoop", "cross"],
                       p=[0.7, 0.3, 0.0, 0.0, 0.0] if kind in ("office", "stool", "tube")
                       else [0.32, 0.23, 0.2, 0.13, 0.12])  # fmt: skip
    high, low = seat.top + height, seat.top + gap
    posts = both_sides([tube([(x, 0.95 * half, seat.under), (x, 0.95 * half, high - 0.01)], post)])
    if style == "panel":
        pad = float(rng.choice([1.0, 2.2])) * thick
        board = _rail(_arc(half, bulge, x, (low + high) / 2), high - low, pad, rng.uniform(3, 9))
        if kind == "office" and rng.random() < 0.7:
            spine = box((x - bulge, 0.0, (seat.under + high) / 2 - 0.08),
                        (0.03, 0.08, high - seat.under - 0.16), exponent=4.0)  # fmt: skip
            link = box((x / 2, 0.0, seat.under - 0.01), (-x + 0.03, 0.08, 0.025))
            parts = [board, spine, link]
        else:
            parts = [board, *posts]
    elif style == "ladder":
        n = 1 if kind == "stool" else int(rng.integers(2, 6))
        size = min(rng.uniform(0.035, 0.09), 0.7 * height / n)
        levels = np.linspace(high - size / 2, seat.top + 0.25 * height, n) if n > 1 else [high - size / 2]
        parts = [_rail(_arc(0.95 * half, bulge, x, z), size, thick) for z in levels] + posts
    elif style == "hoop":
        corners = [(x, 0.9 * half, seat.top - 0.01), (x, half, high), (x, -half, high),
                   (x, -0.9 * half, seat.top - 0.01)]  # fmt: skip
        parts = [tube(fillet(corners, 0.2, n=9), post * 1.2)]
        places = np.linspace(-0.6, 0.6, int(rng.integers(3, 8))) * half
        parts += [tube([(x, y, seat.top - 0.01), (x, y, high - 0.02)], 0.6 * post, n=8)
                  for y in places]  # fmt: skip
    else:
        size = rng.uniform(0.04, 0.1)
        parts = [_rail(_arc(0.95 * half, bulge, x, high - size / 2), size, thick), *posts]
        foot = seat.top + gap
        parts += [_rail(_arc(0.95 * half, bulge, x, foot + 0.02), 0.035, thick)]
        if style == "cross":
            bar = [(x - 0.6 * bulge, 0.9 * half, high - size), (x - 0.6 * bulge, -0.9 * half, foot)]
            parts += both_sides([tube(bar, 0.8 * post, n=8)])
        else:
            flat = superellipse(rng.uniform(0.007, 0.02), 0.008, 4.0, n=12)
            for y in np.linspace(-0.8, 0.8, int(rng.integers(3, 8))) * half:
                depth = x - bulge * (1 - (y / (0.95 * half)) ** 2)
                parts += [sweep([(depth, y, foot), (depth, y, high - size / 2)], flat, (0, 1, 0))]
    recline = -rng.uniform(1.0, 16.0)
    return [turned(part, recline, "y", (x, 0.0, seat.top - seat.thick / 2)) for part in parts]


def _arms(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return arm rests on one post each, or on a loop of tube."""
    z, y = seat.top + rng.uniform(0.17, 0.25), seat.half_width + rng.uniform(0.0, 0.04)
    front, back = seat.half_depth * rng.uniform(0.3, 0.9), -seat.half_depth * rng.uniform(0.8, 1.1)
    rest = box(((front + back) / 2, y, z), (front - back, rng.uniform(0.03, 0.07), 0.025),
               exponent=4.0, bevel=0.008)  # fmt: skip
    under = seat.under + 0.3 * seat.thick
    if rng.random() < 0.5:
        post = front * rng.uniform(0.1, 0.9)
        support = [tube([(post, y - 0.02, under), (post, y, z)], 0.014)]
        support += [tube([(post, y - 0.02, under), (post, 0.6 * y, under)], 0.014)]
    else:
        corners = [(front - 0.03, y - 0.02, under), (front - 0.03, y, z - 0.005),
                   (back + 0.05, y, z - 0.005), (back + 0.05, y - 0.02, under)]  # fmt: skip
        support = [tube(fillet(corners, 0.05), 0.012)]
    return both_sides([rest, *support])


def _armchair(rng: np.random.Generator) -> Solids:
    """Return an upholstered chair: blocks for seat, back and arms, or a tub around the seat."""
    half_depth, half_width = rng.uniform(0.26, 0.38), rng.uniform(0.28, 0.4)
    foot, seat = rng.uniform(0.05, 0.16), rng.uniform(0.36, 0.44)
    back, arm = seat + rng.uniform(0.3, 0.5), seat + rng.uniform(0.12, 0.24)
    thick, bevel = rng.uniform(0.09, 0.16), rng.uniform(0.02, 0.05)
    parts = [box((0.0, 0.0, (foot + seat) / 2), (2 * half_depth, 1.9 * half_width, seat - foot),
                 exponent=rng.uniform(5.0, 9.0), bevel=bevel)]  # fmt: skip
    if rng.random() < 0.3:
        sweep_deg = rng.uniform(95.0, 125.0)
        angle = np.radians(np.linspace(180.0 - sweep_deg, 180.0 + sweep_deg, 33))
        path = np.stack([half_depth * np.cos(angle), half_width * np.sin(angle),
                         np.full(33, foot)], axis=-1)  # fmt: skip
        crest = arm - foot + (back - arm) * np.clip(-np.cos(angle), 0.0, 1.0) ** rng.uniform(1, 3)
        wall = superellipse(0.5, 0.5, 6.0, n=24)
        out = np.stack([np.cos(angle), np.sin(angle), np.zeros(33)], axis=-1)
        rings = path[:, None] + wall[None, :, :1] * thick * out[:, None]
        rings = rings + (wall[None, :, 1:] + 0.5) * crest[:, None, None] * (0.0, 0.0, 1.0)
        parts += [loft(rings)]
    else:
        parts += both_sides([
            box((0.0, half_width - thick / 3, (foot + arm) / 2),
                (2 * half_depth, thick, arm - foot), bevel=bevel)
        ])  # fmt: skip
        rest = box((-half_depth + thick / 2, 0.0, (foot + back) / 2),
                   (1.3 * thick, 2 * half_width - rng.uniform(0.0, 0.8) * thick, back - foot),
                   bevel=bevel)  # fmt: skip
        parts += [turned(rest, -rng.uniform(2.0, 14.0), "y", (-half_depth, 0.0, foot))]
        if rng.random() < 0.6:
            parts += [box((0.06, 0.0, seat + 0.04), (1.7 * half_depth, 1.55 * half_width, 0.12),
                          exponent=5.0, bevel=0.035)]  # fmt: skip
    x, y = 0.8 * half_depth, 0.8 * half_width
    legs = [tube([(end * x, y, foot + 0.01), (end * x, y, 0.0)], 0.024, taper=0.7)
            for end in (1, -1)]  # fmt: skip
    return parts + both_sides(legs)
