"""Airplanes: airliners, business jets, fighters, light and twin propeller craft, and oddities.

Lengths are in fuselage lengths; the nose is at x = 0.5 and the fuselage's axis at z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.airframe import (
    bubble,
    floats,
    hung_jet,
    jet_pod,
    landing_gear,
    panel,
    propeller,
    store,
    wing,
    wing_propeller,
)
from nbv.data.procedural.assembly import both_sides, centred, join
from nbv.data.procedural.solids import Points, Solids, box, stack_outlines, superellipse, tube

Range = tuple[float, float]


@dataclass(frozen=True)
class _Plan:
    """Ranges of a body plan's numbers, and the kinds of its tail and engines.

    `wing_x` is the place where the wing's leading edge leaves the fuselage; `wing_heights` are in
    fuselage radii. A kind listed twice is twice as likely.
    """

    weight: float
    radius: Range
    span: Range
    chord: Range
    taper: Range
    sweep_deg: Range
    wing_x: Range
    wing_heights: tuple[float, ...]
    tails: tuple[str, ...]
    engines: tuple[str, ...]
    nose: Range = (0.12, 0.2)
    tail: Range = (0.3, 0.42)
    stores: float = 0.05


_PLANS = {
    "airliner": _Plan(
        0.19, (0.044, 0.07), (0.8, 1.15), (0.15, 0.21), (0.25, 0.4), (22, 36), (0.06, 0.16),
        (-0.6, -0.6, 0.75), ("low", "low", "cross"), ("jet2", "jet2", "jet4"),
    ),
    "business jet": _Plan(
        0.13, (0.044, 0.064), (0.7, 1.0), (0.13, 0.18), (0.3, 0.5), (8, 32), (-0.02, 0.06),
        (-0.6,), ("t", "t", "cross", "v"), ("rear",),
    ),
    "fighter": _Plan(
        0.19, (0.04, 0.065), (0.5, 0.8), (0.26, 0.4), (0.2, 0.45), (30, 52), (0.08, 0.18),
        (-0.2, 0.3, 0.5), ("low", "twin", "low", "canard"), ("fuselage",), (0.3, 0.45),
        (0.15, 0.25), 0.5,
    ),
    "delta": _Plan(
        0.1, (0.035, 0.06), (0.45, 0.75), (0.5, 0.62), (0.05, 0.15), (48, 62), (0.18, 0.26),
        (-0.4, 0.0), ("fin", "fin", "twin", "canard"), ("fuselage",), (0.3, 0.5), (0.1, 0.2), 0.4,
    ),
    "light": _Plan(
        0.14, (0.055, 0.085), (1.0, 1.45), (0.16, 0.23), (0.55, 1.0), (-4, 6), (0.16, 0.24),
        (0.95, -0.65), ("low", "low", "v", "t"), ("nose",), (0.1, 0.2), (0.5, 0.62), 0.15,
    ),
    "twin propeller": _Plan(
        0.08, (0.05, 0.075), (1.0, 1.3), (0.13, 0.18), (0.45, 0.7), (0, 8), (0.08, 0.16),
        (0.9, -0.6), ("t", "low", "cross", "twin"), ("prop2", "prop2", "prop4"), (0.12, 0.22),
    ),
    "glider": _Plan(
        0.03, (0.04, 0.055), (1.4, 1.8), (0.1, 0.14), (0.35, 0.6), (-3, 4), (0.1, 0.16),
        (0.5,), ("t", "v", "low"), ("none",), (0.2, 0.3), (0.6, 0.7),
    ),
    "biplane": _Plan(
        0.04, (0.07, 0.09), (1.05, 1.3), (0.16, 0.2), (0.9, 1.0), (0, 6), (0.16, 0.22),
        (-0.8,), ("low",), ("nose",), (0.08, 0.14), (0.55, 0.65),
    ),
    "pusher": _Plan(
        0.04, (0.055, 0.08), (0.9, 1.3), (0.16, 0.22), (0.4, 0.8), (8, 28), (-0.2, -0.12),
        (-0.3, 0.2), ("canard", "tips canard"), ("pusher",), (0.2, 0.4), (0.2, 0.35),
    ),
    "flying wing": _Plan(
        0.015, (0.06, 0.085), (1.3, 1.7), (0.75, 0.9), (0.1, 0.25), (28, 38), (0.42, 0.46),
        (0.0,), ("tips", "fin"), ("fuselage",), (0.3, 0.5), (0.3, 0.5),
    ),
    "twin boom": _Plan(
        0.04, (0.07, 0.11), (1.4, 1.9), (0.22, 0.32), (0.5, 0.9), (-2, 8), (0.05, 0.15),
        (0.7, 0.0), ("boom",), ("pusher", "fuselage", "prop2"), (0.15, 0.3), (0.3, 0.5),
    ),
}  # fmt: skip


def airplane(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return an airplane, mirror-symmetric in y = 0, its nose towards +x."""
    weights = np.array([plan.weight for plan in _PLANS.values()])
    name = str(rng.choice(list(_PLANS), p=weights / weights.sum()))
    plan = _PLANS[name]
    radius, engines = rng.uniform(*plan.radius), str(rng.choice(plan.engines))
    tip = rng.uniform(0.6, 0.8) if engines == "fuselage" else rng.uniform(0.12, 0.3)
    rise = rng.uniform(0.2, 0.9) * (1.0 - tip)
    parts = [_fuselage(rng, plan, radius, tip, rise)]
    wings, wing_tip = _wings(rng, plan, radius, name, engines)
    parts += wings + _tail(rng, plan, radius, rise * radius, wing_tip)
    parts += _cockpit(rng, name, radius)
    if engines == "fuselage" and rng.random() < 0.8:
        size = (rng.uniform(0.25, 0.4), 0.9 * radius, rng.uniform(0.8, 1.4) * radius)
        parts += both_sides([box((0.03, radius, -0.15 * radius), size, bevel=0.01)])
    elif engines == "rear":
        parts += _rear_jets(rng, radius)
    elif engines == "nose":
        parts += propeller(rng, (0.496, 0.0, 0.0), rng.uniform(0.11, 0.16))
    elif engines == "pusher":
        parts += propeller(rng, (-0.496, 0.0, rise * radius), rng.uniform(0.1, 0.15), way=-1)
    if name in ("light", "biplane") and rng.random() < 0.2:
        parts += floats(rng, radius)
    elif rng.random() < (0.8 if engines == "nose" else 0.15):
        parts += landing_gear(rng, radius)
    return centred(join(parts))


