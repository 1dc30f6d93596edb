"""Mugs: a hollow body, round or with four sides, and a handle at azimuth 270 degrees."""

from __future__ import annotations

import numpy as np
import trimesh

from nbv.data.procedural.solids import Points, fillet, join, revolve, superellipse, sweep

# Enough facets that the body does not reveal the viewpoint.
_AROUND = 96
# Distance of a handle's centre line from the wall, in heights of the mug: small, usual, large.
_DISTANCES = ((0.08, 0.15), (0.16, 0.3), (0.3, 0.52))
# Half a diagonal of a square body, in half widths: from hardly square to hardly rounded.
_CORNERS = (1.1, 1.36)


def mug(
    rng: np.random.Generator, least_reach: float = 0.0, square_share: float = 0.0
) -> trimesh.Trimesh:
    """Return a mug of height 1 on z = 0, its handle towards -y.

    Mugs are drawn until the handle's reach is at least `least_reach`. With the probability
    `square_share` the body is square, with the handle on one of its sides. Neither changes mugs
    that are round or whose first draw has the reach.
    """
    # A separate stream, so that round mugs stay the same.
    (section_rng,) = rng.spawn(1)
    is_square = section_rng.random() < square_share
    corner = float(section_rng.uniform(*_CORNERS)) if is_square else 1.0
    while handle_reach(drawn := _any_mug(rng, corner)) < least_reach:
        pass
    return drawn


def handle_reach(mesh: trimesh.Trimesh) -> float:
    """Return the handle's reach beyond the body, in widths of the body.

    It is the difference of the bounding box's sides along y and x, divided by the side along x.
    """
    across, along, _ = np.ptp(mesh.vertices, axis=0)
    return float(along / across - 1.0)


def _any_mug(rng: np.random.Generator, corner: float) -> trimesh.Trimesh:
    outer = _body_curve(rng)
    wall = rng.uniform(0.025, 0.06)
    handle = _handle(rng, outer, wall)
    cup = _cup(outer, wall, floor=rng.uniform(0.04, 0.09))
    return join([cup if corner == 1.0 else _squared(cup, corner), handle])


def _body_curve(rng: np.random.Generator) -> Points:
    """Return the outer wall as (m, 2) of (radius, height), with heights from 0 to 1."""
    height = np.linspace(0.0, 1.0, 25)
    radius = rng.uniform(0.28, 0.6) * np.ones_like(height)
    plan = rng.choice(
        ["straight", "tapered", "waisted", "barrel", "flared", "cup"],
        p=[0.4, 0.2, 0.1, 0.12, 0.09, 0.09],
    )
    if plan == "tapered":
        radius *= 1.0 + rng.uniform(-0.08, 0.3) * (height - 1.0)
    elif plan == "waisted":
        radius *= 1.0 - rng.uniform(0.05, 0.16) * np.sin(np.pi * height)
    elif plan == "barrel":
        radius *= 1.0 + rng.uniform(0.04, 0.16) * (np.sin(np.pi * height) - 1.0)
    elif plan == "flared":
        radius *= 1.0 + rng.uniform(0.05, 0.2) * (height ** rng.uniform(3.0, 6.0) - 1.0)
    elif plan == "cup":
        base = rng.uniform(0.5, 0.7)
        radius *= base + (1.0 - base) * height**0.4
    edge = rng.uniform(0.01, 0.12)
    radius *= 1.0 - 0.25 * edge / 0.12 * np.clip(1.0 - height / edge, 0.0, 1.0) ** 2
    if rng.random() < 0.15:
        lip = rng.uniform(0.04, 0.1)
        radius = radius + rng.uniform(0.01, 0.03) * (height > 1.0 - lip)
    if rng.random() < 0.15:
        foot = rng.uniform(0.03, 0.08)
        radius = radius - rng.uniform(0.02, 0.05) * (height < foot)
    return np.stack([radius, height], axis=-1)


def _cup(outer: Points, wall: float, floor: float) -> trimesh.Trimesh:
    """Return the hollow body: up the outer wall, over the rim and down the inner one."""
    rim = [[outer[-1, 0] - wall / 2, 1.0 + wall / 3]]
    inside = outer[outer[:, 1] > floor][::-1] - (wall, 0.0)
    bottom = [[0.97 * inside[-1, 0], floor]]
    return revolve(np.concatenate([outer, rim, inside, bottom]), n=_AROUND)


