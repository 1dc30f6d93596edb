"""Road vehicles: cars from hatchbacks to vans, roadsters and veterans, lorries and buses.

Lengths are in metres; the road is z = 0, the front is +x, and x = 0 is the middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.solids import (
    Solids,
    both_sides,
    box,
    centred,
    join,
    loft,
    revolve,
    rotated,
    stack_outlines,
    superellipse,
)

Range = tuple[float, float]


@dataclass(frozen=True)
class _Plan:
    """Ranges of a type's dimensions; lengths along x are in car lengths.

    From the front: bonnet, windscreen seen from the side, roof, rear window seen from the side,
    boot.
    """

    weight: float
    length: Range
    height: Range
    bonnet: Range
    screen: Range
    boot: Range
    rear_glass: Range
    belt: Range = (0.57, 0.67)
    clearance: Range = (0.14, 0.2)
    wheel: Range = (0.28, 0.35)


_PLANS = {
    "hatchback": _Plan(0.17, (3.2, 4.3), (1.38, 1.6), (0.12, 0.25), (0.08, 0.2), (0.01, 0.06),
                       (0.06, 0.2)),
    "saloon": _Plan(0.19, (4.1, 5.3), (1.34, 1.52), (0.22, 0.31), (0.11, 0.18), (0.1, 0.2),
                    (0.08, 0.19)),
    "estate": _Plan(0.08, (4.1, 5.2), (1.38, 1.56), (0.17, 0.28), (0.08, 0.17), (0.0, 0.03),
                    (0.02, 0.1)),
    "off-roader": _Plan(0.13, (3.5, 4.9), (1.62, 2.0), (0.16, 0.28), (0.02, 0.12), (0.0, 0.02),
                        (0.01, 0.08), (0.54, 0.64), (0.2, 0.36), (0.34, 0.44)),
    "van": _Plan(0.1, (3.9, 5.8), (1.75, 2.5), (0.0, 0.14), (0.04, 0.17), (0.0, 0.02),
                 (0.0, 0.05), (0.44, 0.58), (0.16, 0.26), (0.29, 0.36)),
    "pick-up": _Plan(0.1, (4.6, 5.6), (1.6, 1.95), (0.16, 0.26), (0.05, 0.14), (0.36, 0.48),
                     (0.01, 0.06), (0.55, 0.64), (0.2, 0.32), (0.32, 0.43)),
    "coupé": _Plan(0.1, (3.7, 4.8), (1.1, 1.36), (0.17, 0.38), (0.1, 0.2), (0.02, 0.18),
                   (0.12, 0.34), (0.58, 0.7), (0.1, 0.16), (0.28, 0.36)),
    "roadster": _Plan(0.03, (3.4, 4.4), (1.1, 1.4), (0.32, 0.42), (0.02, 0.08), (0.14, 0.26),
                      (0.0, 0.01), (0.62, 0.72), (0.12, 0.22), (0.28, 0.36)),
    "veteran": _Plan(0.03, (3.2, 4.4), (1.6, 1.95), (0.26, 0.38), (0.0, 0.04), (0.02, 0.14),
                     (0.01, 0.08), (0.5, 0.6), (0.24, 0.34), (0.34, 0.42)),
}  # fmt: skip
_LORRIES, _BUSES = 0.1, 0.04


def car(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a road vehicle, mirror-symmetric in y = 0, its front towards +x."""
    weights = np.array([plan.weight for plan in _PLANS.values()] + [_LORRIES, _BUSES])
    name = str(rng.choice([*_PLANS, "lorry", "bus"], p=weights / weights.sum()))
    if name == "lorry":
        return centred(join(_lorry(rng)))
    return centred(join(_bus(rng) if name == "bus" else _motor_car(rng, name, _PLANS[name])))


