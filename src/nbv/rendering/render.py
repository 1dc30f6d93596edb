"""Depth images of many objects, written directly to one array on disk."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.files import replacing
from nbv.meshes.store import Surface
from nbv.rendering import Renderer
from nbv.rendering.camera import Camera
from nbv.rendering.crop import crop_measured, sensor_camera
from nbv.rendering.depth_codes import Codes, Depths, encode_depth
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
        Naming the object that does not fit the image, that covers no pixel of a view, or of which
        the sensor measures nothing in any view. Views in which it measures nothing are logged
        otherwise.
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
        _need_visible(depth, object_id, elevation_deg, azimuths_deg, camera)
        if measure is not None:
            depth = crop_measured(measure(depth, object_id), camera)
            _need_measured(depth, object_id, elevation_deg)
        yield encode_depth(depth, camera)


def _n_blank(depth: Depths) -> int:
    return int(np.count_nonzero(~depth.any(axis=(1, 2))))


def _need_visible(
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


def _need_measured(depth: Depths, object_id: str, elevation_deg: float) -> None:
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
