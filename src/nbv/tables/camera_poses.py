"""Camera poses that contradict the places where they see the object, or do not see it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from nbv.core.orientations.group import Array, Orientations, Symmetry, inverse
from nbv.errors import UserError

TOLD, AGREEING = 0.2, 0.05
"""Shares of the viewing distance: by more, views contradict each other; within, they agree."""

TURNED_DEG = 20.0
"""Orientations in the base frame that differ by more contradict each other, unless one is a flip;
those by less than half agree."""

OFF_AXIS_DEG, ON_AXIS_DEG = 45.0, 15.0
"""Median angles from candidates' optical axes to an object: more is a mistake, less is none."""

IN_CAMERA = (
    "candidates are taken to be in the present camera's frame: if they are in the base frame, give "
    "`camera_pose`"
)

OPTICAL = "+z forward, +y down"
AXES = {OPTICAL: "", "-z forward, -y down": "OpenGL's", "+x forward, -z down": "a ROS body's"}
"""Likely axes of a camera, and what they are called."""

RIGHT = "give those of the optical frame (z forward, y down), camera to base, in metres"
INVERTED = "inverted (base to camera)"
WAYS = ("", INVERTED, "with transposed rotations")
UNITS = {"": 1.0, "in millimetres": 1e-3, "in centimetres": 1e-2}
HANDS = {"": 1.0, "left-handed (Unity's)": -1.0}


def contradictions(
    poses: Array, seen_m: Array, orientations: Orientations, symmetry: Symmetry
) -> list[str]:
    """Return a warning where views contradict each other in the base frame.

    Poses (n, 4, 4) are camera to base; `seen_m` (n, 3) and `orientations` (n, 3, 3) are of the
    object in each camera. Where the object is seen tells most mistakes. A mirrored frame moves an
    object on the optical axis little, but turns it. Where poses of another convention would agree,
    a UserError names it.
    """
    distance_m = np.linalg.norm(seen_m, axis=1).mean()

    def apart(rotation: Orientations, origin: Array) -> tuple[Array, float]:
        places = (rotation @ seen_m[:, :, None])[..., 0] + origin
        seen = rotation @ orientations
        share = np.linalg.norm(places - places[0], axis=1) / distance_m
        return share, float(symmetry.distance_deg(seen, seen[0]).max())

    share, apart_deg = apart(poses[:, :3, :3], poses[:, :3, 3])
    most, is_told = float(share.max()), bool(share.max() > TOLD)
    if not is_told and (most <= AGREEING or apart_deg <= TURNED_DEG):
        return []
    what = (
        f"views 0 and {share.argmax()} place the object {most * distance_m:.2f} m apart in the "
        f"base frame, {most:.0%} of the viewing distance"
    )
    for name, rotation, origin in _conventions(poses):
        other, other_deg = apart(rotation, origin)
        agree = f"{what}; they agree if camera poses are {name}: {RIGHT}"
        if is_told and other.max() <= AGREEING:
            raise UserError(agree)
        # Poses that are taken to be in millimetres are always near each other.
        if other.max() <= min(most / 3, TOLD) and other_deg <= TURNED_DEG / 2:
            return [agree]
    return [f"{what}: do they see the same instance, and are the camera poses right?"] * is_told


def not_seeing(poses: Array, camera: Array, seen_m: Array, *, in_base: bool) -> list[str]:
    """Return a warning where most candidates (n, 4, 4) do not see the object.

    It is at `seen_m` (3,) in a camera (4, 4), whose pose is known if poses are `in_base`. A
    UserError says so where the object is behind most candidates, or they see it if poses of the
    base frame are of another convention, which it names.
    """
    every = np.concatenate([poses, camera[None]])
    is_camera = np.arange(len(every))[:, None] == len(poses)

    def off_deg(rotation: Orientations, origin: Array) -> tuple[Array, float]:
        rays = rotation[-1] @ seen_m + origin[-1] - origin[:-1]
        cosine = (rays * rotation[:-1, :, 2]).sum(axis=1) / np.linalg.norm(rays, axis=1)
        angles = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        return angles, float(np.sort(angles)[(len(angles) - 1) // 2])

    rotation, origin = every[:, :3, :3], every[:, :3, 3]
    angles, median_deg = off_deg(rotation, origin)
    if median_deg <= OFF_AXIS_DEG:
        return []
    what = (
        f"candidate {angles.argmax()}: the object is {angles.max():.0f}° off the optical axis, "
        f"{median_deg:.0f}° in the median of candidates"
    )
    whose = {
        "candidates are": ~is_camera,
        "`camera_pose` is": is_camera,
        "they and `camera_pose` are": is_camera | True,
    }
    for name, turned, moved in _conventions(every) if in_base else ():
        for who, of in whose.items():
            mixed = np.where(of[:, None], turned, rotation), np.where(of, moved, origin)
            if off_deg(*mixed)[1] < ON_AXIS_DEG:
                raise UserError(f"{what}; it is near the axis if {who} {name}: {RIGHT}")
    told = f"{what}: do they see it, and is `camera_pose` right? {RIGHT}"
    told = told if in_base else f"{what}; {IN_CAMERA}"
    if median_deg >= 90:
        raise UserError(told)
    return [told]


def _conventions(poses: Array) -> Iterator[tuple[str, Orientations, Array]]:
    """Yield what poses may be by mistake, likely mistakes first, and then the right ones."""
    from scipy.spatial.transform import Rotation

    turns = {}
    for matrix in Rotation.create_group("O").as_matrix().round():
        down, forward = ("+-"[int(v.sum() < 0)] + "xyz"[np.abs(v).argmax()] for v in matrix.T[1:])
        turns[f"{forward} forward, {down} down"] = matrix
    tried = sorted(
        product(WAYS, UNITS, HANDS, turns),
        key=lambda each: sum(map(bool, each[:3])) + (each[3] != OPTICAL) + (each[3] not in AXES),
    )
    for way, unit, hand, axes in tried[1:]:
        mirror = np.diag([1, HANDS[hand], 1])
        rotation = mirror @ poses[:, :3, :3] @ mirror
        origin = UNITS[unit] * poses[:, :3, 3] @ mirror
        rotation = inverse(rotation) if way else rotation
        origin = -(rotation @ origin[:, :, None])[..., 0] if way == INVERTED else origin
        of_axes = "" if axes == OPTICAL else f"{AXES.get(axes, 'of other axes')} ({axes})"
        names = [name for name in (way, unit, hand, of_axes) if name]
        yield " and ".join(names), rotation @ turns[axes], origin
