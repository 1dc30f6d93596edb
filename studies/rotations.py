"""Up to four views of an estimator in three dimensions (docs/reference/rotations/protocol.md).

Every image of an instance is a first view of `nbv.tables.walks`, in its orders and `halfway`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.seeds import rng_for
from nbv.data.depth_images import logged
from nbv.files import read_rows
from nbv.tables import walks
from nbv.tables.bop import groups_of, read_orientation_table
from nbv.tables.next_camera import CameraMove
from nbv.tables.orientation_table import OrientationTable

Array = NDArray[np.float64]

COLUMNS = ("object_id", "scene_id", "instance", "score")


def halfway(moves: Sequence[CameraMove], apart: Array, rng: np.random.Generator) -> int:
    """Return the nearest candidate of at most the error halfway from the least to the mean."""
    cost = np.array([move.expected_error_deg for move in moves])
    # Equal costs may have a mean below each of them.
    limit = max(cost.min(), (cost.min() + cost.mean()) / 2)
    near = [move for move in moves if move.expected_error_deg <= limit]
    return min(near, key=lambda move: move.travel_deg).index


ORDERS = walks.ORDERS | {"halfway": halfway}


def pairs_table(
    object_id: str, truth: Array, estimate: Array, columns: Mapping[str, Any]
) -> pd.DataFrame:
    """Return a table for `evaluate` of poses (n, 3, 3) that cameras see straight ahead.

    `columns` are ``instance``, ``score`` and any others.
    """
    matrices = {"R_true": truth, "R_estimate": estimate}
    texts = {
        name: [" ".join(f"{x:.6f}" for x in pose.ravel()) for pose in poses]
        for name, poses in matrices.items()
    }
    return pd.DataFrame({"object_id": object_id, "scene_id": 0, **texts, **columns})


@dataclass(frozen=True)
class HeldOut:
    """An instance, which stands still, and the pairs of others.

    Attributes
    ----------
    name : str
    images : OrientationTable
        The instance's n images.
    known : OrientationTable
        Calibration: other pairs.
    """

    name: str
    images: OrientationTable
    known: OrientationTable

    @property
    def object_id(self) -> str:
        """The object or category."""
        return self.images.object_ids[0]


def held_out(
    path: str | Path, models_info: str | Path | None, settings: Mapping[str, Any]
) -> Iterator[HeldOut]:
    """Yield the instances of a table of pairs that are evaluated; see `evaluate`.

    Raises
    ------
    UserError
        If a column or an object is missing, or a matrix is no rotation.
    """
    rows = read_rows(Path(path), COLUMNS)
    judged = settings["objects"]
    chosen = [*judged, *settings["score_objects"]] if judged and settings["score_objects"] else ()
    table = read_orientation_table(path, None, models_info, chosen, rows=rows)
    keys = list(zip(table.object_id, table.group, strict=True))
    role: dict[tuple[str, str], str] = {}
    if "role" in rows:
        by_instance = zip(rows["object_id"], groups_of(rows), rows["role"], strict=True)
        role = {(object_id, group): value for object_id, group, value in by_instance}
    is_tested = np.array([role.get(key) == "test" for key in keys])
    calibration = table.where(~is_tested)
    for object_id, group in dict.fromkeys(keys):
        if (judged and object_id not in judged) or role.get((object_id, group)) == "calibration":
            continue
        is_instance = (table.object_id == object_id) & (table.group == group)
        known = calibration if role else table.where(~is_instance)
        if object_id in known.object_ids:
            name = "_".join([object_id, *group.split("/")])
            yield HeldOut(name, table.where(is_instance), known)


def evaluate(
    path: str | Path, models_info: str | Path | None, settings: Mapping[str, Any], seed: int
) -> pd.DataFrame:
    """Return the rows of `nbv.tables.walks.walks` of every instance.

    The table of pairs has `COLUMNS` and those of `nbv.tables.bop.read_orientation_table`. With a
    column ``role`` an instance is for calibration or tested, else both. ``settings`` has
    ``objects``, which are evaluated, ``score_objects``, which calibrate too, and ``draws`` of the
    random order from each first view; the k-th of n images is k + n, k + 2 n, … in further ones.
    """
    cases = list(held_out(path, models_info, settings))
    further = range(1, settings["draws"])
    orders = ORDERS | {f"random {draw}": ORDERS["random"] for draw in further}
    rows = []
    for case in logged(cases, len(cases), "instances"):
        rng = rng_for(seed, "rotations", case.name)
        for row in walks.walks(case.known, case.images, rng, orders):
            row["order"], _, draw = row["order"].partition(" ")
            row["first"] += int(draw or 0) * len(case.images.truth)
            rows.append({"object_id": case.object_id, "instance": case.name} | row)
    return pd.DataFrame(rows)
