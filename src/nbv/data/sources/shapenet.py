"""ShapeNet in its three layouts.

======  ======================================================  ==================  ==========
layout  files                                                   up, front           categories
======  ======================================================  ==================  ==========
v2      `<root>/<synset>/<id>/models/model_normalized.obj`      +y, -z              synsets
v1      `<root>/<synset>/<id>/model.obj`                        +y, +x              synsets
sem     `<root>/metadata.csv`, `<root>/models/<id>.obj`         of each model,      names or
        (or `<root>/models-OBJ/models/<id>.obj`)                else +z, -y         synsets
======  ======================================================  ==================  ==========

``dataset.layout=auto`` recognises the layout by these files. ``up: auto`` and ``front: auto`` take
the axes of the layout. A ShapeNetSem model keeps the frame in which it was drawn; the columns `up`
and `front` of the metadata name that frame. There, axes in the configuration replace only the
default.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nbv.data.sources.files import FileSource, expanded, readable_places
from nbv.errors import UserError, nearest

_MODEL = {"v2": Path("models", "model_normalized.obj"), "v1": Path("model.obj")}
_AXES = {"v2": ("+y", "-z"), "v1": ("+y", "+x"), "sem": ("+z", "-y")}
_METADATA = "metadata.csv"
_SEM_FOLDERS = (Path("models"), Path("models-OBJ", "models"))


def open_shapenet(settings: Mapping[str, Any], seed: int) -> FileSource:
    """Return the source of the layout in `settings`."""
    layout, layouts = settings["layout"], ("auto", *_AXES)
    if layout not in layouts:
        raise UserError(f"dataset.layout={layout}: no such layout; {nearest(layout, layouts)}")
    root = settings["root"]
    with readable_places("shapenet"):
        has_metadata = bool(root) and (expanded(root, "dataset.root") / _METADATA).is_file()
    if layout == "sem" or (layout == "auto" and has_metadata):
        return ShapeNetSemSource(settings, seed)
    return ShapeNetCoreSource(settings, seed)


class _ShapeNetSource(FileSource):
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
    """ShapeNetCore, v1 or v2. An id is the name of a model's folder."""

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

    def orientation(self, category: str, object_id: str) -> tuple[str, str]:
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
    """ShapeNetSem. An id is the metadata's `fullId` without the prefix of its source."""

    def __init__(self, settings: Mapping[str, Any], seed: int) -> None:
        super().__init__(settings, seed)
        self._rows: dict[str, dict[str, str]] = {}

    def find(self, category: str) -> dict[str, Path]:
        """Return the models of a category by the metadata."""
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

    def orientation(self, category: str, object_id: str) -> tuple[str, str]:
        """Return the up and front axes: the metadata's, or else the configuration's."""
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
    """Return one spelling of a category or synset: 03797390, n03797390 and 3797390 are the same."""
    label = label.strip().lower()
    digits = label.removeprefix("n")
    return digits.lstrip("0") if digits.isdecimal() else label


def _labels(row: Mapping[str, str]) -> set[str]:
    """Return the categories and synsets of a model."""
    text = f"{row['category'] or ''},{row.get('wnsynset') or ''}".replace("\\", "")
    return {_plain(part) for part in text.split(",") if part.strip()}
