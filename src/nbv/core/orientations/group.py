"""Orientations, elements of SO(3), modulo the symmetry of an object.

A pose is an orientation R (3, 3) from the object's axes to the camera's, x right, y down, z forward
(BOP's convention). A camera that moves by M sees the pose M R. An object looks the same in R and in
R g for each element g of its symmetry group; every function here gives the same answer for both.
Arrays of orientations are (..., 3, 3) float64.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.errors import UserError
from nbv.numbers import ORIENTATION_TOLERANCE, as_orientations

Array = NDArray[np.float64]
Orientations = NDArray[np.float64]
Floats = NDArray[np.floating]

MOST_ELEMENTS = 60
"""Orientations of an icosahedron, the largest finite group that is not that of a prism."""

SYMMETRIES = ("symmetries_discrete", "symmetries_continuous")
"""Keys of BOP's models_info for an object's symmetries; other keys are not about them."""

NEARLY_DEG = 0.1
"""A rotation as near to k / n turns is one by k / n turns, n up to `MOST_ELEMENTS`: any two of
these are farther apart."""

VOLUME = np.pi**2
"""Volume of SO(3); densities are per unit of it."""

_SAME = 1e-4  # Difference of traces below which two elements are the same: 0.6 degrees.


def inverse(orientations: Orientations) -> Orientations:
    """Return the inverse orientations (..., 3, 3)."""
    return np.swapaxes(orientations, -1, -2)


def viewing_direction(orientations: Orientations) -> Array:
    """Return the direction (..., 3) from which the object is seen, a unit vector on its axes."""
    return np.asarray(-orientations[..., 2, :])


def along_ray(translation: ArrayLike) -> Orientations:
    """Return the rotation (..., 3, 3) that puts an object at `translation` on the optical axis.

    `translation` (..., 3) is the object's position in the camera, z > 0. The pose of an object off
    the image's centre, multiplied by this from the left, depends on the direction from which the
    object is seen and on the camera's roll alone.
    """
    ray = np.asarray(translation, dtype=np.float64)
    ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    x, y, z = np.moveaxis(ray, -1, 0)
    # The smallest rotation that takes the ray to the optical axis.
    k = 1 / (1 + z)
    rows = [[1 - k * x * x, -k * x * y, -x], [-k * x * y, 1 - k * y * y, -y], [x, y, z]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def spiral(n: int) -> Orientations:
    """Return n nearly uniform orientations (n, 3, 3): super-Fibonacci spirals (Alexa, 2022)."""
    s = np.arange(n) + 0.5
    inner, outer = np.sqrt(s / n), np.sqrt(1 - s / n)
    alpha, beta = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / 1.533751168755204288118041
    parts = (inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta))
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.stack([*parts, outer * np.cos(beta)], axis=-1)).as_matrix()


_OBLIQUE = np.array([0.35, 0.55, 0.76])


@dataclass(frozen=True)
class Symmetry:
    """The rotations g under which an object looks the same: R and R g are one pose.

    Attributes
    ----------
    discrete : ndarray (n, 3, 3)
        A finite group; the first is the identity.
    axis : ndarray (3,) or None
        A unit vector. Every rotation about it belongs to the group too; `discrete` then maps it
        to itself or its opposite.
    """

    discrete: Orientations
    axis: Array | None = None

    @classmethod
    def from_bop(cls, entry: Mapping[str, Any]) -> Symmetry:
        """Return the symmetry of an object's entry in BOP's ``models_info.json``.

        An entry without `SYMMETRIES` is asymmetric. A discrete symmetry by nearly the n-th part of
        a turn, such as one with three decimals, is taken to be by exactly that. Raise UserError if
        a key is like one of `SYMMETRIES`, a symmetry is no rotation, the rotations form no group
        of a solid, or the object has more than one axis of continuous symmetry.
        """
        for key in entry:
            if key not in SYMMETRIES and re.search("sym|discrete|continuous", key.lower()):
                raise UserError(f"{key!r} is no key of BOP: give {' or '.join(SYMMETRIES)}")
        generators = []
        given = entry.get("symmetries_discrete", ())
        for matrix in [given] if np.size(given) == 16 else given:
            if np.size(matrix) != 16:
                raise UserError("symmetries_discrete has a matrix without 16 numbers")
            corner = np.reshape(matrix, (4, 4))[:3, :3]
            generators.append(_n_fold(as_orientations(corner, "a matrix of symmetries_discrete")))
        axes = entry.get("symmetries_continuous", ())
        axes = [axes] if isinstance(axes, Mapping) else axes
        if any(each.get("axis") != axes[0].get("axis") for each in axes[1:]):
            raise UserError(
                "symmetries_continuous has more than one axis: a sphere has no orientation"
            )
        group = _closed(generators)
        if not axes:
            return cls(group)
        axis = np.asarray(axes[0].get("axis", ()), dtype=np.float64)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise UserError("symmetries_continuous has an axis without three numbers")
        axis = axis / np.linalg.norm(axis)
        images = group @ axis
        if (np.abs(images @ axis) < 1 - ORIENTATION_TOLERANCE).any():
            raise UserError("symmetries_discrete moves the axis of symmetries_continuous")
        # Up to rotations about the axis, an element keeps the axis or flips it.
        flips = images @ axis < 0
        return cls(group[[0, int(np.argmax(flips))]] if flips.any() else group[:1], axis)

    def cosine(self, first: Floats, second: Floats) -> Floats:
        """Return the cosine of the smallest angle between all poses (n, 3, 3) and (m, 3, 3)."""
        if self.axis is not None:
            images = [second @ (g @ self.axis) for g in self.discrete]
            cosine = _largest(first @ self.axis, images)
        else:
            flat = first.reshape(len(first), 9)
            cosine = _largest(flat, [(second @ g).reshape(len(second), 9) for g in self.discrete])
            cosine -= 1
            cosine /= 2
        np.clip(cosine, -1, 1, out=cosine)
        return np.asarray(cosine)

    def distance_deg(self, first: Orientations, second: Orientations) -> Array:
        """Return the smallest angle between poses (..., 3, 3), in [0, 180], pair by pair."""
        first, second = np.broadcast_arrays(first, second)
        near = self.nearest(second.reshape(-1, 3, 3), first.reshape(-1, 3, 3))
        return _angle_deg(inverse(first.reshape(-1, 3, 3)) @ near).reshape(first.shape[:-2])

    def nearest(self, orientations: Orientations, target: Orientations) -> Orientations:
        """Return the R g (n, 3, 3) nearest to the target over all g, pair by pair."""
        images = orientations[:, None] @ self.discrete
        if self.axis is not None:
            q = inverse(target)[:, None] @ images
            p1, p2 = _across(self.axis)
            sine = np.einsum("i,ndij,j->nd", p1, q, p2) - np.einsum("i,ndij,j->nd", p2, q, p1)
            cosine = np.einsum("i,ndij,j->nd", p1, q, p1) + np.einsum("i,ndij,j->nd", p2, q, p2)
            images = images @ _about(self.axis, np.arctan2(sine, cosine))
        best = np.einsum("nij,ndij->nd", target, images).argmax(axis=1)
        return np.asarray(images[np.arange(len(images)), best])

    def canonical(self, orientations: Orientations) -> Orientations:
        """Return the same R g (n, 3, 3) for every R g of a pose, whatever the camera's roll.

        It is the one that is seen from nearest to a direction in which no group has a symmetry.
        """
        oblique = np.broadcast_to(_OBLIQUE, (len(orientations), 3))
        return orientations @ self.towards(oblique, orientations)

    def direction_cosine(self, first: Floats, second: Floats) -> Floats:
        """Return the cosine of the smallest angle between all directions (n, 3) and (m, 3)."""
        if self.axis is None:
            return _largest(first, [second @ g.astype(second.dtype) for g in self.discrete])
        along, images = first @ self.axis, second @ (self.discrete @ self.axis).T
        across = np.sqrt(np.maximum(0, 1 - along**2))
        images_across = np.sqrt(np.maximum(0, 1 - images**2))
        products = along[:, None, None] * images + across[:, None, None] * images_across
        return np.asarray(products.max(axis=-1))

    def towards(self, directions: Array, orientations: Orientations) -> Orientations:
        """Return the g (n, 3, 3) with which R g is seen from nearest to a direction (n, 3)."""
        elements = np.broadcast_to(self.discrete, (len(orientations), *self.discrete.shape))
        if self.axis is not None:
            p1, p2 = _across(self.axis)
            seen = viewing_direction(orientations[:, None] @ elements)
            angle = np.arctan2(seen @ p2, seen @ p1)
            angle = angle - np.arctan2(directions @ p2, directions @ p1)[:, None]
            elements = elements @ _about(self.axis, angle)
        seen = viewing_direction(orientations[:, None] @ elements)
        best = np.einsum("nj,ndj->nd", directions, seen).argmax(axis=1)
        return np.asarray(elements[np.arange(len(elements)), best])

    def mean(self, orientations: Orientations) -> Orientations:
        """Return the mean pose (3, 3) of (n, 3, 3), each taken nearest to the first.

        The mean of two poses is halfway between them, or the first where they are 180° apart.
        """
        near = self.nearest(orientations, np.broadcast_to(orientations[0], orientations.shape))
        return chordal_mean(near)


ASYMMETRIC = Symmetry(np.eye(3)[None])


def chordal_mean(orientations: Orientations, weights: ArrayLike | None = None) -> Orientations:
    """Return the orientations (..., 3, 3) of least mean squared chord to orientations (n, 3, 3).

    `weights` are (..., n), 1 by default. Where the mean is undefined, it is the first.
    """
    share = np.ones(len(orientations)) if weights is None else np.asarray(weights, dtype=np.float64)
    mean = (share / share.sum(axis=-1, keepdims=True)) @ orientations.reshape(-1, 9)
    u, size, vt = np.linalg.svd(mean.reshape(*share.shape[:-1], 3, 3))
    sign = np.linalg.det(u @ vt)
    u[..., 2] *= sign[..., None]
    undefined = size[..., 1] + sign * size[..., 2] < 1e-9
    return np.asarray(np.where(undefined[..., None, None], orientations[0], u @ vt))


def _angle_deg(rotations: Orientations) -> Array:
    """Return the angle of rotations (n, 3, 3): from sine and cosine, so that 0 is exact."""
    sine = np.linalg.norm((rotations - inverse(rotations)).reshape(-1, 9), axis=1) / np.sqrt(2)
    cosine = np.trace(rotations, axis1=1, axis2=2) - 1
    return np.asarray(np.degrees(np.arctan2(sine, cosine)))


def _largest(first: Floats, images: Sequence[Floats]) -> Floats:
    """Return the largest of the products of rows (n, d) and each set of rows (m, d), (n, m)."""
    best = first @ images[0].T
    for image in images[1:]:
        np.maximum(best, first @ image.T, out=best)
    return np.asarray(best)


def _across(axis: Array) -> tuple[Array, Array]:
    """Return two unit vectors that form a right-handed frame with the axis."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def _about(axis: Array, angle_rad: Array) -> Orientations:
    """Return the rotations (..., 3, 3) about an axis."""
    p1, p2 = _across(axis)
    cosine, sine = (part(angle_rad)[..., None, None] for part in (np.cos, np.sin))
    flat = np.outer(p1, p1) + np.outer(p2, p2)
    return np.asarray(
        np.outer(axis, axis) + cosine * flat + sine * (np.outer(p2, p1) - np.outer(p1, p2))
    )


