"""Where meshes come from: one module a source, chosen by name.

Listing objects reads no mesh and imports no mesh library: the workflow does it each time it is
parsed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, cast

from nbv.errors import UserError, nearest

if TYPE_CHECKING:
    import trimesh

SOURCES: Mapping[str, str] = {
    "folder": "nbv.meshes.sources.folder:FolderSource",
    "modelnet": "nbv.meshes.sources.modelnet:ModelNetSource",
    "procedural": "nbv.meshes.sources.procedural:ProceduralSource",
    "shapenet": "nbv.meshes.sources.shapenet:open_shapenet",
}


class MeshSource(Protocol):
    """What every source offers.

    Attributes
    ----------
    name : str
        Its name in the configuration.
    seed : int
        Decides which objects are chosen where there are more than needed.
    endless : bool
        Whether it makes objects as they are asked for: the first N are then as good as any.
    """

    name: str
    seed: int
    endless: bool

    def object_ids(self, category: str) -> list[str]:
        """Return the ids of all objects, sorted, exclusions removed, without reading any.

        Raises
        ------
        UserError
            If the data are not where the configuration says, or lack the category.
        """
        ...

    def whereabouts(self, category: str) -> str:
        """Return the place that a category's objects come from, for messages."""
        ...

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Return one object, checked and normalised.

        Raises
        ------
        UserError
            Naming the file, if it cannot be read or rendered.
        """
        ...


def open_source(settings: Mapping[str, Any], seed: int) -> MeshSource:
    """Return the source that the configuration names.

    Parameters
    ----------
    settings : mapping
        The configuration's group `dataset`, as `nbv.config.schema.Dataset` has it.
    seed : int
        See `MeshSource`.

    Raises
    ------
    UserError
        For an unknown source, or a setting without sense.
    """
    name = settings["source"]
    if name not in SOURCES:
        raise UserError(f"dataset.source={name}: no such source; {nearest(name, SOURCES)}")
    module, _, attribute = SOURCES[name].partition(":")
    return cast("MeshSource", getattr(import_module(module), attribute)(settings, seed))


def select_objects(source: MeshSource, category: str, n_objects: int | None) -> list[str]:
    """Choose objects of a category.

    The choice depends on the seed and the ids alone. Adding files to a folder displaces no more
    objects than come to be chosen in their place.

    Parameters
    ----------
    source : MeshSource
    category : str
    n_objects : int or None
        None takes all there are.

    Returns
    -------
    list of str
        Ids, sorted.

    Raises
    ------
    UserError
        If there are fewer than `n_objects`.
    """
    available = source.object_ids(category)
    if n_objects is None:
        if source.endless:
            raise UserError(f"dataset={source.name} makes any number of objects: set n_objects")
        return available
    if len(available) < n_objects:
        raise UserError(
            f"dataset={source.name}: {source.whereabouts(category)} holds {len(available)} "
            f"usable meshes, n_objects={n_objects} asked for: add meshes or set "
            f"n_objects={len(available)} (n_objects=null takes all)"
        )
    if source.endless:
        return available[:n_objects]

    def lot(object_id: str) -> bytes:
        text = f"{source.seed}/{category}/{object_id}"
        return hashlib.blake2b(text.encode(), digest_size=16).digest()

    return sorted(sorted(available, key=lot)[:n_objects])
