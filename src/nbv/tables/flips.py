"""What the large errors of an object have in common."""

from __future__ import annotations

import numpy as np

from nbv.core.orientations.errors import OrientationErrors
from nbv.core.orientations.group import (
    ASYMMETRIC,
    Array,
    Orientations,
    Symmetry,
    chordal_mean,
    inverse,
)

LARGE_DEG = OrientationErrors.flip_deg

CONSTANT_SHARE = 0.8
"""A constant rotation is named if its correction leaves this share of errors below `LARGE_DEG`."""

FEWEST_ALIKE = 5
"""Fewer large errors may be alike by chance."""

N_TRIED = 12
"""Pairs whose rotation is tried: one that most share is among them."""


def describe_large_errors(errors: OrientationErrors) -> str:
    """Return what most large errors share, and what to do about it; "" if it is nothing."""
    flips, symmetry = errors.is_flip, errors.symmetry
    constants = []
    for form, in_camera in (("R_true C", False), ("C R_true", True)):
        if flips.mean() < 0.5:
            break
        rotation, left_deg = shared_rotation(
            errors.estimate, errors.truth, symmetry, in_camera=in_camera
        )
        if (share := (left_deg < LARGE_DEG).mean()) >= CONSTANT_SHARE:
            constants.append(
                f"R_estimate = {form} with C = {named(rotation)} (corrected, {share:.0%} of errors "
                f"are below {LARGE_DEG:g}°, and {left_deg.mean():.1f}° on average)"
            )
    if constants:
        return (
            f"a constant rotation: {' or '.join(constants)}; nothing is corrected here, so give "
            "truths and estimates for the same axes of the model and of the camera"
        )
    if (n := int(flips.sum())) < FEWEST_ALIKE:
        return ""
    estimate, truth = errors.estimate[flips], errors.truth[flips]
    rotation, left_deg = shared_rotation(estimate, truth, symmetry)
    n_alike, shared = int((left_deg < LARGE_DEG).sum()), named(rotation)
    if n_alike <= n / 2 and symmetry is ASYMMETRIC:
        axes = _rotation_vectors(inverse(estimate) @ truth)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        axis = np.linalg.eigh(axes.T @ axes)[1][:, -1]
        n_alike = int((np.abs(axes @ axis) > np.cos(np.radians(10))).sum())
        shared = f"by different angles about {_axis_name(axis)}"
    if n_alike < max(FEWEST_ALIKE, n / 2):
        return ""
    return (
        f"{n_alike} of {n} large errors are {shared}: if the object looks the same then, give its "
        "symmetry in models_info; if not, this is the ambiguity that a further view can resolve"
    )


def shared_rotation(
    estimate: Orientations, truth: Orientations, symmetry: Symmetry, *, in_camera: bool = False
) -> tuple[Orientations, Array]:
    """Return the rotation C (3, 3) of most pairs, and the errors (n,) once it is corrected.

    `estimate` and `truth` are (n, 3, 3); estimate = truth C, or C truth if it is `in_camera`.
    """
    from scipy.spatial.transform import Rotation

    def offsets(rotation: Orientations) -> tuple[Orientations, Array]:
        corrected = rotation.T @ estimate if in_camera else estimate @ rotation.T
        near = symmetry.nearest(truth, corrected)
        offset = estimate @ inverse(near) if in_camera else inverse(near) @ estimate
        return offset, ASYMMETRIC.distance_deg(near, corrected)

    some = np.linspace(0, len(truth) - 1, N_TRIED).astype(int)
    tried = inverse(truth[some]) @ estimate[some]
    if in_camera:
        # From every pose in which the object looks the same.
        axis = np.zeros(3) if symmetry.axis is None else symmetry.axis
        turns = np.radians(np.arange(0, 360, 30))[:, None] * axis
        twins = symmetry.discrete[:, None] @ Rotation.from_rotvec(turns).as_matrix()
        tried = estimate[some] @ inverse(truth[some] @ twins.reshape(-1, 1, 3, 3))
    rotation = max(tried.reshape(-1, 3, 3), key=lambda c: np.sum(offsets(c)[1] < LARGE_DEG))
    for _ in range(3):
        offset, left_deg = offsets(rotation)
        rotation = chordal_mean(offset[left_deg < LARGE_DEG])
    return rotation, offsets(rotation)[1]


def named(rotation: Orientations) -> str:
    """Return a rotation's angle and axis, such as ``180° about z``."""
    vector = _rotation_vectors(rotation)
    angle = np.degrees(np.linalg.norm(vector))
    if angle > 175:  # about either direction of the axis
        angle = 180
    elif vector[np.abs(vector).argmax()] < 0:
        angle = -angle
    return f"{angle:.0f}° about {_axis_name(vector)}"


def _axis_name(vector: Array) -> str:
    axis = vector / np.linalg.norm(vector) * np.sign(vector[np.abs(vector).argmax()])
    if axis.max() > np.cos(np.radians(5)):
        return "xyz"[axis.argmax()]
    return " ".join(f"{number:g}" for number in axis.round(2) + 0.0)


def _rotation_vectors(rotations: Orientations) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotations).as_rotvec())
