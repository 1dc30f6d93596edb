"""The source of procedural objects; see `nbv.data.procedural`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from nbv.data.meshes import check_mesh, normalise
from nbv.data.sources.files import exclusions
from nbv.errors import UserError, nearest

if TYPE_CHECKING:
    import trimesh

# The keys of nbv.data.procedural.CATEGORIES, which imports trimesh.
CATEGORIES = ("airplane", "car", "chair", "mug", "toilet")

# Ids have four digits.
_N_OBJECTS = 10_000


class ProceduralSource:
    """Objects "mug-0000", "mug-0001", … generated from the seed."""

    name = "procedural"
    endless = True

    def __init__(self, settings: Mapping[str, Any], seed: int) -> None:
        self.seed = seed
        self._settings = settings

    def object_ids(self, category: str) -> list[str]:
        """Return all ids that are not excluded."""
        if category not in CATEGORIES:
            raise UserError(
                f"dataset=procedural has no category {category}; {nearest(category, CATEGORIES)}"
            )
        excluded = exclusions(self._settings)
        ids = (f"{category}-{index:04d}" for index in range(_N_OBJECTS))
        return [object_id for object_id in ids if object_id not in excluded]

    def whereabouts(self, category: str) -> str:
        """Return the generator's name."""
        return f"the generator of {category} meshes"

    def load(self, category: str, object_id: str) -> trimesh.Trimesh:
        """Generate an object and normalise it."""
        from nbv.data.procedural import generate

        settings = self._settings
        mesh = generate(
            category,
            self.seed,
            int(object_id.removeprefix(f"{category}-")),
            least_reach=settings["handle_reach"],
            square_share=settings["square_share"],
        )
        check_mesh(mesh, f"dataset=procedural: {object_id}")
        azimuth_deg = settings["turn_deg"].get(category, 0.0)
        return normalise(mesh, settings["up"], settings["front"], azimuth_deg, settings["centre"])
