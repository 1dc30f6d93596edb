"""What the large errors of an object have in common."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from nbv.core.orientations.errors import OrientationErrors
from nbv.core.orientations.group import ASYMMETRIC, Array, Orientations, chordal_mean, inverse

CONSTANT_SHARE = 0.8
"""A constant rotation is named if its correction leaves this share of errors below 20°."""

FEWEST_ALIKE = 5
"""Fewer large errors may be alike by chance."""


def describe_large_errors(errors: OrientationErrors) -> str:
    """Return what most large errors share, and what to do about it; "" if it is nothing."""
    flips, constants = errors.is_flip, []
    sides = {"R_true C": False, "C R_true": True} if flips.mean() > 0.5 else {}
    for form, in_camera in sides.items():
        rotation, left_deg = shared_rotation(errors, in_camera=in_camera)
        if (share := (left_deg < errors.flip_deg).mean()) >= CONSTANT_SHARE:
            constants.append(
                f"R_estimate = {form} with C = {named(rotation)} (corrected, {share:.0%} of errors "
                f"are below {errors.flip_deg:g}°, and {left_deg.mean():.1f}° on average)"
            )
    if constants:
        return (
            f"a constant rotation: {' or '.join(constants)}; nothing is corrected here, so give "
            "truths and estimates for the same axes of the model and of the camera"
        )
    large = replace(errors, estimate=errors.estimate[flips], truth=errors.truth[flips])
    if (n := len(large.truth)) < FEWEST_ALIKE:
        return ""
    rotation, left_deg = shared_rotation(large)
    n_alike, shared = int((left_deg < errors.flip_deg).sum()), named(rotation)
    if n_alike <= n / 2:
        near = errors.symmetry.nearest(large.truth, large.estimate)
        axes = Rotation.from_matrix(inverse(large.estimate) @ near).as_rotvec()
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        axis = np.linalg.eigh(axes.T @ axes)[1][:, -1]
        n_alike = int((np.abs(axes @ axis) > np.cos(np.radians(10))).sum())
        shared = f"by different angles about {_axis_name(axis)}"
    if n_alike < max(FEWEST_ALIKE, n // 2 + 1):
        return ""
    return (
        f"{n_alike} of {n} large errors are {shared}: if the object looks the same then, give its "
        "symmetry in models_info; if not, this is the ambiguity that a further view can resolve"
    )


def shared_rotation(
    errors: OrientationErrors, *, in_camera: bool = False
) -> tuple[Orientations, Array]:
    """Return the rotation C (3, 3) of most pairs, and the errors (n,) once it is corrected.

    The estimate is truth C on the model's side, or C truth `in_camera`.
    """
    estimate, truth, symmetry = errors.estimate, errors.truth, errors.symmetry

    def offsets(rotation: Orientations) -> tuple[Orientations, Array]:
        corrected = rotation.T @ estimate if in_camera else estimate @ rotation.T
        near = symmetry.nearest(truth, corrected)
        offset = estimate @ inverse(near) if in_camera else inverse(near) @ estimate
        return offset, ASYMMETRIC.distance_deg(near, corrected)

    # A rotation that most pairs share is that of one of 12.
    some = np.linspace(0, len(truth) - 1, 12).astype(int)
    tried = inverse(truth[some]) @ estimate[some]
    if in_camera:
        # From every pose in which the object looks the same.
        axis = np.zeros(3) if symmetry.axis is None else symmetry.axis
        about = Rotation.from_rotvec(np.outer(np.arange(0, 360, 30), axis), degrees=True)
        twins = (symmetry.discrete[:, None] @ about.as_matrix()).reshape(-1, 1, 3, 3)
        tried = estimate[some] @ inverse(truth[some] @ twins)
    rotation = max(tried.reshape(-1, 3, 3), key=lambda c: np.sum(offsets(c)[1] < errors.flip_deg))
    for _ in range(3):
        offset, left_deg = offsets(rotation)
        rotation = chordal_mean(offset[left_deg < errors.flip_deg])
    return rotation, offsets(rotation)[1]


def named(rotation: Orientations) -> str:
    """Return a rotation's angle and axis, such as ``180° about z``."""
    vector = Rotation.from_matrix(rotation).as_rotvec(degrees=True)
    angle = float(np.linalg.norm(vector))
    if angle > 175:  # about either direction of the axis
        angle = 180.0
    elif vector[np.abs(vector).argmax()] < 0:
        angle = -angle
    return f"{angle:.0f}° about {_axis_name(vector)}"


def _axis_name(vector: Array) -> str:
    axis = vector / np.linalg.norm(vector) * np.sign(vector[np.abs(vector).argmax()])
    if axis.max() > np.cos(np.radians(5)):
        return "xyz"[axis.argmax()]
    return " ".join(f"{number:g}" for number in axis.round(2) + 0.0)
