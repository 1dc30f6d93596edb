"""Lorries and buses, in the frame and units of :mod:`nbv.data.procedural.coachwork`."""

from __future__ import annotations

import numpy as np

from nbv.data.procedural.assembly import both_sides
from nbv.data.procedural.coachwork import (
    bed_walls,
    bumper,
    cabin,
    hull,
    mirrors,
    wheels,
)
from nbv.data.procedural.solids import Solids, box, revolve


def lorry(rng: np.random.Generator) -> Solids:
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
        cabin(rng, (back, face), (back + 0.05, face - rng.uniform(0.02, 0.4)), (belt, height),
              half_width),
        box((nose[0], 0.0, (base + belt) / 2 + 0.02), (nose[1], 1.94 * half_width, belt - base),
            exponent=9.0, bevel=0.06),
        box((0.0, 0.0, 1.3 * wheel), (0.97 * length, 1.1 * half_width, 0.3), bevel=0.04),
    ]  # fmt: skip
    if rng.random() < 0.6:
        parts += mirrors(rng, face - 0.15, half_width, belt + 0.3)
    parts += _load(rng, front, back - rng.uniform(0.08, 0.3), half_width, floor, height)
    rear = -front + rng.uniform(0.16, 0.24) * length
    axles: tuple[float, ...] = (front - rng.uniform(0.6, 0.9) - 0.3 * bonnet, rear)
    if length > 6.6 and rng.random() < 0.5:
        axles = (*axles, rear + 2.3 * wheel)
    return parts + wheels(axles, wheel, 0.97 * half_width)


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
    return [bed, *bed_walls(-front, start, 1.09 * half_width, (low, wall))]


def bus(rng: np.random.Generator) -> Solids:
    """Return a bus or coach: one box, whose ends differ only in rake and fittings."""
    length, half_width = rng.uniform(6.0, 9.5), rng.uniform(1.05, 1.2)
    height, clearance, wheel = rng.uniform(2.6, 3.3), rng.uniform(0.25, 0.4), rng.uniform(0.42, 0.5)
    front, belt = length / 2, rng.uniform(0.42, 0.52) * height
    axles = (front - rng.uniform(0.12, 0.24) * length, -front + rng.uniform(0.2, 0.3) * length)
    line = np.array([[-front, belt], [front, belt]])
    rake, back = rng.uniform(0.2, 0.6), rng.uniform(0.0, 0.15)
    parts = [
        hull(rng, line, half_width, clearance, axles, wheel),
        cabin(rng, (-front + 0.02, front - 0.02), (-front + back, front - rake), (belt, height),
              half_width),
        box((0.0, 0.0, (clearance + 2.3 * wheel) / 2),
            (0.9 * length, 1.3 * half_width, 2.3 * wheel - clearance), bevel=0.05),
        *wheels(axles, wheel, 0.97 * half_width),
    ]  # fmt: skip
    if rng.random() < 0.6:
        parts += mirrors(rng, front - 0.1, half_width, 0.7 * height)
    if rng.random() < 0.5:
        unit = (rng.uniform(1.0, 2.4), 1.3 * half_width, 0.22)
        x = rng.uniform(-0.3, 0.2) * length
        parts += [box((x, 0.0, height + 0.08), unit, exponent=5.0, bevel=0.06)]
    if rng.random() < 0.4:
        vent = box((-front + 0.6, half_width, belt * 0.7), (0.7, 0.06, 0.35), bevel=0.02)
        parts += both_sides([vent])
    return parts + bumper(rng, front, half_width, clearance)
