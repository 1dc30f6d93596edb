"""All meshes of a category, loaded, checked and normalised; one message names the bad ones."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nbv.data.meshes import Mesh, as_mesh
from nbv.errors import UserError

if TYPE_CHECKING:
    from nbv.data.sources import MeshSource

logger = logging.getLogger(__name__)

_SECONDS_BETWEEN_LINES = 5.0


def prepare_meshes(source: MeshSource, category: str, object_ids: Sequence[str]) -> dict[str, Mesh]:
    """Load, check and normalise meshes.

    Parameters
    ----------
    source : MeshSource
    category : str
    object_ids : sequence of str

    Returns
    -------
    dict of str to Mesh
        In the order of `object_ids`.

    Raises
    ------
    UserError
        After all meshes are tried. It names the first bad one and the number of others; the log
        has an error for each.
    """
    prepared: dict[str, Mesh] = {}
    bad: list[str] = []
    start = last = time.monotonic()
    for done, object_id in enumerate(object_ids, 1):
        try:
            prepared[object_id] = as_mesh(source.load(category, object_id))
        except UserError as error:
            # The loop goes on, so that one run names every file to mend.
            logger.error("%s", error)
            bad.append(str(error))
        now = time.monotonic()
        if now - last >= _SECONDS_BETWEEN_LINES:
            last = now
            left = (now - start) / done * (len(object_ids) - done)
            logger.info("%s: mesh %d of %d, %.0f s left", category, done, len(object_ids), left)
    if bad:
        more = f" (and {len(bad) - 1} more, logged above)" if len(bad) > 1 else ""
        raise UserError(f"{bad[0]}{more}: mend the file or list its id in dataset.exclude")
    seconds = time.monotonic() - start
    logger.info("%s: %d meshes prepared in %.1f s", category, len(prepared), seconds)
    return prepared
