"""Renderers, and the depth codes of sweeps of objects.

The configuration names a renderer, and only that one is imported, so that its libraries are the
only ones needed.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nbv.data.camera import Camera, Views, object_views
from nbv.data.depth_codes import Depths, crop_measured, encode_depth, sensor_camera
from nbv.data.depth_images import Codes
from nbv.data.meshes import Surface
from nbv.data.sensors import Measure
from nbv.errors import UserError, nearest

logger = logging.getLogger(__name__)

RENDERERS: Mapping[str, str] = {
    "embree": "nbv.data.embree:EmbreeRenderer",
    "pyrender": "nbv.data.pyrender:PyrenderRenderer",
}


class Renderer(ABC):
    """A renderer, which draws the views that all renderers share."""

    def render(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        elevation_deg: float,
        azimuths_deg: ArrayLike,
        camera: Camera,
    ) -> NDArray[np.float32]:
        """Render the depth images (k, side, side) float32 of a mesh, both sides of each face.

        They are distances along the optical axis, in object diagonals; 0 for background. Pixel
        [row i, column j] is sampled at its centre (i + 1/2, j + 1/2). Same parameters and errors as
        `nbv.data.camera.object_views`.
        """
        views = object_views(vertices, faces, elevation_deg, azimuths_deg, camera)
        return self.draw(vertices, faces, views)

    @abstractmethod
    def draw(self, vertices: ArrayLike, faces: ArrayLike, views: Views) -> NDArray[np.float32]:
        """Draw the depth images of `render`."""


def open_renderer(name: str) -> Renderer:
    """Return a renderer by name; raise UserError if it is unknown or its libraries are missing."""
    if name not in RENDERERS:
        raise UserError(f"renderer={name}: no such renderer; {nearest(name, RENDERERS)}")
    module, _, attribute = RENDERERS[name].partition(":")
    return cast("Renderer", getattr(import_module(module), attribute)())


N_AZIMUTHS = 360
"""Views of a full sweep."""


def render_objects(
    meshes: Mapping[str, Surface],
    elevation_deg: float,
    camera: Camera,
    renderer: Renderer,
    measure: Measure | None = None,
    n_azimuths: int = N_AZIMUTHS,
) -> Iterator[Codes]:
    """Yield the depth codes of each object's sweep.

    Parameters
    ----------
    meshes : mapping of str to mesh
        Normalised meshes by object id.
    elevation_deg : float
        In [-90, 90].
    measure : callable or None
        The sensor, from `nbv.data.sensors.open_sensor`, whose measurements are then cropped. None
        keeps the true depth.
    n_azimuths : int
        View k is at azimuth 360 k / n_azimuths degrees.

    Yields
    ------
    (n_azimuths, side, side) uint8
        See `nbv.data.depth_codes.encode_depth`.

    Raises
    ------
    UserError
        Naming the object that does not fit the image, covers no pixel of a view, or is not measured
        in any view. Single views without a measurement are logged.
    """
    drawn = camera if measure is None else sensor_camera(camera)
    azimuths_deg = np.arange(n_azimuths) * (360.0 / n_azimuths)
    for object_id, mesh in meshes.items():
        try:
            depth = renderer.render(mesh.vertices, mesh.faces, elevation_deg, azimuths_deg, drawn)
        except UserError as error:
            raise UserError(f"{object_id}: {error}") from error
        except Exception as error:
            raise RuntimeError(f"{object_id}: {type(error).__name__}: {error}") from error
        _check_visible(depth, object_id, elevation_deg, azimuths_deg, camera)
        if measure is not None:
            depth = crop_measured(measure(depth, object_id), camera)
            _check_measured(depth, object_id, elevation_deg)
        yield encode_depth(depth, camera)


def _n_blank(depth: Depths) -> int:
    return int(np.count_nonzero(~depth.any(axis=(1, 2))))


def _check_visible(
    depth: Depths,
    object_id: str,
    elevation_deg: float,
    azimuths_deg: NDArray[np.floating[Any]],
    camera: Camera,
) -> None:
    if n_blank := _n_blank(depth):
        first = azimuths_deg[int((~depth.any(axis=(1, 2))).argmax())]
        raise UserError(
            f"{object_id}: the object covers no pixel in {n_blank} of {len(depth)} views, first at "
            f"azimuth {first:g}, elevation {elevation_deg:g}: lower camera.distance="
            f"{camera.distance:g} or camera.fov_deg={camera.fov_deg:g}, raise camera.image_side="
            f"{camera.image_side}, or list the id in dataset.exclude if its mesh is too thin"
        )


def _check_measured(depth: Depths, object_id: str, elevation_deg: float) -> None:
    n_blank = _n_blank(depth)
    if n_blank == len(depth):
        raise UserError(
            f"{object_id}: the sensor measures nothing of the object in any view at elevation "
            f"{elevation_deg:g}: change sensor.parameters, sensor.diagonal_m or camera.distance"
        )
    if n_blank:
        logger.warning(
            "%s: the sensor measures nothing in %d of %d views at elevation %g",
            *(object_id, n_blank, len(depth), elevation_deg),
        )
