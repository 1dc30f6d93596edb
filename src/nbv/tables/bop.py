"""Calibration pairs in three dimensions: BOP's results with their truths, and tables of pairs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.orientations.group import (
    ASYMMETRIC,
    Orientations,
    along_ray,
    inverse,
)
from nbv.errors import UserError, nearest
from nbv.files import damaged, need_columns, read_given_json, read_rows
from nbv.labels import counted
from nbv.numbers import column, orientation_column, position_column
from nbv.tables.orientation_table import FLIP_DEG, OrientationTable

KEYS = ("scene_id", "im_id", "obj_id")
BOP_COLUMNS = (*KEYS, "score", "R", "t")
TABLE_COLUMNS = ("object_id", "R_true", "R_estimate")

NEAREST_MM = 50.0
"""An estimate farther from every instance of its object matches none of them."""

FEWEST_PAIRS = 12
"""An object with fewer says too little about where it flips."""


def read_orientation_table(
    path: str | Path,
    truth: str | Path | None = None,
    models_info: str | Path | None = None,
    objects: Sequence[str] = (),
) -> OrientationTable:
    """Read pairs of orientations.

    Parameters
    ----------
    path : path
        BOP's results, or a table with `TABLE_COLUMNS` and perhaps score, t_true_mm, scene_id and
        instance. Orientations are object to camera, row by row; positions are in millimetres.
    truth : path, optional
        Truths of BOP's results: a folder with ``<scene>/scene_gt.json``, or a CSV file in the form
        of results. By default the folder of the results.
    models_info : path, optional
        BOP's symmetries; without an entry an object is asymmetric.
    objects : sequence of str
        Objects to keep; all by default.

    Raises
    ------
    UserError
        Names the file and the row.
    """
    return orientation_table(path, read_rows(Path(path), ()), truth, models_info, objects)


def orientation_table(
    path: str | Path,
    rows: pd.DataFrame,
    truth: str | Path | None = None,
    models_info: str | Path | None = None,
    objects: Sequence[str] = (),
) -> OrientationTable:
    """Return the table of a file's rows, as `read_orientation_table` does."""
    path = Path(path)
    left_out: list[str] = []
    is_bop = "obj_id" in rows
    need_columns(path, rows, BOP_COLUMNS if is_bop else TABLE_COLUMNS)
    if is_bop:
        rows, left_out = _matched(path, rows, Path(truth) if truth else path.parent)
    elif truth is not None:
        raise UserError(f"{path} has its own truths (R_true); leave `ground_truth` out")
    symmetries = {} if models_info is None else read_models_info(models_info)
    known = list(dict.fromkeys(rows["object_id"]))
    for name in objects:
        if name not in known:
            raise UserError(f"{path}: no object {name}: {nearest(name, known)}")
    if objects:
        rows = rows[rows["object_id"].isin(objects)]
    counts = rows["object_id"].value_counts()
    for name in dict.fromkeys(rows["object_id"]):
        if counts[name] < FEWEST_PAIRS:
            few = (
                f"object {name}, row {rows.index[rows['object_id'] == name][0] + 2}: "
                f"{counted(int(counts[name]), 'pair')} of an estimate and the truth; "
                f"{FEWEST_PAIRS} are needed"
            )
            if name in objects or counts.max() < FEWEST_PAIRS:
                raise UserError(f"{path}: {few}")
            left_out.append(f"{few}: left out")
    rows = rows[rows["object_id"].map(counts) >= FEWEST_PAIRS]
    truths, estimates = (orientation_column(path, rows, name) for name in TABLE_COLUMNS[1:])
    score = column(path, rows, "score") if "score" in rows else None
    positions = position_column(path, rows, "t_true_mm") if "t_true_mm" in rows else None
    groups = groups_of(rows)
    _check_way_round(path, rows, truths, estimates)
    if positions is not None:
        straightening = along_ray(positions)
        truths, estimates = straightening @ truths, straightening @ estimates
    return OrientationTable(
        rows["object_id"].to_numpy(dtype=str),
        groups,
        estimates,
        truths,
        score,
        positions is not None,
        symmetries,
        tuple(left_out),
    )


def groups_of(rows: pd.DataFrame) -> NDArray[np.str_]:
    """Return the group (n,) of each row: its scene and instance, as far as columns name them."""
    keys = [name for name in ("scene_id", "instance") if name in rows]
    return rows[keys].agg("/".join, axis=1).to_numpy(dtype=str) if keys else np.full(len(rows), "")