def _motor_car(rng: np.random.Generator, name: str, plan: _Plan) -> Solids:
    length, height = rng.uniform(*plan.length), rng.uniform(*plan.height)
    half_width = rng.uniform(0.8, 0.9) + 0.04 * (length - 4.2)
    belt, clearance = rng.uniform(*plan.belt) * height, rng.uniform(*plan.clearance)
    wheel, front = rng.uniform(*plan.wheel), length / 2
    foot = front - rng.uniform(*plan.bonnet) * length
    top = foot - rng.uniform(*plan.screen) * length
    rear_foot = -front + rng.uniform(*plan.boot) * length
    rear_top = min(rear_foot + rng.uniform(*plan.rear_glass) * length, top - 0.16 * length)
    axles = (front - rng.uniform(0.15, 0.21) * length, -front + rng.uniform(0.15, 0.22) * length)
    # The ranges overlap, so that no single number distinguishes front and back.
    nose, back, deck = belt * rng.uniform((0.74, 0.82, 0.93), (0.97, 1.0, 1.03))
    if name == "pick-up":
        back = deck = belt * rng.uniform(0.62, 0.72)
    line = [[-front, back], [rear_foot - 0.05, deck], [rear_foot + 0.05, belt], [foot, belt]]
    body = 0.8 * half_width if name == "veteran" else half_width
    parts = [_hull(rng, [*line, [front, nose]], body, clearance, axles, wheel)]
    if name == "roadster":
        parts += _open_top(rng, (rear_foot, foot), (belt, height), half_width)
    else:
        parts += [_cabin(rng, (rear_foot, foot), (rear_top, top), (belt, height), body)]
    # Between the wheels, where the hull is cut away.
    filling = (0.9 * length, 1.3 * body, 2.3 * wheel - clearance)
    parts += [box((0.0, 0.0, clearance / 2 + 1.15 * wheel), filling, bevel=0.05)]
    parts += _wheels(axles, wheel, 0.97 * half_width)
    if name == "pick-up":
        parts += _bed_walls(-front, rear_foot, half_width, (deck - 0.15, belt))
    if name == "veteran":
        parts += _mudguards(axles, wheel, half_width, clearance)
    elif rng.random() < 0.65:
        parts += _mirrors(rng, foot - 0.25, half_width, belt + 0.06)
    return parts + _fittings(rng, name, (-front, rear_top, foot, front), (clearance, belt, height),
                             half_width)  # fmt: skip


def _open_top(rng: np.random.Generator, ends: Range, heights: Range, half_width: float) -> Solids:
    """Return a windscreen, seat backs and sometimes a roll bar."""
    belt, height = heights
    tilt, x = -rng.uniform(15.0, 45.0), ends[1] - 0.05
    glass = box((x, 0.0, (belt + height) / 2 - 0.04),
                (0.05, 1.6 * half_width, height - belt + 0.08), bevel=0.02)  # fmt: skip
    seat_x = ends[0] + 0.25 * (ends[1] - ends[0])
    seat = box((seat_x, 0.42 * half_width, belt), (0.16, 0.5, 0.5 * (height - belt) + 0.3),
               exponent=4.0, bevel=0.04)  # fmt: skip
    parts = [rotated(glass, tilt, "y", (x, 0.0, belt)), *both_sides([seat])]
    if rng.random() < 0.4:
        bar = box((ends[0] + 0.1, 0.0, belt + 0.12), (0.1, 1.4 * half_width, 0.35), bevel=0.03)
        parts += [bar]
    return parts


def _mudguards(
    axles: tuple[float, ...], wheel: float, half_width: float, clearance: float
) -> Solids:
    """Return a veteran's guards over the wheels, running boards and head lamps."""
    angle = np.radians(np.linspace(-5.0, 185.0, 17))
    around = np.stack([np.cos(angle), np.zeros(17), np.sin(angle)], axis=-1)
    section = superellipse(1.0, 0.13, 5.0, n=12)
    guards = []
    for axle in axles:
        rings = (1.17 + 0.07 * section[None, :, :1]) * wheel * around[:, None]
        rings[..., 1] = section[:, 1]
        guards += [loft(rings + np.array([axle, 0.86 * half_width, wheel]))]
    board = box(((axles[0] + axles[1]) / 2, 0.86 * half_width, clearance + 0.06),
                (axles[0] - axles[1] - 2 * wheel, 0.26, 0.05), bevel=0.01)  # fmt: skip
    lamp = revolve([[0.05, -0.08], [0.11, 0.03], [0.11, 0.07]], n=20, axis="x",
                   centre=(axles[0] + 0.9 * wheel, 0.6 * half_width, 2.3 * wheel))  # fmt: skip
    return both_sides([*guards, board, lamp])


