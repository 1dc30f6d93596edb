"""Sources of mesh files: a folder for each category, ModelNet and ShapeNet."""

from __future__ import annotations

import csv
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
from nbv.data.meshes import check_mesh, normalise
from nbv.errors import UserError, nearest
from nbv.files import missing

if TYPE_CHECKING:
    import trimesh


logger = logging.getLogger(__name__)

EXTENSIONS = (".obj", ".ply", ".off", ".stl", ".glb")

# Ids become cells of tables, lines of logs and parts of messages, so they have no control
# character, no line separator and no invalid UTF-8 (a surrogate in Python). A slash would lead to
# another folder.
_NOT_IN_IDS = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff/]")


class FileSource(ABC):
    """A source of mesh files below a root folder.

    A list of exclusions may serve several categories, so an entry without a file in a category is
    not an error. It is logged if other entries have files there, because it is probably misspelt.
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
        self._files: dict[str, dict[str, Path]] = {}

    @abstractmethod
    def find(self, category: str) -> dict[str, Path]:
        """Return the paths of a category's mesh files by object id."""

    @abstractmethod
    def whereabouts(self, category: str) -> str:
        """Return the location of a category's files, for messages."""

    def mesh_axes(self, category: str, object_id: str) -> tuple[str, str]:
        """Return the up and front axes of a file."""
        return self.settings["up"], self.settings["front"]

    def object_ids(self, category: str) -> list[str]:
        """Return the sorted ids of all files that are not excluded."""
        files = self.files(category)
        unknown = sorted(self._excluded - files.keys())
        if unknown and len(unknown) < len(self._excluded):
            logger.warning(
                "dataset=%s: %d listed exclusions are not among the files of %s, the first is %s",
                *(self.name, len(unknown), category, unknown[0]),
            )
        ids = sorted(files.keys() - self._excluded)
        with readable_paths(self.name):
            absent = [object_id for object_id in ids if not files[object_id].is_file()]
        if absent:
            first = files[absent[0]]
            more = f" ({len(absent) - 1} more like it)" if len(absent) > 1 else ""
            raise UserError(
                f"dataset={self.name}: {first} {missing(first)}{more}: put it there or list its "
                "id in dataset.exclude"
            )
        return ids

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Load a file, check and normalise it."""
        files = self.files(category)
        if object_id not in files:
            raise UserError(f"dataset={self.name}: {self.whereabouts(category)}: no {object_id}")
        mesh = _reader().read(files[object_id])
        check_mesh(mesh, str(files[object_id]))
        up, front = self.mesh_axes(category, object_id)
        azimuth_deg = self.settings["turn_deg"].get(category, 0.0)
        try:
            return normalise(mesh, up, front, azimuth_deg, self.settings["centre"])
        except UserError as error:
            raise UserError(f"dataset={self.name}, {files[object_id]}: {error}") from error

    def files(self, category: str) -> dict[str, Path]:
        """Return the cached result of `find`."""
        if category not in self._files:
            with readable_paths(self.name):
                self.check_folder(self.root, "the data set (dataset.root)")
                files = self.find(category)
            for object_id, path in files.items():
                if unsafe := _NOT_IN_IDS.search(object_id):
                    raise UserError(
                        f"dataset={self.name}: the id {object_id!a} has {unsafe[0]!a} "
                        f"in it ({str(path.parent)!a}): rename it; text without control "
                        "characters, in UTF-8, expected"
                    )
            self._files[category] = files
        return self._files[category]

    def label(self, category: str) -> str:
        """Return the data set's name of a category."""
        label: str = self.settings["categories"].get(category, category)
        return label

    def check_folder(self, folder: Path, meaning: str) -> Path:
        """Return `folder`; raise UserError if it is not a folder."""
        if not folder.is_dir():
            what = "is not a folder" if folder.exists() else "does not exist"
            raise UserError(f"dataset={self.name}: {folder} {what}; it should hold {meaning}")
        return folder

    def by_stem(self, paths: Iterable[Path]) -> dict[str, Path]:
        """Return files by their stem; raise UserError if two files share one."""
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
    """Return the only reader: starting it takes as long as reading many files."""
    return MeshReader()


