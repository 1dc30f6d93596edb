"""Chairs: dining, office and tube chairs, stools, shells and armchairs, with their bases.

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
    mirrored,
    revolve,
    rotated,
    slab,
    superellipse,
    sweep,
    tube,
)

_KINDS = {"dining": 0.38, "office": 0.12, "armchair": 0.18, "stool": 0.12, "tube": 0.1,
          "shell": 0.1}  # fmt: skip


@dataclass(frozen=True)
class _Seat:
    """Half extents of the seat, the height of its upper face, and its thickness."""

    half_depth: float
    half_width: float
    top: float
    thick: float

    @property
    def under(self) -> float:
        """The height of its lower face."""
        return self.top - self.thick


def chair(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a chair, its back towards -x; only a rare writing tablet breaks the symmetry in y."""
    kind = str(rng.choice(list(_KINDS), p=list(_KINDS.values())))
    if kind == "armchair":
        return centred(join(_armchair(rng)))
    stool = kind == "stool"
    small = 0.85 if stool else 1.0
    seat = _Seat(
        small * rng.uniform(0.17, 0.29),
        small * rng.uniform(0.17, 0.32),
        rng.uniform(0.36, 0.5) * (rng.uniform(1.0, 1.6) if stool else 1.0),
        float(rng.choice([rng.uniform(0.025, 0.04), rng.uniform(0.06, 0.13)])),
    )
    if kind == "shell":
        return centred(join([_shell(rng, seat), *_base(rng, kind, seat)]))
    parts = [_seat(rng, seat, disc=stool and rng.random() < 0.6), *_base(rng, kind, seat)]
    parts += _back(rng, seat, kind)
    if not stool and rng.random() < (0.6 if kind == "office" else 0.33):
        parts += _arms(rng, seat)
    return centred(join(parts))


def _seat(rng: np.random.Generator, seat: _Seat, *, disc: bool) -> trimesh.Trimesh:
    exponent = 2.0 if disc else rng.uniform(2.6, 9.0)
    outline = superellipse(seat.half_depth, seat.half_width, exponent, n=40)
    outline[:, 1] *= 1.0 + rng.uniform(-0.05, 0.2) * (outline[:, 0] / seat.half_depth - 1.0) / 2
    return slab(outline, seat.under, seat.top, bevel=0.3 * seat.thick)


def _shell(rng: np.random.Generator, seat: _Seat) -> trimesh.Trimesh:
    """Return seat and back bent from one piece."""
    thick, height = rng.uniform(0.012, 0.04), rng.uniform(0.25, 0.7)
    back = -seat.half_depth - height * np.tan(np.radians(rng.uniform(2.0, 35.0)))
    z = seat.under + thick / 2
    corners = [
        (seat.half_depth, 0.0, z),
        (-seat.half_depth, 0.0, z - 0.01),
        (back, 0.0, z + height),
    ]
    path = fillet(corners, rng.uniform(0.08, 0.2), n=23)
    outline = superellipse(seat.half_width, thick / 2, 5.0, n=32)
    return sweep(path, outline, (0.0, 1.0, 0.0), scale=np.linspace(1.0, rng.uniform(0.6, 1.1), 25))


def _base(rng: np.random.Generator, kind: str, seat: _Seat) -> Solids:
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


def _legs(rng: np.random.Generator, seat: _Seat) -> Solids:
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


