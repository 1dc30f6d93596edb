"""Depth images of meshes from every azimuth: camera, renderers, sensors and depth codes.

The configuration names a renderer, and only that one is imported: nobody needs the libraries of
the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

from nbv.errors import UserError, nearest

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from nbv.data.camera import Camera

RENDERERS: Mapping[str, str] = {
    "embree": "nbv.data.embree:EmbreeRenderer",
    "pyrender": "nbv.data.pyrender:PyrenderRenderer",
}


class Renderer(Protocol):
    """The interface of a renderer."""

    def render(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        elevation_deg: float,
        azimuths_deg: ArrayLike,
        camera: Camera,
    ) -> NDArray[np.float32]:
        """Return the depth images of one mesh.

        Parameters
        ----------
        vertices : (n, 3) float
            Object frame, in object diagonals.
        faces : (m, 3) int
            Indices into `vertices`; both sides of a face are visible.
        elevation_deg : float
            In [-90, 90].
        azimuths_deg : (k,) float
            One image each.
        camera : Camera
            Its place, its field of view and its framing.

        Returns
        -------
        (k, side, side) float32
            Distance along the optical axis, in object diagonals; 0 where there is nothing. Pixel
            [row i, column j] is sampled at its centre (i + 1/2, j + 1/2).

        Raises
        ------
        UserError
            Where part of the object lies behind the camera or outside the image.
        """
        ...


def open_renderer(name: str) -> Renderer:
    """Return the renderer of a name, ready for use.

    Raises
    ------
    UserError
        For an unknown name, or where the renderer's libraries are missing.
    """
    if name not in RENDERERS:
        raise UserError(f"renderer={name}: no such renderer; {nearest(name, RENDERERS)}")
    module, _, attribute = RENDERERS[name].partition(":")
    return cast("Renderer", getattr(import_module(module), attribute)())