def _matched(path: Path, rows: pd.DataFrame, truth: Path) -> tuple[pd.DataFrame, list[str]]:
    """Return BOP's results with the truths of their instances, and what was left out."""
    for name in KEYS:
        rows[name] = column(path, rows, name).astype(int).astype(str)
    position, score = position_column(path, rows, "t"), column(path, rows, "score")
    known = _read_truths(truth, set(rows["scene_id"]))
    for name in KEYS:
        known[name] = column(truth, known, name).astype(int).astype(str)
    positions = position_column(truth, known, "t")
    by_key = {k: list(v) for k, v in known.groupby(list(KEYS)).indices.items()}
    images = set(zip(known["scene_id"], known["im_id"], strict=True))
    scenes = set(known["scene_id"])
    best: dict[int, int] = {}
    n_elsewhere = 0
    for i, key in enumerate(zip(*(rows[k] for k in KEYS), strict=True)):
        if key[0] not in scenes:
            n_elsewhere += 1
            continue
        if key[:2] not in images:
            raise UserError(
                f"{path}, row {i + 2}: scene {key[0]} has no image {key[1]} in {truth}: are "
                "estimates and truths of different images?"
            )
        if (same := by_key.get(key)) is None:
            continue
        apart = np.linalg.norm(positions[same] - position[i], axis=1)
        j = same[int(apart.argmin())]
        if apart.min() <= NEAREST_MM and (j not in best or score[i] > score[best[j]]):
            best[j] = i
    if not best:
        raise UserError(
            f"{path}: none of {len(rows)} estimates is within {NEAREST_MM:g} mm of an instance of "
            f"its object in {truth}: are both of the same images, and object to camera in mm?"
        )
    truths, estimates = list(best), list(best.values())
    matched = rows.iloc[estimates].assign(
        object_id=rows["obj_id"].iloc[estimates],
        R_estimate=rows["R"].iloc[estimates],
        R_true=known["R"].to_numpy()[truths],
        t_true_mm=known["t"].to_numpy()[truths],
    )
    n_free = len(rows) - len(estimates) - n_elsewhere
    left_out = [f"{n_free} of {len(rows)} estimates found no partner"] if n_free else []
    if n_elsewhere:
        left_out.append(f"{n_elsewhere} of {len(rows)} estimates are of scenes without truth")
    return matched.sort_index(), left_out


def _read_truths(truth: Path, scenes: set[str]) -> pd.DataFrame:
    """Read the truths of scenes as texts, in the form of results."""
    if truth.suffix.lower() != ".csv":
        return _read_scenes(truth, scenes)
    return read_rows(truth, (*KEYS, "R", "t"))


def _read_scenes(folder: Path, scenes: set[str]) -> pd.DataFrame:
    truths = []
    for scene in sorted(scenes):
        file = folder / f"{int(scene):06d}" / "scene_gt.json"
        if not file.is_file():
            continue
        for image, entries in _read_entries(file).items():
            try:
                for entry in entries:
                    r, t = (" ".join(map(str, entry[f"cam_{k}_m2c"])) for k in "Rt")
                    truths.append((scene, image, str(int(entry["obj_id"])), r, t))
            except (KeyError, TypeError, ValueError):
                raise UserError(
                    f"{file}, image {image}: an instance lacks obj_id, cam_R_m2c or cam_t_m2c"
                ) from None
    if not truths:
        raise UserError(f"{folder} has no <scene>/scene_gt.json of a scene of the estimates")
    return pd.DataFrame(truths, columns=[*KEYS, "R", "t"])


def read_models_info(path: str | Path) -> dict[str, Any]:
    """Read the entries of BOP's ``models_info.json`` by object."""
    return _read_entries(Path(path))


def _read_entries(path: Path) -> dict[str, Any]:
    given = read_given_json(path, remedy := "give a JSON file of BOP")
    if not isinstance(given, dict):
        raise damaged(path, "it is not a JSON object", remedy)
    return given


def _check_way_round(
    path: Path, rows: pd.DataFrame, truth: Orientations, estimate: Orientations
) -> None:
    """Refuse estimates that would be right the other way round."""
    error, transposed = (
        np.median(ASYMMETRIC.distance_deg(poses, truth)) for poses in (estimate, inverse(estimate))
    )
    if error > FLIP_DEG and transposed < FLIP_DEG / 2:
        raise UserError(
            f"{path}, row {rows.index[0] + 2}: R_estimate or R_true is transposed, camera to "
            "object: give both object to camera, row by row"
        )