def _fuselage(
    rng: np.random.Generator, plan: _Plan, radius: float, tip: float, rise: float
) -> trimesh.Trimesh:
    """Return the body: a nose cap, a barrel, and a tail cone that rises towards its end."""
    nose, tail = rng.uniform(*plan.nose), rng.uniform(*plan.tail)
    t = np.concatenate([np.linspace(0.0, nose, 12), np.linspace(nose, 1.0, 22)[1:]])
    front = (1.0 - np.clip(1.0 - t / nose, 0.0, 0.985) ** 2) ** rng.uniform(0.5, 0.75)
    behind = np.clip((t - 1.0 + tail) / tail, 0.0, 1.0) ** rng.uniform(1.3, 1.8)
    size = radius * front * (1.0 - (1.0 - tip) * behind)
    lift = radius * (rise * behind - rng.uniform(0.0, 0.35) * (1.0 - front))
    oval = superellipse(1.0, rng.uniform(0.9, 1.25), rng.uniform(2.0, 2.6))
    outlines = size[:, None, None] * oval
    outlines[..., 1] += lift[:, None]
    return stack_outlines(outlines, 0.5 - t, axis="x")


def _wings(
    rng: np.random.Generator, plan: _Plan, radius: float, name: str, engines: str
) -> tuple[Solids, Points]:
    """Return the wings with their loads, and the outer end of the left one's leading edge."""
    half_span, chord = rng.uniform(*plan.span) / 2, rng.uniform(*plan.chord)
    taper, sweep = rng.uniform(*plan.taper), np.tan(np.radians(rng.uniform(*plan.sweep_deg)))
    z = float(rng.choice(plan.wing_heights)) * radius
    rise = np.tan(np.radians(rng.uniform(1, 8) if z < 0 else rng.uniform(-5, 3)))
    root, slope = np.array([rng.uniform(*plan.wing_x), 0.0, z]), np.array([-sweep, 1.0, rise])
    parts = [wing(root, half_span, chord, taper, sweep, rise)]
    tip = root + half_span * slope
    if name == "biplane":
        up = np.array([rng.uniform(0.0, 0.05), 0.0, rng.uniform(2.0, 2.5) * radius])
        parts += [wing(root + up, half_span, chord, taper, sweep, rise)]
        for y in (0.12, 0.7 * half_span):
            foot = root + y * slope - (0.3 * chord, 0.0, 0.0)
            parts += [tube([foot, foot + up], 0.007, n=8)]
    elif engines[:-1] in ("jet", "prop"):
        for place in (0.36,) if engines[-1] == "2" else (0.32, 0.62):
            edge = root + place * half_span * slope
            jet = engines.startswith("jet")
            parts += hung_jet(rng, edge, radius) if jet else wing_propeller(rng, edge)
    elif name != "flying wing" and rng.random() < 0.3:
        end = np.array([-0.03, 0.005, 0.06])
        parts += [panel([tip, tip + end], [chord * taper, 0.6 * chord * taper], 0.08)]
    if rng.random() < plan.stores:
        for place in rng.uniform(0.25, 1.0, int(rng.integers(1, 4))):
            hook = root + place * half_span * slope
            parts += [store(rng, hook - (0.3 * chord * (1.0 - place), 0.0, 0.0))]
    return both_sides(parts), tip


