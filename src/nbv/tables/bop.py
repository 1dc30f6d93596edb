"""Calibration pairs in three dimensions: BOP's results with their truths, and tables of pairs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nbv.core.orientations.group import ASYMMETRIC, Orientations, along_ray, inverse
from nbv.errors import UserError, by_number, nearest
from nbv.files import damaged, need_columns, read_given_json, read_rows
from nbv.labels import counted
from nbv.numbers import (
    ROUNDED,
    as_finite,
    as_orientations,
    as_position,
    column,
    orientation_column,
    position_column,
)
from nbv.tables.detections import Detections
from nbv.tables.next_camera import NO_SCORE, scores_of_all
from nbv.tables.orientation_table import FLIP_DEG, OrientationTable

KEYS = ("scene_id", "im_id", "obj_id")
BOP_COLUMNS = (*KEYS, "score", "R", "t")
TABLE_COLUMNS = ("object_id", "R_true", "R_estimate")

NEAREST_MM = 50.0
"""An estimate farther from every instance of its object matches none of them."""

FEWEST_PAIRS = 12
"""An object with fewer says too little about where it flips."""

SAME_MOVE_DEG = 1.0
"""Truths of one move of the camera differ by less."""

PAIR = "have a truth"
FAILED = "are failures: nan, empty, zeros, or exactly R = 1 with t = 0"
BELOW = "have a score below {1:g}"
ELSEWHERE = "are of scenes without truth"
FARTHER = "are farther than {0:g} mm from every instance of their object"
SURPASSED = "are of an instance that has one of a better score"


def read_orientation_table(
    path: str | Path,
    truth: str | Path | None = None,
    models_info: str | Path | None = None,
    objects: Sequence[str] = (),
    nearest_mm: float | None = None,
    least_score: float | None = None,
    *,
    rows: pd.DataFrame | None = None,
) -> OrientationTable:
    """Read pairs of orientations.

    A UserError names the file and the row.

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
    nearest_mm : float, optional
        Results of BOP that are farther from every instance of their object are left out;
        `NEAREST_MM` by default.
    least_score : float, optional
        Estimates of lower scores are left out.
    rows : DataFrame, optional
        The rows of the file, where they have been read.
    """
    path = Path(path)
    given = read_rows(path, ()) if rows is None else rows
    is_bop = "obj_id" in given
    need_columns(path, given, BOP_COLUMNS if is_bop else TABLE_COLUMNS)
    for name, option in (("ground_truth", truth), ("nearest_mm", nearest_mm)):
        if option is not None and not is_bop:
            raise UserError(f"{path} has its own truths (R_true); leave `{name}` out")
    poses = given[["R", "t"] if is_bop else ["R_estimate"]].replace(r"^\s*$", "nan", regex=True)
    fate = poses.agg(" ".join, axis=1).map(lambda text: FAILED if _is_failure(text) else PAIR)
    if (n_failed := (fate == FAILED).sum()) > len(fate) / 2:
        raise UserError(f"{path}: {n_failed} of {len(fate)} estimates {FAILED}; give more poses")
    if least_score is not None:
        as_finite(least_score, "`least_score`", 1)
        need_columns(path, given, ("score",))
        is_below = column(path, given[fate == PAIR], "score") < least_score
        fate[fate == PAIR] = np.where(is_below, BELOW, PAIR)
    rows, missed = given[fate == PAIR], pd.Series(dtype=int)
    if rows.empty:
        raise UserError(f"{path}: no score is {least_score:g} or more; lower `least_score`")
    if is_bop:
        given = _with_keys(path, given)
        nearest_mm = nearest_or_default(nearest_mm)
        folder = path.parent if truth is None else Path(truth)
        rows, fate, missed = _matched(path, given, fate, folder, nearest_mm)
    left_out = [
        f"{n} of {len(given)} estimates " + str(reason).format(nearest_mm, least_score)
        for reason, n in fate[fate != PAIR].value_counts().items()
    ]
    if n_missed := int(missed.sum()):
        left_out.append(f"{n_missed} of {n_missed + len(rows)} instances have no estimate")
    symmetries = {} if models_info is None else _read_entries(Path(models_info))
    if len(set(map(by_number, symmetries))) < len(symmetries):
        raise UserError(f"{models_info} has an object twice, such as 1 and 000001; keep one")
    known = set(rows["object_id"])
    for name in objects:
        if name not in known:
            raise UserError(f"{path}: no object {name}: {nearest(name, known)}")
    if objects:
        rows = rows[rows["object_id"].isin(objects)]
    absent = sorted(set(rows["object_id"]) - set(symmetries), key=by_number)
    if models_info is not None and absent:
        left_out.append(
            f"{models_info} has no entry for object {', '.join(absent)} (it has "
            f"{', '.join(list(symmetries)[:5]) or 'none'}): taken to have no symmetry"
        )
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
    for name, read in zip(TABLE_COLUMNS[1:], (truths, estimates), strict=True):
        if (column(path, rows, name, 9) != read.reshape(-1, 9)).any():
            left_out.append(f"{name}: {ROUNDED}")
    score = column(path, rows, "score") if "score" in rows else None
    if score is not None and scores_of_all(score) is None and (score != NO_SCORE).any():
        left_out.append(
            f"{(score == NO_SCORE).sum()} of {len(score)} pairs have the score -1, BOP's for none, "
            "so that no scores are used; `least_score` 0 leaves these pairs out"
        )
    positions = position_column(path, rows, "t_true_mm") if "t_true_mm" in rows else None
    _check_way_round(path, rows, truths, estimates)
    if positions is not None:
        straightening = along_ray(positions)
        truths, estimates = straightening @ truths, straightening @ estimates
    detections = {}
    for name in dict.fromkeys(rows["object_id"]):
        is_object = given["object_id"] == name
        matched, farther, surpassed = (
            given["score"][is_object & (fate == each)].astype(float).tolist() if is_bop else []
            for each in (PAIR, FARTHER, SURPASSED)
        )
        n_missed, n_failed = int(missed.get(name, 0)), int((is_object & (fate == FAILED)).sum())
        detections[name] = Detections(
            matched, farther, surpassed, n_missed, n_failed, nearest_mm, least_score
        )
    return OrientationTable(
        rows["object_id"].to_numpy(dtype=str),
        groups_of(rows),
        estimates,
        truths,
        score,
        positions is not None,
        symmetries,
        tuple(left_out),
        detections,
    )


def nearest_or_default(nearest_mm: float | None) -> float:
    """Return a distance, `NEAREST_MM` by default; raise UserError unless it is above 0."""
    if nearest_mm is not None and not nearest_mm > 0:
        raise UserError(f"`nearest_mm`={nearest_mm:g}: give a distance above 0, mm")
    return NEAREST_MM if nearest_mm is None else nearest_mm


def groups_of(rows: pd.DataFrame) -> NDArray[np.str_]:
    """Return the group (n,) of each row: its scene and instance, as far as columns name them."""
    keys = [name for name in ("scene_id", "instance") if name in rows]
    return rows[keys].agg("/".join, axis=1).to_numpy(dtype=str) if keys else np.full(len(rows), "")


def _with_keys(path: Path, rows: pd.DataFrame) -> pd.DataFrame:
    for key in KEYS:
        numbers = column(path, rows, key, limit=9e18)
        if (is_part := numbers % 1 != 0).any():
            row = rows.index[is_part.argmax()]
            raise UserError(f"{path}, row {row + 2}: {key} {rows[key][row]} is no integer")
        rows = rows.assign(**{key: numbers.astype(int).astype(str)})
    return rows.assign(image=rows["scene_id"] + "/" + rows["im_id"], object_id=rows["obj_id"])


def _is_failure(pose: str) -> bool:
    """Return whether numbers are what estimators write for no pose; other text is a mistake."""
    try:
        numbers = np.array(pose.split(), dtype=np.float64)
    except ValueError:
        return False
    is_start = np.array_equal(numbers, [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0])
    is_zero = len(numbers) >= 9 and not numbers[:9].any()
    return bool(np.isnan(numbers).any() or is_start or is_zero)


def _matched(
    path: Path, given: pd.DataFrame, fate: pd.Series[Any], truth: Path, nearest_mm: float
) -> tuple[pd.DataFrame, pd.Series[Any], pd.Series[Any]]:
    """Return BOP's results with the truths of their instances, and the fate of every result.

    The number of instances without an estimate follows, by object.
    """
    if truth.suffix.lower() == ".csv":
        known = _with_keys(truth, read_rows(truth, (*KEYS, "R", "t")))
        images = set(known["image"])
    else:
        known, images = _read_scenes(truth, set(given["image"]))
        known = _with_keys(truth, known)
    is_known = given["scene_id"].isin({image.split("/")[0] for image in images})
    if (is_other := is_known & ~given["image"].isin(images)).any():
        row = given.index[is_other][0]
        raise UserError(
            f"{path}, row {row + 2}: scene {given['scene_id'][row]} has no image "
            f"{given['im_id'][row]} in {truth}: are estimates and truths of different images?"
        )
    known = known[known["image"].isin(given["image"])]
    fate = fate.mask((fate == PAIR) & ~is_known, ELSEWHERE)
    rows = given[fate == PAIR]
    position, score = position_column(path, rows, "t"), column(path, rows, "score")
    positions = position_column(truth, known, "t")
    by_key = known.groupby(list(KEYS)).indices
    best: dict[int, int] = {}
    keys = list(zip(*(rows[key] for key in KEYS), strict=True))
    for i in np.argsort(-score, kind="stable"):
        same = by_key.get(keys[i], np.empty(0, dtype=int))
        apart = np.linalg.norm(positions[same] - position[i], axis=1)
        if not (apart <= nearest_mm).any():
            fate[rows.index[i]] = FARTHER
        elif (j := same[apart.argmin()]) in best:
            fate[rows.index[i]] = SURPASSED
        else:
            best[j] = i
    if not best:
        raise UserError(
            f"{path}: none of {len(rows)} estimates is within {nearest_mm:g} mm of an instance of "
            f"its object in {truth}: are both of the same images, and object to camera in mm?"
        )
    found, matched = known.iloc[list(best)], rows.iloc[list(best.values())]
    matched = matched.assign(
        R_estimate=matched["R"],
        R_true=found["R"].to_numpy(),
        t_true_mm=found["t"].to_numpy(),
        scene_id=_with_instances(truth, known)[list(best)],
    )
    missed = known["obj_id"].drop(found.index).value_counts()
    return matched.sort_index(), fate, missed


def _with_instances(truth: Path, known: pd.DataFrame) -> NDArray[np.object_]:
    """Return the scene (n,) of each truth, and its instance where a scene's are told apart.

    An object's instances are told apart by their order in an image. It is the same in all images of
    a static scene if the camera's move between two images is that of every instance.
    """
    order = known.groupby(list(KEYS)).cumcount().astype(str)
    orientations = orientation_column(truth, known, "R")
    names = (known["obj_id"] + "/" + order).to_numpy()
    scenes = known["scene_id"].to_numpy(dtype=object, copy=True)
    for rows in known.groupby("scene_id").indices.values():
        images = known["im_id"].iloc[rows]
        largest = rows[images == images.mode()[0]]
        start = dict(zip(names[largest], orientations[largest], strict=True))
        if not set(start).issuperset(names[rows]):
            continue
        moves = orientations[rows] @ inverse(np.stack([start[name] for name in names[rows]]))
        _, first, image = np.unique(images, return_index=True, return_inverse=True)
        if (ASYMMETRIC.distance_deg(moves, moves[first[image]]) <= SAME_MOVE_DEG).all():
            scenes[rows] += "/" + order.iloc[rows]
    return scenes


def _read_scenes(folder: Path, wanted: set[str]) -> tuple[pd.DataFrame, set[str]]:
    """Read the truths of images as texts, in the form of results, and which images there are."""
    truths, images = [], set()
    files = sorted(folder.glob("*/scene_gt.json"), reverse=True)  # 000001 before 1
    by_scene = {int(file.parent.name): file for file in files if file.parent.name.isdecimal()}
    for scene in sorted({image.split("/")[0] for image in wanted}):
        if (file := by_scene.get(int(scene))) is None:
            continue
        for image, entries in _read_entries(file).items():
            try:
                images.add(name := f"{scene}/{int(image)}")
                for i, entry in enumerate(entries if name in wanted else ()):
                    where = f"{file}, image {image}, instance {i}"
                    given = entry["cam_R_m2c"], entry["cam_t_m2c"], entry["obj_id"]
                    r = as_finite(given[0], f"{where}: cam_R_m2c", 9)
                    as_orientations(r.reshape(3, 3), f"{where}: cam_R_m2c")
                    t = as_position(given[1], f"{where}: cam_t_m2c")
                    if as_finite(given[2], f"{where}: obj_id", 1).item() % 1:
                        raise UserError(f"{where}: obj_id {given[2]} is no integer")
                    numbers = (" ".join(map(repr, each.tolist())) for each in (r, t))
                    truths.append((scene, image, str(given[2]), *numbers))
            except (KeyError, TypeError, ValueError):
                raise UserError(
                    f"{file}, image {image}: an instance lacks obj_id, cam_R_m2c or cam_t_m2c"
                ) from None
    if not images:
        files = sorted(folder.glob("*/scene_gt_*.json"))
        found = [file for file in files if not re.search("info|coco", file.name)][:1]
        hint = f"; copy {found[0]}, or that of the camera in use, to scene_gt.json" if found else ""
        raise UserError(f"{folder} has no <scene>/scene_gt.json of a scene of the estimates{hint}")
    return pd.DataFrame(truths, columns=[*KEYS, "R", "t"], dtype=str), images


def _read_entries(path: Path) -> dict[str, Any]:
    """Read BOP's ``models_info.json`` by object, or ``scene_gt.json`` by image."""
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
