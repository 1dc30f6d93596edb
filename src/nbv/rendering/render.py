"""Depth images of many objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from nbv.errors import UserError
from nbv.meshes.store import Surface
from nbv.rendering import Renderer
from nbv.rendering.camera import Camera
from nbv.rendering.crop import crop_measured, sensor_camera
from nbv.rendering.depth_codes import Codes, encode_depth
from nbv.rendering.noise import Measure

N_AZIMUTHS = 360
"""Views of a full turn."""


def render_objects(
    meshes: Mapping[str, Surface],
    elevation_deg: float,
    camera: Camera,
    renderer: Renderer,
    measure: Measure | None = None,
    n_azimuths: int = N_AZIMUTHS,
) -> Iterator[Codes]:
    """Yield the encoded depth images of each object.

    Parameters
    ----------
    meshes : mapping of str to mesh
        Normalised meshes by object id.
    elevation_deg : float
        In [-90, 90].
    camera : Camera
    renderer : Renderer
    measure : callable or None
        The sensor, from `nbv.rendering.noise.open_sensor`. It measures the images, and the crop
        follows what it measures (`nbv.rendering.crop`). None keeps the true depth.
    n_azimuths : int
        View k is at azimuth 360 k / n_azimuths degrees.

    Yields
    ------
    (n_azimuths, side, side) uint8
        See `nbv.rendering.depth_codes.encode_depth`.

    Raises
    ------
    UserError
        Naming the object that does not fit the image.
    """
    drawn = camera if measure is None else sensor_camera(camera)
    azimuths_deg = np.arange(n_azimuths) * (360.0 / n_azimuths)
    for object_id, mesh in meshes.items():
        try:
            depth = renderer.render(mesh.vertices, mesh.faces, elevation_deg, azimuths_deg, drawn)
        except UserError as error:
            raise UserError(f"{object_id}: {error}") from error
        if measure is not None:
            depth = crop_measured(measure(depth, object_id), camera)
        yield encode_depth(depth, camera)