def _rear_jets(rng: np.random.Generator, radius: float) -> Solids:
    size, length = radius * rng.uniform(0.45, 0.6), rng.uniform(0.12, 0.17)
    pod = np.array([-0.24, radius + 0.9 * size, 0.45 * radius])
    edge = pod + np.array([0.04, 0.0, 0.0])
    pylon = panel([edge * (1.0, 0.0, 1.0), edge], [0.09, 0.09], 0.12)
    return both_sides([jet_pod(pod, size, length), pylon])


def _tail(
    rng: np.random.Generator, plan: _Plan, radius: float, z: float, wing_tip: Points
) -> Solids:
    """Return fins and tailplanes: low, cruciform, T, V, twin, canards, tip fins or booms."""
    kind = str(rng.choice(plan.tails))
    fast = plan.sweep_deg[1] > 20
    height, chord = rng.uniform(0.1, 0.19), rng.uniform(0.12, 0.2)
    sweep = np.tan(np.radians(rng.uniform(30, 50) if fast else rng.uniform(5, 32)))
    span, plane_chord = rng.uniform(0.14, 0.22), rng.uniform(0.08, 0.13)
    if plan.chord[0] > 0.25:
        span, plane_chord = span * 0.85, plane_chord * 1.3
    taper, rise = rng.uniform(0.35, 0.65), rng.uniform(-0.05, 0.12)
    x, plane_x = -0.5 + chord + rng.uniform(-0.04, 0.03), -0.48 + plane_chord
    top = z + 0.3 * radius + height

    def fin(foot: ArrayLike, lean: float, size: float) -> trimesh.Trimesh:
        head = np.asarray(foot) + size * np.array([-sweep, lean, 1.0])
        return panel(np.stack([foot, head]), [chord, taper * chord], 0.09)

    def plane(root: ArrayLike, size: float = 1.0) -> Solids:
        return both_sides([wing(root, size * span, plane_chord, taper, 0.75 * sweep, rise)])

    ahead = plane((rng.uniform(0.3, 0.4), 0.0, 0.3 * radius), rng.uniform(0.9, 1.2))
    if kind == "v":
        return both_sides([fin((plane_x + 0.03, 0.0, z), rng.uniform(0.8, 1.3), 0.8 * span)])
    if kind == "twin":
        foot = (x, rng.uniform(0.8, 1.3) * radius, 0.0)
        return both_sides([fin(foot, rng.uniform(0.0, 0.4), 0.9 * height + z)]) + plane(
            (plane_x, 0.0, 0.0)
        )
    if kind == "boom":
        y, end = rng.uniform(0.16, 0.24), -rng.uniform(0.75, 1.0)
        booms = [tube([(0.08, y, 0.3 * radius), (end, y, 0.3 * radius)], 0.025, taper=0.6),
                 fin((end + chord, y, 0.3 * radius), 0.0, height)]  # fmt: skip
        level = 0.3 * radius + rng.choice([0.0, 0.95]) * height
        across = panel([(end + 0.9 * plane_chord, 0.0, level), (end + 0.9 * plane_chord, y, level)],
                       [plane_chord, plane_chord], 0.1)  # fmt: skip
        return both_sides([*booms, across])
    if kind.startswith("tips"):
        fins = both_sides([fin(0.97 * wing_tip, rng.uniform(0.0, 0.3), 0.8 * height)])
        return fins + (ahead if kind.endswith("canard") else [])
    centre = [fin((x, 0.0, z), 0.0, top - z)]
    if kind == "fin":
        return centre
    if kind == "canard":
        return centre + ahead
    share = {"low": 0.0, "cross": 0.5, "t": 0.97}[kind]
    lead = x - share * (sweep * (top - z) + 0.5 * (chord - plane_chord))
    return centre + plane((lead if share else plane_x, 0.0, 0.8 * z + share * (top - z)))


def _cockpit(rng: np.random.Generator, name: str, radius: float) -> Solids:
    """Return the canopy of an airplane for one or two people."""
    if name in ("airliner", "business jet", "twin propeller", "twin boom"):
        return []
    x, length = 0.5 - rng.uniform(0.22, 0.33), rng.uniform(0.09, 0.16)
    size = (length, 0.6 * radius, rng.uniform(0.4, 0.75) * radius)
    return [bubble((x, 0.0, 0.8 * radius), size)]