def _crossed_legs(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return a folding chair's two crossed pairs, one slightly inside the other."""
    radius, lean = rng.uniform(0.01, 0.016), rng.uniform(0.85, 1.15) * seat.half_depth
    y = 0.92 * seat.half_width
    head = seat.under + 0.005
    outer = tube([(-0.8 * lean, y, head), (lean, y, 0.0)], radius)
    inner = tube([(0.8 * lean, y - 3 * radius, head), (-lean, y - 3 * radius, 0.0)], radius)
    bar = tube([(0.9 * lean, y, 0.05), (0.9 * lean, 0.0, 0.05)], 0.8 * radius, n=8)
    return both_sides([outer, inner, bar])


def _panels(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return solid sides."""
    thick, depth = rng.uniform(0.02, 0.05), rng.uniform(1.4, 2.1) * seat.half_depth
    centre = (0.0, 0.95 * seat.half_width - thick / 2, seat.under / 2 + 0.002)
    return both_sides([box(centre, (depth, thick, seat.under), exponent=20.0)])


def _star(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return a column on a star with castors, one point of it straight ahead or behind."""
    reach, hub = rng.uniform(0.22, 0.34), rng.uniform(0.09, 0.13)
    points, start = int(rng.choice([4, 5, 5])), float(rng.choice([0.0, 180.0]))
    arm = tube([(0.02, 0.0, hub), (reach, 0.0, 0.075)], 0.022, taper=0.6)
    disc = [[0.02, -0.022], [0.03, -0.018], [0.03, 0.018], [0.02, 0.022]]
    wheel = revolve(disc, n=16, axis="y", centre=(reach, 0.0, 0.03))
    fork = tube([(reach, 0.0, 0.03), (reach, 0.0, 0.085)], 0.012, n=8)
    star = [
        rotated(part, start + 360.0 / points * k, "z")
        for k in range(points)
        for part in (arm, wheel, fork)
    ]
    column = [[0.035, hub - 0.03], [0.035, hub + 0.06], [0.02, hub + 0.07], [0.02, seat.under]]
    plate = (0.9 * seat.half_depth, 0.7 * seat.half_width, 0.045)
    return [*star, revolve(column, n=16), box((0.0, 0.0, seat.under - 0.02), plate)]


def _pedestal(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return a round foot and a column."""
    foot, column = rng.uniform(0.16, 0.24), rng.uniform(0.02, 0.05)
    profile = [[foot, 0.0], [foot, 0.015], [1.5 * column, 0.05], [column, 0.12],
               [column, seat.under - 0.04], [3 * column, seat.under + 0.002]]  # fmt: skip
    return [revolve(profile, n=32)]


def _bent_tube(rng: np.random.Generator, seat: _Seat) -> Solids:
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


def _arc(half_width: float, bulge: float, x: float, z: float) -> Points:
    """Return a level path from +y to -y whose middle lies `bulge` further back than its ends."""
    y = np.linspace(half_width, -half_width, 13)
    return np.stack([x - bulge * (1 - (y / half_width) ** 2), y, np.full(13, z)], axis=-1)


def _rail(path: Points, height: float, thick: float, exponent: float = 6.0) -> trimesh.Trimesh:
    """Return an upright board along a level path."""
    return sweep(path, superellipse(height / 2, thick / 2, exponent, n=16), (0.0, 0.0, 1.0))


def _back(rng: np.random.Generator, seat: _Seat, kind: str) -> Solids:
    """Return the back, reclined about the seat's rear edge."""
    x, half = -seat.half_depth + 0.01, seat.half_width * rng.uniform(0.7, 1.05)
    height = rng.uniform(0.08, 0.28) if kind == "stool" else rng.uniform(0.2, 0.72)
    bulge, thick = rng.uniform(0.0, 0.07), rng.uniform(0.012, 0.03)
    gap = float(rng.choice([0.0, rng.uniform(0.2, 0.5) * height]))
    post = rng.uniform(0.009, 0.02)
    high, low = seat.top + height, seat.top + gap
    carved = {"panel": 0.34, "ladder": 0.24, "spindles": 0.18, "hoop": 0.12, "cross": 0.12}
    styles = {"panel": 0.7, "ladder": 0.3} if kind != "dining" else carved
    style = str(rng.choice(list(styles), p=list(styles.values())))
    posts = both_sides([tube([(x, 0.95 * half, seat.under), (x, 0.95 * half, high - 0.01)], post)])
    if style == "panel":
        pad = float(rng.choice([1.0, 2.2])) * thick
        middle = _arc(half, bulge, x, (low + high) / 2)
        parts = [_rail(middle, high - low, pad, rng.uniform(2.4, 9.0))]
        parts += _spine(x, bulge, seat, high) if kind == "office" else posts
    elif style == "ladder":
        n = 1 if kind == "stool" else int(rng.integers(1, 6))
        size = min(rng.uniform(0.035, 0.1), 0.7 * height / n)
        levels = np.linspace(high - size / 2, seat.top + 0.25 * height, n)
        parts = [_rail(_arc(0.95 * half, bulge, x, z), size, thick) for z in levels] + posts
    elif style == "hoop":
        y, foot = 0.9 * half, seat.top - 0.01
        corners = [(x, y, foot), (x, half, high), (x, -half, high), (x, -y, foot)]
        parts = [tube(fillet(corners, 0.2, n=9), post * 1.2)]
        spindles = np.linspace(-0.6, 0.6, int(rng.integers(3, 8))) * half
        parts += [tube([(x, y, foot), (x, y, high - 0.02)], 0.6 * post, n=8) for y in spindles]
    else:
        size, foot = min(rng.uniform(0.04, 0.1), 0.3 * height), seat.top + gap
        parts = [_rail(_arc(0.95 * half, bulge, x, high - size / 2), size, thick), *posts,
                 _rail(_arc(0.95 * half, bulge, x, foot + 0.02), 0.035, thick)]  # fmt: skip
        parts += _filling(rng, style, (x, bulge, half, post), (foot, high - size))
    if kind in ("office", "dining") and rng.random() < 0.08:
        rest = (0.05, 0.9 * half, rng.uniform(0.1, 0.16))
        parts += [box((x - bulge / 2, 0.0, high + 0.1), rest, exponent=4.0, bevel=0.02)]
        parts += [tube([(x - bulge / 2, 0.0, high - 0.04), (x - bulge / 2, 0.0, high + 0.1)], post)]
    recline = -rng.uniform(0.0, 22.0)
    return [rotated(part, recline, "y", (x, 0.0, seat.under + seat.thick / 2)) for part in parts]


def _spine(x: float, bulge: float, seat: _Seat, high: float) -> Solids:
    """Return the bracket that holds an office chair's back."""
    run = high - 0.16 - seat.under
    spine = box((x - bulge, 0.0, seat.under + run / 2), (0.03, 0.08, run), exponent=4.0)
    link = box((x / 2 - bulge / 2, 0.0, seat.under - 0.01), (bulge - x + 0.03, 0.08, 0.025))
    return [spine, link]


def _filling(
    rng: np.random.Generator,
    style: str,
    back: tuple[float, float, float, float],
    levels: tuple[float, float],
) -> Solids:
    """Return a cross or upright slats between the lower and upper rail of a back."""
    x, bulge, half, post = back
    low, high = levels
    if style == "cross":
        depth = x - 0.6 * bulge
        return both_sides([tube([(depth, 0.9 * half, high), (depth, -0.9 * half, low)],
                                0.8 * post, n=8)])  # fmt: skip
    flat = superellipse(rng.uniform(0.007, 0.025), 0.008, 4.0, n=12)
    slats = np.linspace(-0.8, 0.8, int(rng.integers(3, 8))) * half
    depths = x - bulge * (1 - (slats / (0.95 * half)) ** 2)
    return [sweep([(depth, y, low), (depth, y, high + 0.01)], flat, (0.0, 1.0, 0.0))
            for depth, y in zip(depths, slats, strict=True)]  # fmt: skip


def _arms(rng: np.random.Generator, seat: _Seat) -> Solids:
    """Return arm rests on one post each or on a loop of tube, sometimes with a tablet."""
    z, y = seat.top + rng.uniform(0.15, 0.27), seat.half_width + rng.uniform(0.0, 0.05)
    front, back = seat.half_depth * rng.uniform(0.3, 1.1), -seat.half_depth * rng.uniform(0.7, 1.1)
    extents = (front - back, rng.uniform(0.03, 0.08), 0.025)
    parts = [box(((front + back) / 2, y, z), extents, exponent=4.0, bevel=0.008)]
    under = seat.under + 0.3 * seat.thick
    foot = y - 0.02
    if rng.random() < 0.5:
        post = front * rng.uniform(0.1, 0.9)
        parts += [tube([(post, foot, under), (post, y, z)], 0.014),
                  tube([(post, foot, under), (post, 0.6 * y, under)], 0.014)]  # fmt: skip
    else:
        x, rear = front - 0.03, back + 0.05
        corners = [(x, foot, under), (x, y, z - 0.005), (rear, y, z - 0.005), (rear, foot, under)]
        parts += [tube(fillet(corners, 0.05), 0.012)]
    tablet = box((front, -y + 0.1, z + 0.02), (0.3, 0.28, 0.02), exponent=4.0, bevel=0.005)
    return both_sides(parts) + ([tablet] if rng.random() < 0.12 else [])


def _armchair(rng: np.random.Generator) -> Solids:
    """Return an upholstered chair: blocks for seat, back and arms, or a tub around the seat."""
    half_depth, half_width = rng.uniform(0.26, 0.44), rng.uniform(0.26, 0.46)
    foot, seat = rng.uniform(0.03, 0.16), rng.uniform(0.34, 0.46)
    arm, thick = seat + rng.uniform(0.1, 0.26), rng.uniform(0.07, 0.18)
    # A club chair's back is hardly higher than its arms: a cube, from the front as from behind.
    back = max(seat + rng.uniform(0.16, 0.55), arm + 0.01)
    bevel = rng.uniform(0.015, 0.05)
    parts = [box((0.0, 0.0, (foot + seat) / 2), (2 * half_depth, 1.9 * half_width, seat - foot),
                 exponent=rng.uniform(5.0, 9.0), bevel=bevel)]  # fmt: skip
    if rng.random() < 0.3:
        parts += [_tub(rng, (half_depth, half_width), (foot, arm, back), thick)]
    else:
        side = (0.0, half_width - thick / 3, (foot + arm) / 2)
        parts += both_sides([box(side, (2 * half_depth, thick, arm - foot), bevel=bevel)])
        width = 2 * half_width - rng.uniform(0.0, 0.8) * thick
        rest = box((-half_depth + thick / 2, 0.0, (foot + back) / 2),
                   (1.3 * thick, width, back - foot), bevel=bevel)  # fmt: skip
        parts += [rotated(rest, -rng.uniform(0.0, 16.0), "y", (-half_depth, 0.0, foot))]
        if rng.random() < 0.6:
            parts += [box((0.06, 0.0, seat + 0.04), (1.7 * half_depth, 1.55 * half_width, 0.12),
                          exponent=5.0, bevel=0.035)]  # fmt: skip
    x, y = 0.8 * half_depth, 0.8 * half_width
    legs = [tube([(end * x, y, foot + 0.01), (end * x, y, 0.0)], 0.024, taper=0.7)
            for end in (1, -1)]  # fmt: skip
    return parts + both_sides(legs)


def _tub(
    rng: np.random.Generator,
    halves: tuple[float, float],
    levels: tuple[float, float, float],
    thick: float,
) -> trimesh.Trimesh:
    """Return a wall around the seat that rises from the arms to the back."""
    foot, arm, back = levels
    sweep_deg = rng.uniform(90.0, 135.0)
    angle = np.radians(np.linspace(180.0 - sweep_deg, 180.0 + sweep_deg, 33))
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(33)], axis=-1)
    path = out * (*halves, 0.0) + np.array([0.0, 0.0, foot])
    rise = np.clip(-np.cos(angle), 0.0, 1.0) ** rng.uniform(1.0, 3.0)
    crest = arm - foot + (back - arm) * rise
    wall = superellipse(0.5, 0.5, 6.0, n=24)
    across = wall[None, :, :1] * thick * out[:, None]
    up = (wall[None, :, 1:] + 0.5) * crest[:, None, None] * np.array([0.0, 0.0, 1.0])
    return loft(path[:, None] + across + up)
