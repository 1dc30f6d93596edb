"""ModelNet10 and ModelNet40: `<root>/<category>/{train,test}/*.off`, z up."""

from __future__ import annotations

from pathlib import Path

from nbv.data.sources.files import FileSource
from nbv.errors import UserError

# The data set's own split is for classification; our folds use all objects.
_PARTS = ("train", "test")


class ModelNetSource(FileSource):
    """Both parts of a category together. Ids are stems, such as "chair_0001"."""

    name = "modelnet"

    def find(self, category: str) -> dict[str, Path]:
        """Return the OFF files of a category's parts."""
        folder = self.need_folder(self.root / self.label(category), f"the {category} meshes")
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
