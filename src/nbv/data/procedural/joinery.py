"""Bases of chairs: legs, stars, pedestals, bent tubes, side panels, rockers.

Lengths are in metres; the sitter faces +x and the floor is z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nbv.data.procedural.assembly import both_sides, mirrored, turned
from nbv.data.procedural.solids import (
    Points,
    Solids,
    box,
    fillet,
    revolve,
    superellipse,
    sweep,
    tube,
)


@dataclass(frozen=True)
class Seat:
    """Half extents of the seat, the height of its upper face, and its thickness."""

    half_depth: float
    half_width: float
    top: float
    thick: float

    @property
    def under(self) -> float:
        """The height of its lower face."""
        return self.top - self.thick


def base(rng: np.random.Generator, kind: str, seat: Seat) -> Solids:
    """Return the base of a chair of a kind."""
    if kind == "office":
        return _star(rng, seat)
    if kind == "tube":
        return _bent_tube(rng, seat)
    if kind in ("stool", "shell") and rng.random() < 0.3:
        return _pedestal(rng, seat)
    form = rng.choice(["legs", "crossed", "panels"], p=[0.84, 0.09, 0.07])
    if form == "crossed":
        return _crossed_legs(rng, seat)
    return _panels(rng, seat) if form == "panels" else _legs(rng, seat)


def _legs(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return four straight legs and, often, stretchers or rockers between them."""
    thick = rng.uniform(0.011, 0.03)
    outline = superellipse(thick, thick, float(rng.choice([2.0, 8.0])), n=12)
    inset = 1.0 - 1.6 * thick / seat.half_width
    x, y = seat.half_depth * inset * rng.uniform(0.75, 1.0), 0.92 * seat.half_width * inset
    splay, rake = rng.uniform(0.0, 0.08, 2) * rng.choice([0.0, 1.0], 2)
    rockers = rng.random() < 0.08
    ends = (1, -1)
    heads = {end: np.array([end * x, y, seat.under + 0.005]) for end in ends}
    feet = {end: np.array([end * (x + rake), y + splay, 0.04 * rockers]) for end in ends}
    scale = [1.0, rng.uniform(0.5, 1.0)]
    parts = [sweep([heads[end], feet[end]], outline, (1.0, 0.0, 0.0), scale=scale) for end in ends]

    def point(end: int, t: float) -> Points:
        return np.asarray(heads[end] + t * (feet[end] - heads[end]))

    if rng.random() < 0.45:
        t = rng.uniform(0.25, 0.75)
        parts += [tube([point(end, t) for end in ends], 0.6 * thick, n=8)]
    for end in ends:
        if rng.random() < 0.3:
            tip = point(end, rng.uniform(0.3, 0.8))
            parts += [tube([tip, tip * (1.0, 0.0, 1.0)], 0.6 * thick, n=8)]
    if rockers:
        along = np.linspace(-1.0, 1.0, 17)
        reach = x + rake + rng.uniform(0.08, 0.2)
        curve = [along * reach - 0.04, np.full(17, y + splay), 0.02 + 0.1 * along**2]
        parts += [sweep(np.stack(curve, axis=-1), outline, (0.0, 1.0, 0.0))]
    return both_sides(parts)


def _crossed_legs(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return a folding chair's two crossed pairs, one slightly inside the other."""
    radius, lean = rng.uniform(0.01, 0.016), rng.uniform(0.85, 1.15) * seat.half_depth
    y = 0.92 * seat.half_width
    head = seat.under + 0.005
    outer = tube([(-0.8 * lean, y, head), (lean, y, 0.0)], radius)
    inner = tube([(0.8 * lean, y - 3 * radius, head), (-lean, y - 3 * radius, 0.0)], radius)
    bar = tube([(0.9 * lean, y, 0.05), (0.9 * lean, 0.0, 0.05)], 0.8 * radius, n=8)
    return both_sides([outer, inner, bar])


def _panels(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return solid sides."""
    thick, depth = rng.uniform(0.02, 0.05), rng.uniform(1.4, 2.1) * seat.half_depth
    centre = (0.0, 0.95 * seat.half_width - thick / 2, seat.under / 2 + 0.002)
    return both_sides([box(centre, (depth, thick, seat.under), exponent=20.0)])


def _star(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return a column on a star with castors, one point of it straight ahead or behind."""
    reach, hub = rng.uniform(0.22, 0.34), rng.uniform(0.09, 0.13)
    points, start = int(rng.choice([4, 5, 5])), float(rng.choice([0.0, 180.0]))
    arm = tube([(0.02, 0.0, hub), (reach, 0.0, 0.075)], 0.022, taper=0.6)
    disc = [[0.02, -0.022], [0.03, -0.018], [0.03, 0.018], [0.02, 0.022]]
    wheel = revolve(disc, n=16, axis="y", centre=(reach, 0.0, 0.03))
    fork = tube([(reach, 0.0, 0.03), (reach, 0.0, 0.085)], 0.012, n=8)
    star = [
        turned(part, start + 360.0 / points * k, "z")
        for k in range(points)
        for part in (arm, wheel, fork)
    ]
    column = [[0.035, hub - 0.03], [0.035, hub + 0.06], [0.02, hub + 0.07], [0.02, seat.under]]
    plate = (0.9 * seat.half_depth, 0.7 * seat.half_width, 0.045)
    return [*star, revolve(column, n=16), box((0.0, 0.0, seat.under - 0.02), plate)]


def _pedestal(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return a round foot and a column."""
    foot, column = rng.uniform(0.16, 0.24), rng.uniform(0.02, 0.05)
    profile = [[foot, 0.0], [foot, 0.015], [1.5 * column, 0.05], [column, 0.12],
               [column, seat.under - 0.04], [3 * column, seat.under + 0.002]]  # fmt: skip
    return [revolve(profile, n=32)]


def _bent_tube(rng: np.random.Generator, seat: Seat) -> Solids:
    """Return a sled or a cantilever frame."""
    radius, y = rng.uniform(0.009, 0.016), 0.9 * seat.half_width
    front, back = 0.95 * seat.half_depth, -seat.half_depth * rng.uniform(0.8, 1.2)
    top, lean = seat.under - 0.002, rng.uniform(-0.04, 0.08)
    corners = [(0.5 * back, y, top), (front, y, top), (front + lean, y, radius), (back, y, radius)]
    if rng.random() < 0.5:
        corners += [(0.8 * back, y, top)]
        return both_sides([tube(fillet(corners, 0.09), radius)])
    side = tube(fillet(corners, 0.09), radius)
    bar = tube([(back, y, radius), (back, -y, radius)], radius)
    return [side, mirrored(side), bar]