def _squared(body: trimesh.Trimesh, corner: float) -> trimesh.Trimesh:
    """Return a body of revolution whose circles are superellipses of the same width.

    `corner` is half their diagonal in half widths, from 1 (circles) to less than sqrt(2).
    """
    exponent = 1.0 / (0.5 - np.log2(corner))
    x, y, _ = body.vertices.T
    radius = np.hypot(x, y)
    along = np.abs([x, y]) / np.where(radius > 0.0, radius, 1.0)
    outwards = np.where(radius > 0.0, (along**exponent).sum(axis=0), 1.0) ** (-1.0 / exponent)
    vertices = body.vertices * np.stack([outwards, outwards, np.ones_like(x)], axis=-1)
    return trimesh.Trimesh(vertices, body.faces, process=False)


def _handle(rng: np.random.Generator, outer: Points, wall: float) -> trimesh.Trimesh:
    """Return the handle, its ends buried in the wall; a hook has its lower end free."""
    # From a finger ring to a tankard's handle; it determines the azimuths at which it is hidden.
    low, high = _DISTANCES[rng.choice(3, p=[0.15, 0.45, 0.4])]
    distance = rng.uniform(low, high)
    span = float(np.clip(rng.uniform(1.2, 2.6) * distance + rng.uniform(0.0, 0.2), 0.24, 0.76))
    top = rng.uniform(max(0.12 + span, 0.6), 0.94)
    heights = np.array([top, top - span])
    radii = np.interp(heights, outer[:, 1], outer[:, 0])
    style = str(rng.choice(["round", "square", "d", "ear"], p=[0.3, 0.25, 0.2, 0.25]))
    side = _handle_curve(rng, style, distance, span)
    ends = radii - 0.5 * wall
    # Straight between the two ends of the wall, plus the handle's distance from it.
    t = np.linspace(0.0, 1.0, len(side))[:, None]
    along = (side[:, 1:] - side[:1, 1:]) / (side[-1:, 1:] - side[:1, 1:])
    out = ends[0] + (ends[1] - ends[0]) * np.clip(along, 0.0, 1.0) + side[:, :1]
    up = top + side[:, 1:] - side[:1, 1:]
    path = np.concatenate([np.zeros_like(t), -out, up], axis=1)
    half_width = np.exp(rng.uniform(np.log(0.015), np.log(0.13)))
    half_thick = min(np.exp(rng.uniform(np.log(0.013), np.log(0.055))), 0.35 * distance)
    outline = superellipse(half_width, half_thick, rng.uniform(2.0, 5.0), n=20)
    swell = 1.0 + rng.uniform(0.0, 0.5) * np.abs(2.0 * t[:, 0] - 1.0) ** 3
    hook = style in ("round", "ear") and rng.random() < 0.12
    kept = int(rng.uniform(0.7, 0.9) * len(path)) if hook else len(path)
    return sweep(path[:kept], outline, (1.0, 0.0, 0.0), scale=swell[:kept])


def _handle_curve(rng: np.random.Generator, style: str, distance: float, span: float) -> Points:
    """Return the handle's centre line as (m, 2) of (distance from the wall, height)."""
    if style == "round":
        angle = np.linspace(0.5 * np.pi, -0.5 * np.pi, 25)
        return np.stack([distance * np.cos(angle), span / 2 * np.sin(angle)], axis=-1)
    if style == "ear":
        angle = np.linspace(0.5 * np.pi, -0.5 * np.pi, 25)
        droop = 1.0 + rng.uniform(0.2, 0.45) * np.sin(angle)
        out = distance * np.cos(angle) ** rng.uniform(0.6, 1.0) * droop / droop.max()
        return np.stack([out, span / 2 * np.sin(angle)], axis=-1)
    lean = rng.uniform(0.0, 0.12) if style == "square" else rng.uniform(0.15, 0.3)
    corners = [
        [0, 0, span / 2],
        [distance, 0, span * (0.5 - lean / 2)],
        [distance, 0, -span * (0.5 - lean)],
        [0, 0, -span / 2],
    ]
    radius = rng.uniform(0.04, 0.1) if style == "square" else 0.3
    return fillet(corners, radius, n=9)[:, [0, 2]]