def _fittings(
    rng: np.random.Generator,
    name: str,
    ends: tuple[float, float, float, float],
    levels: tuple[float, float, float],
    half_width: float,
) -> Solids:
    """Return bumpers, and sometimes a rack, a spoiler or a spare wheel.

    `ends` are positions along x: rear end, rear end of the roof, foot of the windscreen, front end;
    `levels` are the heights of underside, belt line and roof.
    """
    rear, rear_top, foot, front = ends
    clearance, belt, height = levels
    parts: Solids = []
    for end in (rear, front):
        if rng.random() < 0.7:
            parts += _bumper(rng, end, half_width, clearance)
    if name in ("off-roader", "van", "estate") and rng.random() < 0.3:
        back, ahead = rear_top + 0.1, foot - 0.9
        centre, extents = (
            ((back + ahead) / 2, 0.7 * half_width, height + 0.03),
            (ahead - back, 0.06, 0.1),
        )
        parts += both_sides([box(centre, extents, bevel=0.02)])
    if name in ("off-roader", "veteran") and rng.random() < 0.35:
        parts += [_spare_wheel(rng, rear - 0.04, belt - 0.05)]
    if name == "coupé" and rng.random() < 0.3:
        parts += _spoiler(rear + 0.16, belt + rng.uniform(0.08, 0.22), half_width)
    return parts


def _lorry(rng: np.random.Generator) -> Solids:
    """Return a cab on a chassis with a box, a tank or an open bed behind it."""
    length, half_width = rng.uniform(5.2, 8.0), rng.uniform(1.0, 1.2)
    wheel, height = rng.uniform(0.4, 0.5), rng.uniform(2.1, 2.9)
    front, floor = length / 2, 1.5 * wheel
    bonnet = rng.choice([0.0, rng.uniform(0.6, 1.2)], p=[0.65, 0.35])
    face = front - bonnet
    back = face - rng.uniform(1.4, 2.0)
    belt = floor + rng.uniform(0.4, 0.5) * (height - floor)
    nose = (back + front) / 2, front - back
    base = 0.8 * wheel
    parts = [
        _cabin(rng, (back, face), (back + 0.05, face - rng.uniform(0.02, 0.4)), (belt, height),
              half_width),
        box((nose[0], 0.0, (base + belt) / 2 + 0.02), (nose[1], 1.94 * half_width, belt - base),
            exponent=9.0, bevel=0.06),
        box((0.0, 0.0, 1.3 * wheel), (0.97 * length, 1.1 * half_width, 0.3), bevel=0.04),
    ]  # fmt: skip
    if rng.random() < 0.6:
        parts += _mirrors(rng, face - 0.15, half_width, belt + 0.3)
    parts += _load(rng, front, back - rng.uniform(0.08, 0.3), half_width, floor, height)
    rear = -front + rng.uniform(0.16, 0.24) * length
    axles: tuple[float, ...] = (front - rng.uniform(0.6, 0.9) - 0.3 * bonnet, rear)
    if length > 6.6 and rng.random() < 0.5:
        axles = (*axles, rear + 2.3 * wheel)
    return parts + _wheels(axles, wheel, 0.97 * half_width)


def _load(
    rng: np.random.Generator,
    front: float,
    start: float,
    half_width: float,
    floor: float,
    cab: float,
) -> Solids:
    """Return the lorry's load, from the rear end to `start` behind the cab."""
    run, middle, low = start + front, (start - front) / 2, floor + 0.1
    kind = rng.choice(["box", "tank", "bed"], p=[0.6, 0.15, 0.25])
    if kind == "box":
        top = cab + rng.uniform(0.0, 0.9)
        centre, extents = (middle, 0.0, (low + top) / 2), (run, 2.04 * half_width, top - low)
        return [box(centre, extents, exponent=20.0, bevel=0.03)]
    if kind == "tank":
        radius = 0.9 * half_width
        bulge = [[0.4, 0.0], [0.85, 0.04], [1.0, 0.12], [1.0, 0.88], [0.85, 0.96], [0.4, 1.0]]
        profile = np.array(bulge) * (radius, run)
        return [revolve(profile, axis="x", centre=(-front, 0.0, low + radius))]
    wall = low + rng.uniform(0.4, 1.0)
    bed = box((middle, 0.0, low), (run, 2.04 * half_width, 0.24), exponent=20.0)
    return [bed, *_bed_walls(-front, start, 1.09 * half_width, (low, wall))]


