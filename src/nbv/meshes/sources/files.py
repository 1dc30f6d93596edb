"""The common part of all sources of mesh files: root, exclusions, loading and messages."""

from __future__ import annotations

import contextlib
import logging
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nbv.errors import UserError
from nbv.meshes.normalisation import check_mesh, normalise

if TYPE_CHECKING:
    import trimesh

logger = logging.getLogger(__name__)

EXTENSIONS = (".obj", ".ply", ".off", ".stl", ".glb")


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
        self.root = Path(settings["root"]).expanduser()
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
        absent = [object_id for object_id in chosen if not found[object_id].is_file()]
        if absent:
            more = f", nor do {len(absent) - 1} more" if len(absent) > 1 else ""
            raise UserError(
                f"dataset={self.name}: {found[absent[0]]} does not exist{more}: put it there or "
                "list its id in dataset.exclude"
            )
        return chosen

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Load, check and normalise one file."""
        files = self.files(category)
        if object_id not in files:
            raise UserError(f"dataset={self.name}: {self.whereabouts(category)}: no {object_id}")
        mesh = read_mesh(files[object_id])
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
            self.need_folder(self.root, "the data set (dataset.root)")
            self._found[category] = self.find(category)
        return self._found[category]

    def label(self, category: str) -> str:
        """Return the data set's own name of a category."""
        label: str = self.settings["categories"].get(category, category)
        return label

    def need_folder(self, folder: Path, meaning: str) -> Path:
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


def exclusions(settings: Mapping[str, Any]) -> frozenset[str]:
    """Return the ids in `exclude` and `exclude_file`.

    Raises
    ------
    UserError
        Where the file cannot be read.
    """
    listed = list(settings["exclude"])
    if settings["exclude_file"]:
        path = Path(settings["exclude_file"]).expanduser()
        try:
            # A device or a pipe may have no end.
            if path.exists() and not path.is_file():
                raise UserError(f"dataset.exclude_file={path} is not a file")
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
            raise UserError(f"dataset.exclude_file={path} cannot be read: {reason}") from error
        listed += [line.partition("#")[0].strip() for line in lines]
    return frozenset(object_id for object_id in listed if object_id)


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Load a mesh file unchanged: vertices are not merged or reordered, materials are left out.

    The parts of a scene are joined; each is placed by its transform.

    Raises
    ------
    UserError
        With the path and the reason.
    """
    import trimesh

    if path.is_file() and path.stat().st_size == 0:
        raise UserError(f"{path}: the file is empty; at least 1 triangle expected")
    options = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    try:
        with _only_errors(trimesh.util.log):
            mesh = trimesh.load_mesh(path, process=False, **options)
        _need_whole_text(path)
    # No list of what a loader may raise on arbitrary bytes is complete.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{path}: cannot be read as a mesh ({reason})") from error
    if not isinstance(mesh, trimesh.Trimesh):
        raise UserError(f"{path}: holds no mesh; at least 1 triangle expected")
    return mesh


def _need_whole_text(path: Path) -> None:
    """Raise ValueError for a text file cut short: trimesh accepts what is left of its faces.

    Trimesh refuses a binary file cut short. An OBJ file does not say how much it holds.
    """
    extension = path.suffix.lower()
    if extension == ".off":
        text = path.read_text(encoding="utf-8", errors="replace").partition("OFF")[2]
        (n_vertices, n_faces, *_), *body = _tokens(text)
        expected, faces_last = int(n_vertices) + int(n_faces), True
    elif extension == ".ply" and b"format ascii" in path.open("rb").read(100):
        header, _, text = path.read_text(encoding="utf-8", errors="replace").partition("end_header")
        elements = [line for line in _tokens(header) if line[0] == "element"]
        body = _tokens(text)
        expected, faces_last = sum(int(line[2]) for line in elements), elements[-1][1] == "face"
    else:
        return
    if faces_last and 0 < len(body) == expected and len(body[-1]) <= int(body[-1][0]):
        del body[-1]
    if len(body) < expected:
        raise ValueError(f"{len(body)} of {expected} lines are there: the file was cut short")


def _tokens(text: str) -> list[list[str]]:
    lines = (line.partition("#")[0].split() for line in text.splitlines())
    return [line for line in lines if line]


@contextlib.contextmanager
def _only_errors(log: logging.Logger) -> Iterator[None]:
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)
