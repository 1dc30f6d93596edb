"""Sources of meshes: one module for each, named in the configuration.

Snakemake lists the objects each time it parses the workflow. Listing therefore loads no mesh and
imports no mesh library.
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
    "folder": "nbv.data.sources.files:FolderSource",
    "modelnet": "nbv.data.sources.files:ModelNetSource",
    "procedural": "nbv.data.sources.procedural:ProceduralSource",
    "shapenet": "nbv.data.sources.shapenet:open_shapenet",
}


class MeshSource(Protocol):
    """The interface of a source.

    Attributes
    ----------
    name : str
        Its name in the configuration.
    seed : int
        Decides which objects are selected where there are more than needed.
    endless : bool
        Whether it makes objects on demand; the first N then serve as well as any others.
    """

    name: str
    seed: int
    endless: bool

    def object_ids(self, category: str) -> list[str]:
        """Return the sorted ids of all objects without the excluded ones; load no object.

        Raises
        ------
        UserError
            If the configured place lacks the data or the category.
        """
        ...

    def whereabouts(self, category: str) -> str:
        """Return the place of a category's objects, for messages."""
        ...

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Return one object, checked and normalised.

        Raises
        ------
        UserError
            Naming the file that cannot be loaded or rendered.
        """
        ...


def open_source(settings: Mapping[str, Any], seed: int) -> MeshSource:
    """Return the source named in the configuration.

    Parameters
    ----------
    settings : mapping
        The configuration's group `dataset`.
    seed : int
        See `MeshSource`.

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
    """Select objects of a category.

    The selection depends only on the seed and the ids. A file added to a folder displaces at most
    one selected object, whose place it takes.

    Parameters
    ----------
    source : MeshSource
    category : str
    n_objects : int or None
        None selects all.

    Returns
    -------
    list of str
        Ids, sorted.

    Raises
    ------
    UserError
        If there are fewer than `n_objects`, or none.
    """
    available = source.object_ids(category)
    if n_objects is None:
        if source.endless:
            raise UserError(f"dataset={source.name} makes any number of objects: set n_objects")
        if not available:
            raise UserError(
                f"dataset={source.name}: {source.whereabouts(category)} holds no usable meshes: "
                "add some, or correct dataset.root, dataset.categories or dataset.exclude"
            )
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