def _bus(rng: np.random.Generator) -> Solids:
    """Return a bus or coach: one box, whose ends differ only in rake and fittings."""
    length, half_width = rng.uniform(6.0, 9.5), rng.uniform(1.05, 1.2)
    height, clearance, wheel = rng.uniform(2.6, 3.3), rng.uniform(0.25, 0.4), rng.uniform(0.42, 0.5)
    front, belt = length / 2, rng.uniform(0.42, 0.52) * height
    axles = (front - rng.uniform(0.12, 0.24) * length, -front + rng.uniform(0.2, 0.3) * length)
    line = np.array([[-front, belt], [front, belt]])
    rake, back = rng.uniform(0.2, 0.6), rng.uniform(0.0, 0.15)
    parts = [
        _hull(rng, line, half_width, clearance, axles, wheel),
        _cabin(rng, (-front + 0.02, front - 0.02), (-front + back, front - rake), (belt, height),
              half_width),
        box((0.0, 0.0, (clearance + 2.3 * wheel) / 2),
            (0.9 * length, 1.3 * half_width, 2.3 * wheel - clearance), bevel=0.05),
        *_wheels(axles, wheel, 0.97 * half_width),
    ]  # fmt: skip
    if rng.random() < 0.6:
        parts += _mirrors(rng, front - 0.1, half_width, 0.7 * height)
    if rng.random() < 0.5:
        unit = (rng.uniform(1.0, 2.4), 1.3 * half_width, 0.22)
        x = rng.uniform(-0.3, 0.2) * length
        parts += [box((x, 0.0, height + 0.08), unit, exponent=5.0, bevel=0.06)]
    if rng.random() < 0.4:
        vent = box((-front + 0.6, half_width, belt * 0.7), (0.7, 0.06, 0.35), bevel=0.02)
        parts += both_sides([vent])
    return parts + _bumper(rng, front, half_width, clearance)


def _hull(
    rng: np.random.Generator,
    line: ArrayLike,
    half_width: float,
    clearance: float,
    axles: tuple[float, ...],
    wheel: float,
) -> trimesh.Trimesh:
    """Return the body below the windows, cut away over the wheels.

    `line` (m, 2) is (x, height) along the upper edge, from the rear end at -x to the front at x;
    `axles` are the positions of the wheels along x, and `wheel` is their radius.
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


def _cabin(
    rng: np.random.Generator, feet: Range, tops: Range, heights: Range, half_width: float
) -> trimesh.Trimesh:
    """Return the part with the windows, from the belt line to the roof.

    `feet` and `tops` are its rear and front end along x at the belt line and at the roof, `heights`
    those of belt line and roof.
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


def _wheels(axles: tuple[float, ...], wheel: float, side: float) -> Solids:
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


def _mirrors(rng: np.random.Generator, x: float, half_width: float, z: float) -> Solids:
    """Return the pair of wing mirrors."""
    size = rng.uniform(0.6, 1.2)
    centre = (x, half_width + 0.04, z)
    extents = (0.12 * size, 0.2 * size + 0.06, 0.14 * size)
    return both_sides([box(centre, extents, exponent=4.0, bevel=0.03)])


def _bumper(rng: np.random.Generator, x: float, half_width: float, clearance: float) -> Solids:
    """Return a bar across one end."""
    bar = rng.uniform(0.14, 0.26)
    z = clearance + rng.uniform(0.1, 0.2) + bar / 2
    extents = (0.2, 1.75 * half_width, bar)
    return [box((0.985 * x, 0.0, z), extents, exponent=4.0, bevel=0.04)]


def _spare_wheel(rng: np.random.Generator, x: float, z: float) -> trimesh.Trimesh:
    """Return a wheel facing along x."""
    size = rng.uniform(0.3, 0.38)
    profile = np.array([[0.6, -0.3], [1.0, -0.25], [1.0, 0.25], [0.6, 0.3]]) * size
    return revolve(profile, n=28, axis="x", centre=(x, 0.0, z))


def _spoiler(x: float, z: float, half_width: float) -> Solids:
    """Return a wing across the car on two posts."""
    wing = box((x, 0.0, z), (0.26, 1.6 * half_width, 0.05), bevel=0.015)
    post = box((x, 0.5 * half_width, z - 0.15), (0.12, 0.06, 0.3), bevel=0.01)
    return [rotated(wing, 6.0, "y", (x, 0.0, z)), *both_sides([post])]


def _bed_walls(back: float, front: float, half_width: float, heights: Range) -> Solids:
    """Return the two sides and the tailgate of an open bed."""
    low, high = heights
    middle, level = (back + front) / 2, (low + high) / 2
    extents = (front - back, 0.08, high - low)
    side = box((middle, 0.93 * half_width, level), extents, bevel=0.02)
    gate = box((back + 0.06, 0.0, level), (0.08, 1.85 * half_width, high - low))
    return [*both_sides([side]), gate]
