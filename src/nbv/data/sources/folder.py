"""A folder of one's own meshes: `<root>/<category>/*.{obj,ply,off,stl,glb}`."""

from __future__ import annotations

from pathlib import Path

from nbv.data.sources.files import EXTENSIONS, FileSource


class FolderSource(FileSource):
    """A folder for each category; `dataset.categories` may rename it. Ids are stems."""

    name = "folder"

    def find(self, category: str) -> dict[str, Path]:
        """Return the mesh files of a category's folder."""
        folder = self.need_folder(self.root / self.label(category), f"the {category} meshes")
        return self.by_stem(p for p in folder.iterdir() if p.suffix.lower() in EXTENSIONS)

    def whereabouts(self, category: str) -> str:
        """Return the folder and the kinds of file in it."""
        return f"{self.root / self.label(category)} ({' '.join(EXTENSIONS)})"