def exclusions(settings: Mapping[str, Any]) -> frozenset[str]:
    """Return the ids in ``exclude`` and ``exclude_file``.

    Raises
    ------
    UserError
        If the file cannot be read.
    """
    listed = list(settings["exclude"])
    if settings["exclude_file"]:
        path = Path(settings["exclude_file"]).expanduser()
        try:
            if path.exists() and not path.is_file():
                raise OSError(errno.EINVAL, "it is not a regular file")
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
            raise UserError(f"dataset.exclude_file={path} cannot be read: {reason}") from error
        listed += [line.partition("#")[0].strip() for line in lines]
    return frozenset(object_id for object_id in listed if object_id)


@contextmanager
def readable_paths(source: str) -> Iterator[None]:
    """Raise a UserError for an OSError, such as for a path that is too long."""
    try:
        yield
    except OSError as error:
        path = ascii(str(error.filename))[1:-1]
        raise UserError(f"dataset={source}: {path} cannot be read: {error.strerror}") from error


class FolderSource(FileSource):
    """A folder for each category, which ``dataset.categories`` may rename. Ids are stems."""

    name = "folder"

    def find(self, category: str) -> dict[str, Path]:
        """Return the mesh files of a category's folder."""
        meshes = f"the {category} meshes; or leave {category} out of categories"
        folder = self.check_folder(self.root / self.label(category), meshes)
        return self.by_stem(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS)

    def whereabouts(self, category: str) -> str:
        """Return the folder and the kinds of file in it."""
        return f"{self.root / self.label(category)} ({' '.join(EXTENSIONS)})"


# ModelNet's split is for classification; our folds use all objects.
_PARTS = ("train", "test")


class ModelNetSource(FileSource):
    """ModelNet, both parts of a category. Ids are stems, such as "chair_0001"."""

    name = "modelnet"

    def find(self, category: str) -> dict[str, Path]:
        """Return the OFF files of a category's parts."""
        meshes = f"the {category} meshes; or leave {category} out of categories"
        folder = self.check_folder(self.root / self.label(category), meshes)
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


_MODEL = {"v2": Path("models", "model_normalized.obj"), "v1": Path("model.obj")}
_AXES = {"v2": ("+y", "-z"), "v1": ("+y", "+x"), "sem": ("+z", "-y")}
_METADATA = "metadata.csv"
_SEM_FOLDERS = (Path("models"), Path("models-OBJ", "models"))


def open_shapenet(settings: Mapping[str, Any], seed: int) -> FileSource:
    """Return the source for the layout in `settings`; ``auto`` recognises it by its files."""
    layout, root = settings["layout"], settings["root"]
    with readable_paths("shapenet"):
        has_metadata = bool(root) and (Path(root).expanduser() / _METADATA).is_file()
    if layout == "sem" or (layout == "auto" and has_metadata):
        return ShapeNetSemSource(settings, seed)
    return ShapeNetCoreSource(settings, seed)


class _ShapeNetSource(FileSource):
    """ShapeNet in one of three layouts.

    ======  ===================================================  ============  =========
    layout  files                                                up, front     category
    ======  ===================================================  ============  =========
    v2      `<root>/<synset>/<id>/models/model_normalized.obj`   +y, -z        synset
    v1      `<root>/<synset>/<id>/model.obj`                     +y, +x        synset
    sem     `<root>/metadata.csv`, `<root>/models/<id>.obj`      per model,    name or
            (or `<root>/models-OBJ/models/<id>.obj`)             else +z, -y   synset
    ======  ===================================================  ============  =========

    ``up: auto`` and ``front: auto`` select the axes of the layout. The metadata of ShapeNetSem has
    the axes of each model in the columns `up` and `front`; the configuration's axes replace only
    the default.
    """

    name = "shapenet"

    def axes(self, layout: str) -> tuple[str, str]:
        """Return the up and front axes: the configuration's, or the layout's for `auto`."""
        chosen = (self.settings["up"], self.settings["front"])
        up, front = (
            default if axis == "auto" else axis
            for axis, default in zip(chosen, _AXES[layout], strict=True)
        )
        return up, front


