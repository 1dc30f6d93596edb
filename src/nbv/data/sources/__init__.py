"""Sources of meshes, selected by name in the configuration.

Snakemake lists the objects whenever it parses the workflow, so listing neither loads a mesh nor
imports a mesh library.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, cast

from nbv.data.depth_images import logged
from nbv.data.meshes import Mesh, as_mesh
from nbv.errors import UserError, nearest

if TYPE_CHECKING:
    import trimesh

logger = logging.getLogger(__name__)

SOURCES: Mapping[str, str] = {
    "folder": "nbv.data.sources.files:FolderSource",
    "modelnet": "nbv.data.sources.files:ModelNetSource",
    "procedural": "nbv.data.sources.procedural:ProceduralSource",
    "shapenet": "nbv.data.sources.files:open_shapenet",
}


class MeshSource(Protocol):
    """The interface of a source.

    Attributes
    ----------
    name : str
        Its name in the configuration.
    seed : int
        Seed of the selection of objects.
    endless : bool
        Whether it generates objects on demand, so that the first N are as good as any.
    """

    name: str
    seed: int
    endless: bool

    def object_ids(self, category: str) -> list[str]:
        """Return the sorted ids of all objects that are not excluded.

        Raises
        ------
        UserError
            If the configured folder lacks the data or the category.
        """
        ...

    def whereabouts(self, category: str) -> str:
        """Return the location of a category's objects, for messages."""
        ...

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Load an object, check and normalise it.

        Raises
        ------
        UserError
            Naming the file that cannot be loaded or rendered.
        """
        ...


def open_source(settings: Mapping[str, Any], seed: int) -> MeshSource:
    """Return the source named in the configuration's group ``dataset``.

    Raises
    ------
    UserError
        For an unknown source or an invalid setting.
    """
    name = settings["source"]
    if name not in SOURCES:
        raise UserError(f"dataset.source={name}: no such source; {nearest(name, SOURCES)}")
    module, _, attribute = SOURCES[name].partition(":")
    return cast("MeshSource", getattr(import_module(module), attribute)(settings, seed))


def select_objects(source: MeshSource, category: str, n_objects: int | None) -> list[str]:
    """Select objects of a category, all if `n_objects` is None; return their sorted ids.

    The selection depends only on the seed and the ids. A new file in a folder replaces at most one
    selected object.

    Raises
    ------
    UserError
        If there are fewer than `n_objects`, or none.
    """
    available = source.object_ids(category)
    if n_objects is None and source.endless:
        raise UserError(f"dataset={source.name} makes any number of objects: set n_objects")
    if not available:
        raise UserError(
            f"dataset={source.name}: {source.whereabouts(category)} holds no usable meshes: "
            "add some, or correct dataset.root, dataset.categories or dataset.exclude"
        )
    if n_objects is None:
        return available
    if len(available) < n_objects:
        raise UserError(
            f"dataset={source.name}: {source.whereabouts(category)} holds {len(available)} "
            f"usable meshes, n_objects={n_objects} asked for: add meshes, or take all with "
            "n_objects=null where they are enough for n_folds"
        )
    if source.endless:
        return available[:n_objects]

    def rank(object_id: str) -> bytes:
        text = f"{source.seed}/{category}/{object_id}"
        return hashlib.blake2b(text.encode(), digest_size=16).digest()

    return sorted(sorted(available, key=rank)[:n_objects])


def prepare_meshes(source: MeshSource, category: str, object_ids: Sequence[str]) -> dict[str, Mesh]:
    """Load, check and normalise meshes, in the order of `object_ids`.

    Raises
    ------
    UserError
        After all meshes are tried, naming the first bad one and the number of others (the log has
        an error for each), or all that are copies of others.
    """
    prepared: dict[str, Mesh] = {}
    bad: list[str] = []
    for object_id in logged(object_ids, len(object_ids), f"{category} meshes"):
        try:
            prepared[object_id] = as_mesh(source.load(category, object_id))
        except UserError as error:
            # Continue, so that a single run names every bad file.
            logger.error("%s", error)
            bad.append(str(error))
    if bad:
        more = f" (and {len(bad) - 1} more, logged above)" if len(bad) > 1 else ""
        raise UserError(f"{bad[0]}{more}: mend the file or list its id in dataset.exclude")
    from nbv.data.copies import find_copies  # only here: it is slow

    if not source.endless and (copies := find_copies(prepared)):
        raise UserError(
            f"dataset={source.name}: {category}: "
            f"{', '.join(f'{copy} is a copy of {name}' for copy, name in copies.items())}; "
            f"leave out copies, so that no test meets what a training saw: "
            f"dataset.exclude=[{','.join(copies)}]"
        )
    return prepared
