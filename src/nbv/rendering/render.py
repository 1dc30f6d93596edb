"""Depth images of many objects, written directly to one array on disk."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from nbv.errors import UserError
from nbv.files import replacing
from nbv.meshes.store import Surface
from nbv.rendering import Renderer
from nbv.rendering.camera import Camera
from nbv.rendering.crop import crop_measured, sensor_camera
from nbv.rendering.depth_codes import Codes, encode_depth
from nbv.rendering.noise import Measure

logger = logging.getLogger(__name__)

# Progress is logged at each tenth of the work, but not more often than this.
_SECONDS_BETWEEN_LINES = 5.0


def render_objects(
    meshes: Mapping[str, Surface],
    elevation_deg: float,
    camera: Camera,
    renderer: Renderer,
    measure: Measure | None = None,
    n_azimuths: int = 360,
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


def write_depth(
    path: str | Path,
    meshes: Mapping[str, Surface],
    elevation_deg: float,
    camera: Camera,
    renderer: Renderer,
    measure: Measure | None = None,
    n_azimuths: int = 360,
) -> None:
    """Render all objects into one `.npy` file, (n_objects, n_azimuths, side, side) uint8.

    The images go to disk as they are made; memory holds those of one object. The file appears
    under its name only when it is complete. Parameters and errors as in `render_objects`.
    """
    side = camera.image_side
    header = {
        "descr": np.lib.format.dtype_to_descr(np.dtype(np.uint8)),
        "fortran_order": False,
        "shape": (len(meshes), n_azimuths, side, side),
    }
    images = render_objects(meshes, elevation_deg, camera, renderer, measure, n_azimuths)
    progress = _Progress(str(path), len(meshes), n_azimuths)
    # Written, not mapped: a full disk then raises an error instead of a fatal signal.
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        for index, codes in enumerate(images):
            file.write(codes.tobytes())
            progress.advance(index + 1)


class _Progress:
    def __init__(self, name: str, n_objects: int, images_each: int) -> None:
        self._name, self._n_objects, self._images_each = name, n_objects, images_each
        self._start = self._last = time.monotonic()
        self._tenth = 0

    def advance(self, done: int) -> None:
        now = time.monotonic()
        elapsed = max(now - self._start, 1e-9)
        rate = done * self._images_each / elapsed
        if done == self._n_objects:
            images = done * self._images_each
            logger.info(
                "%s: %d objects, %d images in %.1f s (%.0f images/s)",
                *(self._name, done, images, elapsed, rate),
            )
            return
        tenth = 10 * done // self._n_objects
        if tenth > self._tenth and now - self._last >= _SECONDS_BETWEEN_LINES:
            self._tenth, self._last = tenth, now
            left = elapsed / done * (self._n_objects - done)
            logger.info(
                "%s: object %d of %d, %.0f images/s, %.0f s left",
                *(self._name, done, self._n_objects, rate, left),
            )