class ShapeNetCoreSource(_ShapeNetSource):
    """ShapeNetCore, v1 or v2. Ids are the names of the models' folders."""

    def find(self, category: str) -> dict[str, Path]:
        """Return the models of a category's synset."""
        models = [folder for folder in self._synset(category).iterdir() if folder.is_dir()]
        layout = self.settings["layout"]
        if layout == "auto":
            is_v1 = any((folder / _MODEL["v1"]).is_file() for folder in models)
            layout = "v1" if is_v1 else "v2"
        return {m.name: m / _MODEL[layout] for m in models}

    def whereabouts(self, category: str) -> str:
        """Return the synset's folder."""
        return str(self._synset(category))

    def mesh_axes(self, category: str, object_id: str) -> tuple[str, str]:
        """Return the up and front axes: the configuration's, or the layout's for `auto`."""
        is_v1 = self.files(category)[object_id].name == _MODEL["v1"].name
        return self.axes("v1" if is_v1 else "v2")

    def _synset(self, category: str) -> Path:
        folder = self.root / self.label(category)
        if category == "toilet" and not folder.is_dir():
            raise UserError(
                "dataset=shapenet: ShapeNetCore has no toilet category; ShapeNetSem "
                "(dataset.layout=sem) and ModelNet40 (dataset=modelnet) have one"
            )
        return self.check_folder(folder, f"the {category} models (see dataset.categories)")


class ShapeNetSemSource(_ShapeNetSource):
    """ShapeNetSem. Ids are the metadata's `fullId` without the prefix."""

    def __init__(self, settings: Mapping[str, Any], seed: int) -> None:
        super().__init__(settings, seed)
        self._rows: dict[str, dict[str, str]] = {}

    def find(self, category: str) -> dict[str, Path]:
        """Return the models of a category in the metadata."""
        rows = self._metadata()
        wanted = {_plain(category), _plain(self.label(category))}
        members = [model for model, row in rows.items() if wanted & _labels(row)]
        if not members:
            known = {label for row in rows.values() for label in _labels(row)}
            meant = nearest(category, (label for label in known if not label.isdecimal()))
            hint = meant if meant.startswith("did you mean") else "see its column category"
            path = self.root / _METADATA
            raise UserError(f"dataset=shapenet: {path} has no category {category}; {hint}")
        folders = [self.root / folder for folder in _SEM_FOLDERS if (self.root / folder).is_dir()]
        if not folders:
            raise UserError(
                f"dataset=shapenet: {self.root} has no folder models with the OBJ files"
            )
        return {model: folders[0] / f"{model}.obj" for model in members}

    def whereabouts(self, category: str) -> str:
        """Return the metadata's path."""
        return f"category {category} of {self.root / _METADATA}"

    def mesh_axes(self, category: str, object_id: str) -> tuple[str, str]:
        """Return the up and front axes of the metadata, or of the configuration."""
        row = self._metadata()[object_id]
        up, front = self.axes("sem")
        return row.get("up") or up, row.get("front") or front

    def _metadata(self) -> dict[str, dict[str, str]]:
        if not self._rows:
            path = self.root / _METADATA
            if not path.is_file():
                raise UserError(f"dataset=shapenet: {path} does not exist; layout=sem needs it")
            try:
                with path.open(encoding="utf-8", newline="") as file:
                    reader = csv.DictReader(file)
                    columns, rows = set(reader.fieldnames or ()), list(reader)
            except (csv.Error, UnicodeDecodeError) as error:
                raise UserError(f"dataset=shapenet: {path} cannot be read: {error}") from error
            if absent := {"fullId", "category"} - columns:
                raise UserError(f"dataset=shapenet: {path} has no column {min(absent)}")
            for number, row in enumerate(rows, 1):
                if not row["fullId"]:
                    raise UserError(f"dataset=shapenet: {path}: row {number} has no fullId")
            self._rows = {row["fullId"].rpartition(".")[2]: row for row in rows}
        return self._rows


def _plain(label: str) -> str:
    """Normalise a category or synset: 03797390, n03797390 and 3797390 are the same."""
    label = label.strip().lower()
    digits = label.removeprefix("n")
    return digits.lstrip("0") if digits.isdecimal() else label


def _labels(row: Mapping[str, str]) -> set[str]:
    """Return the categories and synsets of a model."""
    text = f"{row['category'] or ''},{row.get('wnsynset') or ''}".replace("\\", "")
    return {_plain(part) for part in text.split(",") if part.strip()}
