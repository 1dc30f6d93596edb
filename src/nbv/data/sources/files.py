"""Sources of mesh files: what they have in common, a folder of meshes, and ModelNet."""

from __future__ import annotations

import errno
import functools
import logging
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nbv.data.mesh_reader import MeshReader
from nbv.data.normalisation import check_mesh, normalise
from nbv.errors import UserError

if TYPE_CHECKING:
    import trimesh


logger = logging.getLogger(__name__)

EXTENSIONS = (".obj", ".ply", ".off", ".stl", ".glb")

# Ids become cells of tables, lines of logs and parts of messages: no control character, no other
# end of a line, no byte that is not UTF-8 (a surrogate in Python's text). An id with a slash, from
# a list of ids, would lead to another folder.
_NOT_IN_IDS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff/]")


class FileSource(ABC):
    """A source of mesh files below one folder.

    A list of exclusions may serve several categories, so an entry without a file in this category
    is no error. If other entries have files in it, that one is probably misspelt; a warning says
    so.
    """

    name: str
    endless = False

    def __init__(self, settings: Mapping[str, Any], seed: int) -> None:
        self.seed = seed
        self.settings = settings
        if not settings["root"]:
            raise UserError(f"dataset={self.name}: dataset.root is not set; give the data's folder")
        self.root = expanded(settings["root"], "dataset.root")
        self._excluded = exclusions(settings)
        self._found: dict[str, dict[str, Path]] = {}

    @abstractmethod
    def find(self, category: str) -> dict[str, Path]:
        """Return the mesh files of a category by object id; open none of them."""

    @abstractmethod
    def whereabouts(self, category: str) -> str:
        """Return the place of a category's files, for messages."""

    def orientation(self, category: str, object_id: str) -> tuple[str, str]:
        """Return the axes of a file that point up and to the front."""
        return self.settings["up"], self.settings["front"]

    def object_ids(self, category: str) -> list[str]:
        """Return the sorted ids of all files without the excluded ones."""
        found = self.files(category)
        unknown = sorted(self._excluded - found.keys())
        if unknown and len(unknown) < len(self._excluded):
            logger.warning(
                "dataset=%s: %d listed exclusions are not among the files of %s, the first is %s",
                *(self.name, len(unknown), category, unknown[0]),
            )
        chosen = sorted(found.keys() - self._excluded)
        with readable_places(self.name):
            absent = [object_id for object_id in chosen if not found[object_id].is_file()]
        if absent:
            first = found[absent[0]]
            what = "is no regular file" if first.exists() else "does not exist"
            more = f" ({len(absent) - 1} more like it)" if len(absent) > 1 else ""
            raise UserError(
                f"dataset={self.name}: {first} {what}{more}: put it there or list its id in "
                "dataset.exclude"
            )
        return chosen

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Load, check and normalise one file."""
        files = self.files(category)
        if object_id not in files:
            raise UserError(f"dataset={self.name}: {self.whereabouts(category)}: no {object_id}")
        mesh = _reader().read(files[object_id])
        check_mesh(mesh, str(files[object_id]))
        up, front = self.orientation(category, object_id)
        turn_deg = self.settings["turn_deg"].get(category, 0.0)
        try:
            return normalise(mesh, up, front, turn_deg, self.settings["centre"])
        except UserError as error:
            raise UserError(f"dataset={self.name}, {files[object_id]}: {error}") from error

    def files(self, category: str) -> dict[str, Path]:
        """Return what `find` returns; search only once."""
        if category not in self._found:
            with readable_places(self.name):
                self.check_folder(self.root, "the data set (dataset.root)")
                found = self.find(category)
            for object_id, path in found.items():
                if unsafe := _NOT_IN_IDS.search(object_id):
                    raise UserError(
                        f"dataset={self.name}: the id {object_id!a} has {unsafe[0]!a} "
                        f"in it ({str(path.parent)!a}): rename it; text without control "
                        "characters, in UTF-8, expected"
                    )
            self._found[category] = found
        return self._found[category]

    def label(self, category: str) -> str:
        """Return the data set's own name of a category."""
        label: str = self.settings["categories"].get(category, category)
        return label

    def check_folder(self, folder: Path, meaning: str) -> Path:
        """Return `folder`; raise UserError where it is not a folder."""
        if not folder.is_dir():
            what = "is not a folder" if folder.exists() else "does not exist"
            raise UserError(f"dataset={self.name}: {folder} {what}; it should hold {meaning}")
        return folder

    def by_stem(self, paths: Iterable[Path]) -> dict[str, Path]:
        """Return files by their stem; raise UserError where two files share one."""
        files: dict[str, Path] = {}
        for path in sorted(paths):
            if path.stem in files:
                raise UserError(
                    f"dataset={self.name}: {files[path.stem]} and {path} have the same id "
                    f"{path.stem}: rename or remove one"
                )
            files[path.stem] = path
        return files


@functools.cache
def _reader() -> MeshReader:
    """Return the one reader of this process: to start it takes as long as to read many files."""
    return MeshReader()


def exclusions(settings: Mapping[str, Any]) -> frozenset[str]:
    """Return the ids in `exclude` and `exclude_file`.

    Raises
    ------
    UserError
        Where the file cannot be read.
    """
    listed = list(settings["exclude"])
    if settings["exclude_file"]:
        path = expanded(settings["exclude_file"], "dataset.exclude_file")
        try:
            if path.exists() and not path.is_file():
                raise OSError(errno.EINVAL, "it is no regular file")
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
            raise UserError(f"dataset.exclude_file={path} cannot be read: {reason}") from error
        listed += [line.partition("#")[0].strip() for line in lines]
    return frozenset(object_id for object_id in listed if object_id)


@contextmanager
def readable_places(source: str) -> Iterator[None]:
    """Turn the system's refusal of a path, such as one too long, into a UserError."""
    try:
        yield
    except OSError as error:
        place = ascii(str(error.filename))[1:-1]
        raise UserError(f"dataset={source}: {place} cannot be read: {error.strerror}") from error


def expanded(path: str, key: str) -> Path:
    """Return a path with its ``~`` replaced; raise UserError where that is nobody's home."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise UserError(f"{key}={path}: there is no such home folder") from error


class FolderSource(FileSource):
    """A folder for each category; `dataset.categories` may rename it. Ids are stems."""

    name = "folder"

    def find(self, category: str) -> dict[str, Path]:
        """Return the mesh files of a category's folder."""
        folder = self.check_folder(self.root / self.label(category), f"the {category} meshes")
        return self.by_stem(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS)

    def whereabouts(self, category: str) -> str:
        """Return the folder and the kinds of file in it."""
        return f"{self.root / self.label(category)} ({' '.join(EXTENSIONS)})"


# The data set's own split is for classification; our folds use all objects.
_PARTS = ("train", "test")


class ModelNetSource(FileSource):
    """Both parts of a category together. Ids are stems, such as "chair_0001"."""

    name = "modelnet"

    def find(self, category: str) -> dict[str, Path]:
        """Return the OFF files of a category's parts."""
        folder = self.check_folder(self.root / self.label(category), f"the {category} meshes")
        parts = [folder / part for part in _PARTS if (folder / part).is_dir()]
        if not parts:
            raise UserError(
                f"dataset=modelnet: {folder} holds neither train/ nor test/; "
                "give the unpacked ModelNet folder as dataset.root"
            )
        return self.by_stem(path for part in parts for path in part.glob("*.off"))

    def whereabouts(self, category: str) -> str:
        """Return the folders of a category's parts."""
        return f"{self.root / self.label(category)}/{{train,test}}/*.off"
