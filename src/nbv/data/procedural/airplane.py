"""Airplanes: airliners, business jets, fighters, light and twin propeller craft, and oddities.

Lengths are in fuselage lengths; the nose is at x = 0.5 and the fuselage's axis at z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.solids import (
    Points,
    Solids,
    both_sides,
    box,
    centred,
    join,
    loft,
    moved,
    revolve,
    rotated,
    stack_outlines,
    superellipse,
    tube,
)

Range = tuple[float, float]


@dataclass(frozen=True)
class _Plan:
    """Ranges of a type's dimensions, and the kinds of its tail and engines.

    `wing_x` is where the wing's leading edge leaves the fuselage; `wing_heights` are in fuselage
    radii. A kind listed twice is twice as likely.
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
        parts += _propeller(rng, (0.496, 0.0, 0.0), rng.uniform(0.11, 0.16))
    elif engines == "pusher":
        parts += _propeller(rng, (-0.496, 0.0, rise * radius), rng.uniform(0.1, 0.15), sign=-1)
    if name in ("light", "biplane") and rng.random() < 0.2:
        parts += _floats(rng, radius)
    elif rng.random() < (0.8 if engines == "nose" else 0.15):
        parts += _landing_gear(rng, radius)
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
    parts = [_wing(root, half_span, chord, taper, sweep, rise)]
    tip = root + half_span * slope
    if name == "biplane":
        up = np.array([rng.uniform(0.0, 0.05), 0.0, rng.uniform(2.0, 2.5) * radius])
        parts += [_wing(root + up, half_span, chord, taper, sweep, rise)]
        for y in (0.12, 0.7 * half_span):
            foot = root + y * slope - (0.3 * chord, 0.0, 0.0)
            parts += [tube([foot, foot + up], 0.007, n=8)]
    elif engines[:-1] in ("jet", "prop"):
        for part in (0.36,) if engines[-1] == "2" else (0.32, 0.62):
            edge = root + part * half_span * slope
            jet = engines.startswith("jet")
            parts += _hung_jet(rng, edge, radius) if jet else _wing_propeller(rng, edge)
    elif name != "flying wing" and rng.random() < 0.3:
        end = np.array([-0.03, 0.005, 0.06])
        parts += [_panel([tip, tip + end], [chord * taper, 0.6 * chord * taper], 0.08)]
    if rng.random() < plan.stores:
        for part in rng.uniform(0.25, 1.0, int(rng.integers(1, 4))):
            hook = root + part * half_span * slope
            parts += [_store(rng, hook - (0.3 * chord * (1.0 - part), 0.0, 0.0))]
    return both_sides(parts), tip


def _rear_jets(rng: np.random.Generator, radius: float) -> Solids:
    size, length = radius * rng.uniform(0.45, 0.6), rng.uniform(0.12, 0.17)
    pod = np.array([-0.24, radius + 0.9 * size, 0.45 * radius])
    edge = pod + np.array([0.04, 0.0, 0.0])
    pylon = _panel([edge * (1.0, 0.0, 1.0), edge], [0.09, 0.09], 0.12)
    return both_sides([_jet_pod(pod, size, length), pylon])


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
        return _panel(np.stack([foot, head]), [chord, taper * chord], 0.09)

    def plane(root: ArrayLike, size: float = 1.0) -> Solids:
        return both_sides([_wing(root, size * span, plane_chord, taper, 0.75 * sweep, rise)])

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
        edge = end + 0.9 * plane_chord
        across = _panel([(edge, 0.0, level), (edge, y, level)], [plane_chord, plane_chord], 0.1)
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
    return [_bubble((x, 0.0, 0.8 * radius), size)]


def _panel(leading: ArrayLike, chords: ArrayLike, thickness: float) -> trimesh.Trimesh:
    """Return a wing-like panel, blunt in front and sharp behind.

    `leading` (m, 3) are points of the leading edge, in one line as seen along x, `chords` (m,)
    extend from it towards -x, and the thickness is in chords.
    """
    edge, chord = np.asarray(leading, dtype=np.float64), np.asarray(chords, dtype=np.float64)
    across = np.cross((1.0, 0.0, 0.0), edge[-1] - edge[0])
    across /= math.hypot(*across)
    angle = 2 * np.pi * np.arange(20) / 20
    back = 0.5 - 0.5 * np.cos(angle)
    thick = 0.5 * thickness * np.sin(angle) * (1.25 - 0.75 * back)
    section = back[:, None] * (-1.0, 0.0, 0.0) + thick[:, None] * across
    return loft(edge[:, None] + chord[:, None, None] * section)


def _wing(
    root: ArrayLike, half_span: float, chord: float, taper: float, sweep: float, rise: float
) -> trimesh.Trimesh:
    """Return the panel from `root`, (3,), towards +y; sweep and rise are slopes (tangents)."""
    span = np.array([0.0, 0.35, 1.0])[:, None] * half_span
    leading = np.asarray(root, dtype=np.float64) + span * (-sweep, 1.0, rise)
    return _panel(leading, chord * np.array([1.0, 1.0 - 0.55 * (1.0 - taper), taper]), 0.11)


