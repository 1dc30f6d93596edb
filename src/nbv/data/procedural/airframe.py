"""Parts of airplanes: wing panels, engine pods, propellers, wheels and stores."""

from __future__ import annotations

import math

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from nbv.data.procedural.assembly import both_sides, moved, turned
from nbv.data.procedural.solids import Solids, box, loft, revolve, superellipse, tube


def panel(leading: ArrayLike, chords: ArrayLike, thickness: float) -> trimesh.Trimesh:
    """Return a wing-like panel.

    Parameters
    ----------
    leading : array_like
        (m, 3): points of the leading edge, in one line as seen along x.
    chords : array_like
        (m,): from the leading edge towards -x.
    thickness : float
        In chords.

    Returns
    -------
    trimesh.Trimesh
        The panel, blunt in front and sharp behind.
    """
    edge, chord = np.asarray(leading, dtype=np.float64), np.asarray(chords, dtype=np.float64)
    across = np.cross((1.0, 0.0, 0.0), edge[-1] - edge[0])
    across /= math.hypot(*across)
    angle = 2 * np.pi * np.arange(20) / 20
    back = 0.5 - 0.5 * np.cos(angle)
    thick = 0.5 * thickness * np.sin(angle) * (1.25 - 0.75 * back)
    section = back[:, None] * (-1.0, 0.0, 0.0) + thick[:, None] * across
    return loft(edge[:, None] + chord[:, None, None] * section)


def wing(
    root: ArrayLike, half_span: float, chord: float, taper: float, sweep: float, rise: float
) -> trimesh.Trimesh:
    """Return the panel from `root`, (3,), towards +y; sweep and rise are slopes (tangents)."""
    span = np.array([0.0, 0.35, 1.0])[:, None] * half_span
    leading = np.asarray(root, dtype=np.float64) + span * (-sweep, 1.0, rise)
    return panel(leading, chord * np.array([1.0, 1.0 - 0.55 * (1.0 - taper), taper]), 0.11)


def jet_pod(centre: ArrayLike, radius: float, length: float) -> trimesh.Trimesh:
    """Return an engine with an open intake at its +x end."""
    barrel = [[0.55, -0.5], [0.9, -0.2], [1.0, 0.1], [0.98, 0.35]]
    intake = [[0.85, 0.5], [0.68, 0.47], [0.64, 0.25]]
    profile = np.array(barrel + intake) * (radius, length)
    return revolve(profile, n=20, axis="x", centre=centre)


def hung_jet(rng: np.random.Generator, leading: np.ndarray, radius: float) -> Solids:
    """Return a jet on a pylon under the leading edge at `leading`, (3,)."""
    size, length = radius * rng.uniform(0.5, 0.65), rng.uniform(0.09, 0.13)
    pod = leading + np.array([0.035, 0.0, -1.25 * size])
    pylon = panel(
        [pod + np.array([0.01, 0, 0]), leading - np.array([0.015, 0, 0])], [0.08, 0.1], 0.08
    )
    return [jet_pod(pod, size, length), pylon]


def wing_propeller(rng: np.random.Generator, leading: np.ndarray) -> Solids:
    """Return a propeller engine in the wing at `leading`, (3,)."""
    pod = leading - np.array([0.02, 0.0, 0.0])
    body = [[0.008, -0.13], [0.024, -0.04], [0.026, 0.05], [0.015, 0.09]]
    hub = pod + np.array([0.09, 0.0, 0.0])
    return [
        revolve(body, n=16, axis="x", centre=pod),
        *propeller(rng, hub, rng.uniform(0.07, 0.1)),
    ]


def propeller(rng: np.random.Generator, hub: ArrayLike, reach: float, way: int = 1) -> Solids:
    """Return a spinner pointing to `way` x, and two or four blades, mirror-symmetric in y."""
    x, y, z = np.asarray(hub, dtype=np.float64)
    spinner = np.array([[0.075, -0.02], [0.075, 0.0], [0.06, 0.17], [0.04, 0.28], [0.01, 0.31]])
    cone = revolve(spinner * (reach, way * reach), n=16, axis="x", centre=(x, y, z))
    blade = box((x + 0.01 * way, y, z), (0.012, 0.024, 2 * reach), exponent=3.0, bevel=0.01)
    if rng.random() < 0.6:
        return [cone, blade, turned(blade, 90.0, "x", (x, y, z))]
    return [cone, blade]


def store(rng: np.random.Generator, hook: np.ndarray) -> trimesh.Trimesh:
    """Return a tank or missile hanging from a point, (3,), of a wing."""
    length, radius = rng.uniform(0.1, 0.24), rng.uniform(0.008, 0.02)
    shape = np.array([[0.3, -0.5], [1.0, -0.25], [1.0, 0.25], [0.6, 0.42], [0.1, 0.5]])
    centre = hook - (rng.uniform(0.0, 0.06), 0.0, 1.3 * radius)
    return revolve(shape * (radius, length), n=16, axis="x", centre=centre)


def bubble(centre: ArrayLike, size: ArrayLike) -> trimesh.Trimesh:
    """Return an ellipsoid, as of a cockpit; `size` holds its semi-axes, (3,)."""
    angle = np.linspace(0.05, np.pi - 0.05, 13)
    ball = revolve(np.stack([np.sin(angle), -np.cos(angle)], axis=-1), n=20, axis="x")
    ball.vertices *= np.asarray(size, dtype=np.float64)
    return moved(ball, centre)


def landing_gear(rng: np.random.Generator, radius: float) -> Solids:
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


def floats(rng: np.random.Generator, radius: float) -> Solids:
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
