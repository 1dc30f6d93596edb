"""Files of depth images: one array for all sweeps of a unit, and the ids of its objects."""

from __future__ import annotations

import logging
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from nbv.errors import UserError
from nbv.files import damaged, open_array, read_json, write_json, write_rows

T = TypeVar("T")

Codes = NDArray[np.uint8]

logger = logging.getLogger(__name__)

_SECONDS_BETWEEN_LINES = 5.0


class DepthImages(NamedTuple):
    """Depth images of full sweeps of n objects.

    Attributes
    ----------
    object_ids : tuple of str
        All different.
    codes : ndarray (n, n_views, side, side) uint8
        Codes of `nbv.data.depth_codes.encode_depth`, mapped into memory. View k has the azimuth
        360 k / n_views.
    """

    object_ids: tuple[str, ...]
    codes: Codes

    def of(self, object_ids: Sequence[str]) -> Codes:
        """Return the images of some objects, (k, n_views, side, side), in the order given.

        Raises
        ------
        UserError
            If an object has none.
        """
        rows = {name: row for row, name in enumerate(self.object_ids)}
        if unknown := [name for name in object_ids if name not in rows]:
            raise UserError(
                f"object {unknown[0]!r} has no depth images: splits and depth images are of "
                "different runs; render again"
            )
        return np.asarray(self.codes[[rows[name] for name in object_ids]])


def write_depth(
    path: str | Path,
    objects_path: str | Path,
    object_ids: Collection[str],
    images: Iterable[Codes],
    shape: tuple[int, int, int],
) -> None:
    """Write the images of all objects to one `.npy` file, and the objects' ids to another.

    `images` are the sweeps of the objects, such as from `nbv.data.render.render_objects`, each of
    the shape (n_views, side, side). Memory holds one at a time. Each file appears under its name
    only when it is complete.
    """
    n_objects = len(object_ids)
    sweeps = logged(images, n_objects, f"{path}, sweeps of {shape[0]} images")
    write_rows(path, sweeps, (n_objects, *shape), np.uint8)
    write_json(objects_path, list(object_ids))


def open_depth(path: str | Path, objects_path: str | Path) -> DepthImages:
    """Open the files of `write_depth`.

    Raises
    ------
    UserError
        If a file cannot be read or the two have different numbers of objects.
    """
    codes: Codes = open_array(path)
    if codes.ndim != 4 or codes.dtype != np.uint8 or codes.shape[2] != codes.shape[3]:
        raise damaged(path, "holds no depth images of objects")
    names = read_json(objects_path)
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise damaged(objects_path, "holds no list of objects")
    if len(set(names)) != len(names) or len(names) != len(codes):
        raise damaged(
            objects_path, f"{len(set(names))} different objects, {path} has images of {len(codes)}"
        )
    return DepthImages(tuple(names), codes)


def logged(items: Iterable[T], n_items: int, what: str) -> Iterator[T]:
    """Yield items; log how many are done and the time left, and at last the time taken."""
    start = last = time.monotonic()
    for done, item in enumerate(items, 1):
        yield item
        now = time.monotonic()
        if now - last >= _SECONDS_BETWEEN_LINES and done < n_items:
            last = now
            left = (now - start) / done * (n_items - done)
            logger.info("%s: %d of %d, %.0f s left", what, done, n_items, left)
    logger.info("%s: %d in %.1f s", what, n_items, time.monotonic() - start)
