"""Cars from hatchbacks to vans, roadsters and veterans; lorries and buses are in :mod:`.lorry`.

Lengths are in metres; the road is z = 0 and the front bumper near x = length / 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from nbv.data.procedural.assembly import both_sides, centred, join, turned
from nbv.data.procedural.coachwork import (
    Range,
    bed_walls,
    bumper,
    cabin,
    hull,
    mirrors,
    spare_wheel,
    spoiler,
    wheels,
)
from nbv.data.procedural.lorry import bus, lorry
from nbv.data.procedural.solids import Solids, box, loft, revolve, superellipse


@dataclass(frozen=True)
class _Plan:
    """Ranges of a body plan's numbers; lengths along x are in car lengths.

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
        return centred(join(lorry(rng)))
    return centred(join(bus(rng) if name == "bus" else _motor_car(rng, name, _PLANS[name])))


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
    # The ranges overlap: no single number tells front from back.
    nose, back, deck = belt * rng.uniform((0.74, 0.82, 0.93), (0.97, 1.0, 1.03))
    if name == "pick-up":
        back = deck = belt * rng.uniform(0.62, 0.72)
    line = [[-front, back], [rear_foot - 0.05, deck], [rear_foot + 0.05, belt], [foot, belt]]
    body = 0.8 * half_width if name == "veteran" else half_width
    parts = [hull(rng, [*line, [front, nose]], body, clearance, axles, wheel)]
    if name == "roadster":
        parts += _open_top(rng, (rear_foot, foot), (belt, height), half_width)
    else:
        parts += [cabin(rng, (rear_foot, foot), (rear_top, top), (belt, height), body)]
    # Between the wheels, where the hull is cut away.
    filling = (0.9 * length, 1.3 * body, 2.3 * wheel - clearance)
    parts += [box((0.0, 0.0, clearance / 2 + 1.15 * wheel), filling, bevel=0.05)]
    parts += wheels(axles, wheel, 0.97 * half_width)
    if name == "pick-up":
        parts += bed_walls(-front, rear_foot, half_width, (deck - 0.15, belt))
    if name == "veteran":
        parts += _mudguards(axles, wheel, half_width, clearance)
    elif rng.random() < 0.65:
        parts += mirrors(rng, foot - 0.25, half_width, belt + 0.06)
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
    parts = [turned(glass, tilt, "y", (x, 0.0, belt)), *both_sides([seat])]
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
    places: tuple[float, float, float, float],
    levels: tuple[float, float, float],
    half_width: float,
) -> Solids:
    """Return bumpers, and sometimes a rack, a spoiler or a spare wheel.

    `places` along x: rear end, rear end of the roof, foot of the windscreen, front end;
    `levels`: underside, belt line, roof.
    """
    rear, rear_top, foot, front = places
    clearance, belt, height = levels
    parts: Solids = []
    for end in (rear, front):
        if rng.random() < 0.7:
            parts += bumper(rng, end, half_width, clearance)
    if name in ("off-roader", "van", "estate") and rng.random() < 0.3:
        back, ahead = rear_top + 0.1, foot - 0.9
        centre, extents = (
            ((back + ahead) / 2, 0.7 * half_width, height + 0.03),
            (ahead - back, 0.06, 0.1),
        )
        parts += both_sides([box(centre, extents, bevel=0.02)])
    if name in ("off-roader", "veteran") and rng.random() < 0.35:
        parts += [spare_wheel(rng, rear - 0.04, belt - 0.05)]
    if name == "coupé" and rng.random() < 0.3:
        parts += spoiler(rear + 0.16, belt + rng.uniform(0.08, 0.22), half_width)
    return parts
