"""All meshes of a category, ready to be stored, or one message about those that cannot be."""

from __future__ import annotations

import logging
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from nbv.errors import UserError
from nbv.meshes.store import Mesh, as_mesh

if TYPE_CHECKING:
    from nbv.meshes.sources import MeshSource

logger = logging.getLogger(__name__)

_SECONDS_BETWEEN_LINES = 5.0


def prepare_meshes(
    source: MeshSource, category: str, object_ids: Sequence[str], workers: int = 1
) -> dict[str, Mesh]:
    """Load, check and normalise meshes.

    Parameters
    ----------
    source : MeshSource
    category : str
    object_ids : sequence of str
    workers : int
        Processes; the result does not depend on it.

    Returns
    -------
    dict of str to Mesh
        In the order of `object_ids`.

    Raises
    ------
    UserError
        After all have been tried: the first mesh that cannot be used, and how many more there are.
        Each of them is logged as an error.
    """
    prepared: dict[str, Mesh] = {}
    bad: list[str] = []
    start = last = time.monotonic()
    with _mapping(workers) as results:
        work = partial(_prepare, source, category)
        for object_id, result in zip(object_ids, results(work, object_ids), strict=True):
            if isinstance(result, str):
                logger.error("%s", result)
                bad.append(result)
            else:
                prepared[object_id] = result
            now = time.monotonic()
            if now - last >= _SECONDS_BETWEEN_LINES:
                last = now
                done = len(prepared) + len(bad)
                left = (now - start) / done * (len(object_ids) - done)
                logger.info("%s: mesh %d of %d, %.0f s left", category, done, len(object_ids), left)
    if bad:
        more = f" (and {len(bad) - 1} more, logged above)" if len(bad) > 1 else ""
        raise UserError(f"{bad[0]}{more}: mend the file or list its id in dataset.exclude")
    seconds = time.monotonic() - start
    logger.info("%s: %d meshes prepared in %.1f s", category, len(prepared), seconds)
    return prepared


def _prepare(source: MeshSource, category: str, object_id: str) -> Mesh | str:
    """Return a mesh, or why there is none: as a value, so that one failure stops no other."""
    try:
        return as_mesh(source.load(category, object_id))
    except UserError as error:
        return str(error)


_Results = Callable[[Callable[[str], Mesh | str], Sequence[str]], Iterator[Mesh | str]]


@contextmanager
def _mapping(workers: int) -> Iterator[_Results]:
    if workers <= 1:
        yield map
        return
    # Fork where it is safe: other ways to start a process import the main script once more.
    method = "fork" if sys.platform == "linux" else "spawn"
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        yield partial(pool.map, chunksize=4)