def _jet_pod(centre: ArrayLike, radius: float, length: float) -> trimesh.Trimesh:
    """Return an engine with an open intake at its +x end."""
    barrel = [[0.55, -0.5], [0.9, -0.2], [1.0, 0.1], [0.98, 0.35]]
    intake = [[0.85, 0.5], [0.68, 0.47], [0.64, 0.25]]
    profile = np.array(barrel + intake) * (radius, length)
    return revolve(profile, n=20, axis="x", centre=centre)


def _hung_jet(rng: np.random.Generator, leading: np.ndarray, radius: float) -> Solids:
    """Return a jet on a pylon under the leading edge at `leading`, (3,)."""
    size, length = radius * rng.uniform(0.5, 0.65), rng.uniform(0.09, 0.13)
    pod = leading + np.array([0.035, 0.0, -1.25 * size])
    pylon = _panel(
        [pod + np.array([0.01, 0, 0]), leading - np.array([0.015, 0, 0])], [0.08, 0.1], 0.08
    )
    return [_jet_pod(pod, size, length), pylon]


def _wing_propeller(rng: np.random.Generator, leading: np.ndarray) -> Solids:
    """Return a propeller engine in the wing at `leading`, (3,)."""
    pod = leading - np.array([0.02, 0.0, 0.0])
    body = [[0.008, -0.13], [0.024, -0.04], [0.026, 0.05], [0.015, 0.09]]
    hub = pod + np.array([0.09, 0.0, 0.0])
    return [
        revolve(body, n=16, axis="x", centre=pod),
        *_propeller(rng, hub, rng.uniform(0.07, 0.1)),
    ]


def _propeller(rng: np.random.Generator, hub: ArrayLike, reach: float, sign: int = 1) -> Solids:
    """Return a spinner towards `sign` x, and two or four blades, mirror-symmetric in y."""
    x, y, z = np.asarray(hub, dtype=np.float64)
    spinner = np.array([[0.075, -0.02], [0.075, 0.0], [0.06, 0.17], [0.04, 0.28], [0.01, 0.31]])
    cone = revolve(spinner * (reach, sign * reach), n=16, axis="x", centre=(x, y, z))
    blade = box((x + 0.01 * sign, y, z), (0.012, 0.024, 2 * reach), exponent=3.0, bevel=0.01)
    if rng.random() < 0.6:
        return [cone, blade, rotated(blade, 90.0, "x", (x, y, z))]
    return [cone, blade]


def _store(rng: np.random.Generator, hook: np.ndarray) -> trimesh.Trimesh:
    """Return a tank or missile hanging from a point, (3,), of a wing."""
    length, radius = rng.uniform(0.1, 0.24), rng.uniform(0.008, 0.02)
    shape = np.array([[0.3, -0.5], [1.0, -0.25], [1.0, 0.25], [0.6, 0.42], [0.1, 0.5]])
    centre = hook - (rng.uniform(0.0, 0.06), 0.0, 1.3 * radius)
    return revolve(shape * (radius, length), n=16, axis="x", centre=centre)


def _bubble(centre: ArrayLike, size: ArrayLike) -> trimesh.Trimesh:
    """Return an ellipsoid, such as a cockpit, with the semi-axes `size`, (3,)."""
    angle = np.linspace(0.05, np.pi - 0.05, 13)
    ball = revolve(np.stack([np.sin(angle), -np.cos(angle)], axis=-1), n=20, axis="x")
    ball.vertices *= np.asarray(size, dtype=np.float64)
    return moved(ball, centre)


def _landing_gear(rng: np.random.Generator, radius: float) -> Solids:
    """Return two main wheels, and a third at the nose or under the tail, on their struts."""
    drop, track = rng.uniform(1.6, 2.1) * radius, rng.uniform(0.08, 0.13)
    size = rng.uniform(0.02, 0.035)
    third = float(rng.choice([0.33, -0.44]))
    disc = np.array([[0.6, -0.35], [1.0, -0.2], [1.0, 0.2], [0.6, 0.35]]) * size
    foot = np.array([0.08, track, -drop])
    main = [
        tube(np.array([[0.08, 0.03, -0.5 * radius], foot]), 0.008, n=8),
        revolve(disc, n=20, axis="y", centre=foot),
    ]
    end = (third, 0.0, -drop if third > 0 else -0.9 * radius)
    return [
        *both_sides(main),
        tube([(third, 0.0, 0.0), end], 0.008, n=8),
        revolve(0.8 * disc, n=20, axis="y", centre=end),
    ]


def _floats(rng: np.random.Generator, radius: float) -> Solids:
    """Return a seaplane's two floats on their struts."""
    y, z = rng.uniform(0.1, 0.14), -rng.uniform(2.2, 2.8) * radius
    t = np.linspace(0.0, 1.0, 13)
    size = 0.032 * np.minimum(1.0, 0.35 + 2.6 * np.minimum(t, 1.0 - t))
    rings = np.zeros((13, 16, 3))
    rings[..., 0] = (0.42 - 0.72 * t)[:, None]
    rings[..., 1:] = size[:, None, None] * superellipse(0.9, 1.0, 3.0, n=16)
    rings += np.array([0.0, y, z])
    struts = [tube([(x, 0.02, -0.4 * radius), (x, y, z)], 0.008, n=8) for x in (0.25, -0.02)]
    return both_sides([loft(rings), *struts])