def _n_fold(rotation: Orientations) -> Orientations:
    """Return the rotation (3, 3) by k / n turns that a rotation nearly is, or the same."""
    from scipy.spatial.transform import Rotation

    vector = Rotation.from_matrix(rotation).as_rotvec()
    angle = float(np.linalg.norm(vector))
    n = np.arange(2, MOST_ELEMENTS + 1)
    exact = np.round(angle / (2 * np.pi) * n) / n * 2 * np.pi
    nearest = exact[np.abs(exact - angle).argmin()]
    if not nearest or np.abs(nearest - angle) > np.radians(NEARLY_DEG):
        return rotation
    snapped = _about(vector / angle, nearest)
    # Exact ones stay the same to the last bit.
    return rotation if np.abs(snapped - rotation).max() < 1e-12 else snapped


def _closed(generators: Sequence[Orientations]) -> Orientations:
    """Return the group that rotations generate; the identity is first."""
    group = [np.eye(3)]
    # It grows. Products with generators alone keep the errors of rounding small.
    for element in group:
        for new in (element @ generator for generator in generators):
            if max(np.trace(new @ g.T) for g in group) > 3 - _SAME:
                continue
            group.append(new)
            if len(group) > MOST_ELEMENTS:
                raise UserError(
                    f"symmetries_discrete makes more than {MOST_ELEMENTS} rotations: give the axis "
                    "of a prism with so many sides in symmetries_continuous"
                )
    return np.stack(group)
